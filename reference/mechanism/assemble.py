"""Assemble bodies into a tree: welded bodies merge, several joints of a body become a chain."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .bodies import BodyModel, Coupling, ForceElement, Joint, RigidBody, Site, Triple, powers
from .chart import Coupled, coordinate_names
from .declaration import Coordinate, Declaration, DeclarationError
from .numeric import Array
from .rotations import DOUBLES, IDENTITY, NO_INERTIA, Place, SpatialInertia, about_axis
from .tree import (
    VELOCITIES,
    WORLD,
    Bushing,
    Fluid,
    Immersed,
    JointForce,
    LinkFrame,
    Tree,
    TreeCoupling,
    TreeError,
    TreeForce,
    TreeLink,
    Way,
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Assembled:
    """A tree, and what else its bodies state.

    Attributes:
        tree: links in the order of the bodies.
        limits: lower and upper bound of each velocity's coordinate, rad or m, each (nv,); infinite
            where there is no limit.
        cancelled: names of bodies whose mass cancels the mass of the bodies they are welded to.
    """

    tree: Tree
    limits: tuple[Array, Array]
    cancelled: tuple[str, ...]


def assembled(
    bodies: Sequence[RigidBody],
    gravity: Triple,
    pulls: Sequence[ForceElement] = (),
    couplings: Sequence[Coupling] = (),
    fluid: Fluid | None = None,
) -> Assembled:
    """Assemble bodies into a tree, parents before children.

    A joint's link frame has its origin at the joint's anchor. Its axes are the body's axes when the
    joint is at `zero`. The last link of a body carries the mass.

    Args:
        bodies: parents first.
        gravity: m/s^2.
        pulls: force elements of tendons and actuators.
        couplings: joints that follow other joints.
        fluid: fluid around the bodies.

    Raises:
        TreeError: with the body, joint or force element that does not fit.
    """
    builder = _Builder(fluid is not None)
    for body in bodies:
        builder.add(body)
    lower, upper = np.array(builder.bounds, dtype=float).reshape(-1, 2).T
    pulled = (*builder.pulls, *(builder.force_element(element) for element in pulls))
    tree = Tree(
        links=tuple(builder.whole()),
        gravity=np.array(gravity, dtype=float),
        pulls=pulled,
        couplings=tuple(map(builder.coupling, couplings)),
        fluid=fluid,
        bushings=tuple(builder.bushings),
        immersed=tuple(builder.immersed),
        frames=builder.places,
    )
    return Assembled(
        tree=tree,
        limits=(lower, upper),
        cancelled=tuple(builder.cancelled),
    )


def assemble(model: BodyModel) -> Assembled:
    """Assemble the input of a tree; TreeError names the joint of a force that the bodies lack."""
    return assembled(model.bodies, model.gravity, model.pulls, model.couplings, model.fluid)


def with_bodies(tree: Tree, bodies: Mapping[str, RigidBody], changed: Collection[str]) -> Tree:
    """Return an assembled tree for other numbers of some bodies and of their joints.

    Args:
        tree: the tree, without a fluid.
        bodies: all bodies by their names, parents first; none of them is lifted. Parents, and names
            and kinds of joints, are those of the tree.
        changed: names of those that differ.
    """
    links, frames = list(tree.links), dict(tree.frames)
    joints = {link.name: i for i, link in enumerate(links)}
    moved, loaded = set[str](), set[int]()
    for name, body in bodies.items():
        if name not in changed and body.parent not in moved:
            continue
        within, place = (WORLD, IDENTITY) if body.parent is None else frames[body.parent]
        place = place.compose(body.place)
        for joint in body.joints:
            link, within = _link(joint, within, place), joints[joint.name]
            links[within] = _carrying(link, _inertia(links[within]))
            place = _after(joint)
        loaded.add(within)
        if not all(map(np.array_equal, place, frames[name][1])):
            frames[name] = within, place
            moved.add(name)
    for index in loaded - {WORLD}:
        inertia = NO_INERTIA
        for name, (within, place) in frames.items():
            if within == index:
                inertia = _welded(inertia, bodies[name].spatial_inertia, place) or inertia
        links[index] = _carrying(links[index], inertia)
    # Equal frames stay the same object.
    return replace(tree, links=tuple(links), frames=frames if moved else tree.frames)


def _inertia(link: TreeLink) -> SpatialInertia:
    return SpatialInertia(link.mass, link.center, link.inertia)


def _carrying(link: TreeLink, inertia: SpatialInertia) -> TreeLink:
    return replace(link, mass=inertia.mass, center=inertia.center, inertia=inertia.inertia)


def _link(joint: Joint, within: int, place: Place) -> TreeLink:
    """Return the massless link of a joint of a body, whose frame is given in the link before it."""
    origin, axis = place.transform(np.array(joint.at, dtype=float)), joint.direction
    rotation = place.rotation
    if joint.kind == "hinge" and joint.zero:
        rotation = rotation @ about_axis(axis, np.array(-joint.zero), DOUBLES)
    elif joint.kind == "slide" and joint.zero:
        origin = origin - rotation @ axis * joint.zero
    linear = joint.single and not joint.nonlinear
    return TreeLink(
        name=joint.name,
        parent=within,
        position=origin,
        rotation=rotation,
        kind=joint.kind,
        axis=axis,
        mass=0.0,
        center=np.zeros(3),
        inertia=np.zeros((3, 3)),
        armature=float(joint.armature),
        damping=_only(powers(joint.damping)),
        stiffness=_only(powers(joint.stiffness)) if linear else 0.0,
        rest=(float(joint.rest),),
        pitch=float(joint.pitch),
    )


def _after(joint: Joint) -> Place:
    """Return the frame of a body in the link of its joint."""
    return Place(np.eye(3), -np.array(joint.at, dtype=float))


def _welded(inertia: SpatialInertia, added: SpatialInertia, place: Place) -> SpatialInertia | None:
    """Return the inertia of a link with another body; None if this cancels its mass."""
    placed = added.in_frame(place)
    if placed.mass and placed.mass == -inertia.mass:
        return None
    return inertia.combined(placed)


class _Builder:
    """The links built so far; boxes for drag are recorded only if there is a fluid."""

    def __init__(self, has_fluid: bool) -> None:
        self._has_fluid = has_fluid
        self.places: dict[str, tuple[int, Place]] = {}
        self.bounds: list[tuple[float, float]] = []
        self.pulls: list[TreeForce] = []
        self.cancelled: list[str] = []
        self.immersed: list[Immersed] = []
        self.bushings: list[Bushing] = []
        self._links: list[TreeLink] = []
        self._inertias: list[SpatialInertia] = []
        self._lifts: list[SpatialInertia] = []
        self._joints: dict[str, int] = {}

    def add(self, body: RigidBody) -> None:
        """Attach a body to its parent."""
        if body.name in self.places:
            raise TreeError(f"two bodies have the name {body.name!r}")
        within, place = WORLD, IDENTITY
        if body.parent is not None:
            if body.parent not in self.places:
                raise TreeError(
                    f"the parent of body {body.name!r}, {body.parent!r}, must come before it"
                )
            within, place = self.places[body.parent]
        place = place.compose(body.place)
        for joint in body.joints:
            within, place = self._joint(joint, within, place)
        self.places[body.name] = within, place
        if within != WORLD:
            self._load(body, within, place)

    def _load(self, body: RigidBody, within: int, place: Place) -> None:
        """Add a body's mass to its link."""
        inertia = body.spatial_inertia
        whole = _welded(self._inertias[within], inertia, place)
        if whole is None:
            self.cancelled.append(body.name)
            return
        self._inertias[within] = whole
        if body.lift:
            lifted = inertia._replace(mass=inertia.mass * body.lift, inertia=np.zeros((3, 3)))
            self._lifts[within] = self._lifts[within].combined(lifted.in_frame(place))
        if self._has_fluid and body.dragged and (box := body.box) is not None:
            box_place = place.compose(box[0])
            self.immersed.append(
                Immersed(
                    link=within, position=box_place.origin, rotation=box_place.rotation, size=box[1]
                )
            )

    def _joint(self, joint: Joint, within: int, place: Place) -> tuple[int, Place]:
        """Add a joint; return its link and the body's frame in that link."""
        if joint.name in self._joints:
            raise TreeError(f"two joints have the name {joint.name!r}")
        index = self._joints[joint.name] = len(self._links)
        damping, stiffness = powers(joint.damping), powers(joint.stiffness)
        if joint.nonlinear and joint.single:
            self.pulls.append(
                TreeForce(name=joint.name, joints=((index, 1.0),), stiffness=stiffness,
                         damping=(0.0, *damping[1:]) if damping[1:] else (),
                         rest=(joint.rest, joint.rest))
            )  # fmt: skip
        self._links.append(_link(joint, within, place))
        self._inertias.append(NO_INERTIA)
        self._lifts.append(NO_INERTIA)
        if not joint.single and (powers(joint.stiffness) or len(damping) > 1):
            self.bushings.append(_bushing(joint, index))
        bounds = (joint.limits if joint.single else None) or (-np.inf, np.inf)
        self.bounds += [bounds] * VELOCITIES[joint.kind]
        return index, _after(joint)

    def whole(self) -> Iterator[TreeLink]:
        """Yield the links with their total masses."""
        for link, inertia, lift in zip(self._links, self._inertias, self._lifts, strict=True):
            yield replace(
                link,
                mass=inertia.mass,
                center=inertia.center,
                inertia=inertia.inertia,
                lifted=lift.mass,
                lift=lift.center,
            )

    def force_element(self, element: ForceElement) -> TreeForce:
        """Return a force element of the tree, with its control fixed at the declared value."""
        what, pairs = f"pull {element.name!r}", zip(element.bias, element.gain, strict=True)
        constant, slope, drag = (float(b + g * element.control) for b, g in pairs)
        stiffness, damping = powers(element.stiffness), powers(element.damping)
        if slope or drag:
            stiffness, damping = powers(-slope), powers(-drag)
        return TreeForce(
            name=element.name,
            joints=tuple((self._index(name, what), float(share)) for name, share in element.joints),
            along=self._along(element, what),
            constant=constant,
            stiffness=stiffness,
            damping=damping,
            rest=element.rest,
            armature=element.armature,
        )

    def _along(self, element: ForceElement, what: str) -> Way | None:
        if element.along is None:
            return None
        if isinstance(element.along, JointForce):
            return element.along.mapped(lambda joint: self._index(joint, what))
        return element.along.mapped(lambda site: self._marked(site, what))

    def _marked(self, site: Site, what: str) -> LinkFrame:
        within, place = WORLD, IDENTITY
        if site.body is not None:
            if site.body not in self.places:
                raise TreeError(f"{what} names body {site.body!r}, which does not exist")
            within, place = self.places[site.body]
        place = place.compose(site.place)
        return LinkFrame(link=within, position=place.origin, rotation=place.rotation)

    def coupling(self, declared: Coupling) -> TreeCoupling:
        """Return a coupling with link indices instead of joint names."""
        what = f"the coupling of {declared.follower!r}"
        return TreeCoupling(
            follower=self._index(declared.follower, what),
            leader=None if declared.leader is None else self._index(declared.leader, what),
            multiplier=declared.multiplier,
            offset=declared.offset,
            others=tuple((self._index(name, what), share) for name, share in declared.others),
        )

    def _index(self, joint: str, what: str) -> int:
        if joint not in self._joints:
            raise TreeError(f"{what} names joint {joint!r}, which does not exist")
        return self._joints[joint]


