"""Assemble bodies into a tree: welded bodies merge, several joints of a body become a chain."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from physics_crosscheck.reference.mechanism.bodies import (
    Coupling,
    ForceElement,
    Joint,
    RigidBody,
    Site,
    Triple,
    powers,
)
from physics_crosscheck.reference.mechanism.force_paths import JointForce, Mark, Way
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import DOUBLES, about_axis
from physics_crosscheck.reference.mechanism.spatial_inertia import HERE, NOTHING, Lump, Place
from physics_crosscheck.reference.mechanism.tree import (
    VELOCITIES,
    WORLD,
    Bush,
    Fluid,
    Immersed,
    Link,
    Tree,
    TreeError,
)
from physics_crosscheck.reference.mechanism.tree import Coupling as TreeCoupling
from physics_crosscheck.reference.mechanism.tree import Pull as TreePull


@dataclass(frozen=True, kw_only=True, eq=False)
class Assembled:
    """A tree and the location of each body in it.

    Attributes:
        tree: links in the order of the bodies.
        bodies: index of each body's link, by body name; `WORLD` for fixed bodies.
        limits: lower and upper bound of each velocity's coordinate, rad or m, each (nv,); infinite
            where there is no limit.
        cancelled: names of bodies whose mass cancels the mass of the bodies they are welded to.
    """

    tree: Tree
    bodies: Mapping[str, int]
    limits: tuple[Array, Array]
    cancelled: tuple[str, ...]


def assembled(
    bodies: Sequence[RigidBody],
    gravity: Triple,
    pulls: Sequence[ForceElement] = (),
    couplings: Sequence[Coupling] = (),
    medium: Fluid | None = None,
) -> Assembled:
    """Assemble bodies into a tree, parents before children.

    A joint's link frame has its origin at the joint's anchor. Its axes are the body's axes when the
    joint is at `zero`. The last link of a body carries the mass.

    Args:
        bodies: parents first.
        gravity: m/s^2.
        pulls: force elements of tendons and actuators.
        couplings: joints that follow other joints.
        medium: fluid around the bodies.

    Raises:
        TreeError: with the body, joint or force element that does not fit.
    """
    builder = _Builder(medium is not None)
    for body in bodies:
        builder.add(body)
    lower, upper = np.array(builder.bounds, dtype=float).reshape(-1, 2).T
    pulled = (*builder.pulls, *(builder.pull(one) for one in pulls))
    tree = Tree(
        links=tuple(builder.whole()),
        gravity=np.array(gravity, dtype=float),
        pulls=pulled,
        couplings=tuple(map(builder.coupling, couplings)),
        medium=medium,
        bushes=tuple(builder.bushes),
        immersed=tuple(builder.immersed),
    )
    return Assembled(
        tree=tree,
        bodies={name: link for name, (link, _) in builder.places.items()},
        limits=(lower, upper),
        cancelled=tuple(builder.cancelled),
    )


class _Builder:
    """The links built so far; boxes for drag are recorded only if there is a fluid."""

    def __init__(self, medium: bool) -> None:
        self._medium = medium
        self.places: dict[str, tuple[int, Place]] = {}
        self.bounds: list[tuple[float, float]] = []
        self.pulls: list[TreePull] = []
        self.cancelled: list[str] = []
        self.immersed: list[Immersed] = []
        self.bushes: list[Bush] = []
        self._links: list[Link] = []
        self._lumps: list[Lump] = []
        self._lifts: list[Lump] = []
        self._joints: dict[str, int] = {}

    def add(self, body: RigidBody) -> None:
        """Attach a body to its parent."""
        if body.name in self.places:
            raise TreeError(f"two bodies have the name {body.name!r}")
        within, place = WORLD, HERE
        if body.parent is not None:
            if body.parent not in self.places:
                raise TreeError(
                    f"the parent of body {body.name!r}, {body.parent!r}, must come before it"
                )
            within, place = self.places[body.parent]
        place = place.of(body.place)
        for joint in body.joints:
            within, place = self._joint(joint, within, place)
        self.places[body.name] = within, place
        if within != WORLD:
            self._load(body, within, place)

    def _load(self, body: RigidBody, within: int, place: Place) -> None:
        """Add a body's mass to its link."""
        lump = body.lump
        own = lump.seen(place)
        if own.mass and own.mass == -self._lumps[within].mass:
            self.cancelled.append(body.name)
            return
        self._lumps[within] = self._lumps[within].with_(own)
        if body.lift:
            lifted = lump._replace(mass=lump.mass * body.lift, inertia=np.zeros((3, 3)))
            self._lifts[within] = self._lifts[within].with_(lifted.seen(place))
        if self._medium and body.dragged and (box := body.box) is not None:
            at = place.of(box[0])
            self.immersed.append(
                Immersed(link=within, position=at.origin, rotation=at.rotation, size=box[1])
            )

    def _joint(self, joint: Joint, within: int, place: Place) -> tuple[int, Place]:
        """Add a joint; return its link and the body's frame in that link."""
        if joint.name in self._joints:
            raise TreeError(f"two joints have the name {joint.name!r}")
        anchor = np.array(joint.at, dtype=float)
        at, rotation, axis = place.at(anchor), place.rotation, joint.direction
        if joint.kind == "hinge" and joint.zero:
            rotation = rotation @ about_axis(axis, np.array(-joint.zero), DOUBLES)
        elif joint.kind == "slide" and joint.zero:
            at = at - rotation @ axis * joint.zero
        index = self._joints[joint.name] = len(self._links)
        damping, stiffness = powers(joint.damping), powers(joint.stiffness)
        if joint.bent and joint.single:
            self.pulls.append(
                TreePull(name=joint.name, joints=((index, 1.0),), stiffness=stiffness,
                         damping=damping, rest=(joint.rest, joint.rest))
            )  # fmt: skip
        self._links.append(
            Link(
                name=joint.name,
                parent=within,
                position=at,
                rotation=rotation,
                kind=joint.kind,
                axis=axis,
                mass=0.0,
                center=np.zeros(3),
                inertia=np.zeros((3, 3)),
                armature=float(joint.armature),
                damping=0.0 if joint.bent and joint.single else _only(damping),
                stiffness=_only(stiffness) if joint.single and not joint.bent else 0.0,
                rest=(float(joint.rest),),
            )
        )
        self._lumps.append(NOTHING)
        self._lifts.append(NOTHING)
        if not joint.single and (powers(joint.stiffness) or len(damping) > 1):
            self.bushes.append(_bush(joint, index))
        bounds = (joint.limits if joint.single else None) or (-np.inf, np.inf)
        self.bounds += [bounds] * VELOCITIES[joint.kind]
        return index, Place(np.eye(3), -anchor)

    def whole(self) -> Iterator[Link]:
        """Yield the links with their total masses."""
        for link, lump, lift in zip(self._links, self._lumps, self._lifts, strict=True):
            whole = replace(link, mass=lump.mass, center=lump.center, inertia=lump.inertia)
            yield replace(whole, lifted=lift.mass, lift=lift.center)

    def pull(self, one: ForceElement) -> TreePull:
        """Return a force element of the tree, with its control fixed at the declared value."""
        what, pairs = f"pull {one.name!r}", zip(one.bias, one.gain, strict=True)
        constant, slope, drag = (float(b + g * one.control) for b, g in pairs)
        stiffness, damping = powers(one.stiffness), powers(one.damping)
        if slope or drag:
            stiffness, damping = powers(-slope), powers(-drag)
        return TreePull(
            name=one.name,
            joints=tuple((self._index(name, what), float(share)) for name, share in one.joints),
            along=self._along(one, what),
            constant=constant,
            stiffness=stiffness,
            damping=damping,
            rest=one.rest,
            armature=one.armature,
        )

    def _along(self, one: ForceElement, what: str) -> Way | None:
        if one.along is None:
            return None
        if isinstance(one.along, JointForce):
            return one.along.at(lambda joint: self._index(joint, what))
        return one.along.at(lambda site: self._marked(site, what))

    def _marked(self, site: Site, what: str) -> Mark:
        within, place = WORLD, HERE
        if site.body is not None:
            if site.body not in self.places:
                raise TreeError(f"{what} names body {site.body!r}, which does not exist")
            within, place = self.places[site.body]
        place = place.of(site.place)
        return Mark(link=within, position=place.origin, rotation=place.rotation)

    def coupling(self, one: Coupling) -> TreeCoupling:
        """Return a coupling with link indices instead of joint names."""
        what = f"the coupling of {one.follower!r}"
        return TreeCoupling(
            follower=self._index(one.follower, what),
            leader=None if one.leader is None else self._index(one.leader, what),
            multiplier=one.multiplier,
            offset=one.offset,
            others=tuple((self._index(name, what), share) for name, share in one.others),
        )

    def _index(self, joint: str, what: str) -> int:
        if joint not in self._joints:
            raise TreeError(f"{what} names joint {joint!r}, which does not exist")
        return self._joints[joint]


def _only(values: tuple[float, ...]) -> float:
    return float(values[0]) if values else 0.0


def _bush(joint: Joint, index: int) -> Bush:
    turn = np.array(joint.rest_turn or (1.0, 0.0, 0.0, 0.0), dtype=float)
    w, x, y, z = map(float, turn / np.linalg.norm(turn))
    return Bush(
        link=index,
        stiffness=powers(joint.stiffness),
        damping=powers(joint.damping)[1:],
        place=joint.rest_place,
        turn=(w, x, y, z),
    )