def _only(values: tuple[float, ...]) -> float:
    return float(values[0]) if values else 0.0


def _bushing(joint: Joint, index: int) -> Bushing:
    turn = np.array(joint.rest_turn or (1.0, 0.0, 0.0, 0.0), dtype=float)
    w, x, y, z = map(float, turn / np.linalg.norm(turn))
    return Bushing(
        link=index,
        stiffness=powers(joint.stiffness),
        damping=powers(joint.damping)[1:],
        place=joint.rest_place,
        turn=(w, x, y, z),
    )


@dataclass(frozen=True, kw_only=True)
class TreeSystem(Declaration):
    """A mechanism declared by bodies instead of energies; T, V and D are unused.

    Its coordinates are the independent joint coordinates (`reference.mechanism.chart`), in the
    tree's order.

    Raises:
        DeclarationError: if the coordinates do not match the tree.
    """

    tree: Tree

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.coordinates) != self.tree.dof:
            raise DeclarationError(
                f"system {self.name!r} has {len(self.coordinates)} coordinates, but "
                f"its tree has {self.tree.dof} degrees of freedom"
            )


def tree_system(*, name: str, title: str, source: str, tree: Tree) -> TreeSystem:
    """Return a tree as a system with the independent joint coordinates."""
    rows = [row for link in tree.links for row in coordinate_names(link.kind, link.name)]
    return TreeSystem(
        name=name,
        title=title,
        source=source,
        coordinates=tuple(
            Coordinate(row, unit, f"joint {row.partition(':')[0]}")
            for row, unit in (rows[i] for i in Coupled(tree).kept)
        ),
        constants=(),
        inputs=(),
        outputs=(),
        T=0,
        V=0,
        D=0,
        equilibria=(),
        scenarios=(),
        published=(),
        tree=tree,
    )


@dataclass(frozen=True, kw_only=True)
class MultibodySystem:
    """A mechanism of bodies, joints and force elements, with a model's numbers in SI units.

    Attributes:
        name: name of the system.
        title: a few words about it.
        source: source of the numbers.
        gravity: m/s^2.
        bodies: parents before children.
        pulls: tendons and actuators.
        couplings: joints that follow others.
        fluid: fluid around the bodies; None for none.

    Raises:
        DeclarationError: with the body, joint or force element that does not fit.
    """

    name: str
    title: str
    source: str
    gravity: Triple
    bodies: tuple[RigidBody, ...]
    pulls: tuple[ForceElement, ...] = ()
    couplings: tuple[Coupling, ...] = ()
    fluid: Fluid | None = None

    def __post_init__(self) -> None:
        try:
            assembly = self.assembled
            Coupled(assembly.tree)  # raises if joints follow each other in a cycle
        except TreeError as error:
            raise DeclarationError(str(error)) from None
        if not assembly.tree.links:
            raise DeclarationError(f"system {self.name!r} has no joint, so nothing moves")
        for name in assembly.cancelled:
            raise DeclarationError(
                f"the masses of body {name!r} and of the bodies fixed to it do not "
                "add up to a positive mass; write positive masses"
            )

    @cached_property
    def assembled(self) -> Assembled:
        """The tree, and the location of each body in it."""
        return assembled(self.bodies, self.gravity, self.pulls, self.couplings, self.fluid)

    @cached_property
    def tree_system(self) -> TreeSystem:
        """The tree as a system of equations."""
        tree = self.assembled.tree
        return tree_system(name=self.name, title=self.title, source=self.source, tree=tree)
