"""Links and joints of a URDF put together: what is welded is one body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from harness.robots.lump import HERE, NOTHING, Lump, Place
from harness.robots.urdf_parts import ENDLESS, UrdfJoint, UrdfLink
from reference.multibody.tree import VELOCITIES, WORLD, Kind, Link, Tree
from reference.numeric import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class _Body:
    """A body of the tree before its masses are known; `place` is its joint's, in the parent's."""

    name: str
    parent: int
    place: Place
    kind: Kind
    axis: Array
    damping: float
    bounds: tuple[float, float]


@dataclass(frozen=True)
class Plan:
    """What hangs from what.

    Attributes:
        bodies: index of each link's body, by the link's name.
        cancelled: names of links whose mass takes all of that which they are welded to.
    """

    bodies: dict[str, int] = field(default_factory=dict)
    cancelled: list[str] = field(default_factory=list)
    _planned: list[_Body] = field(default_factory=list)
    _lumps: list[Lump] = field(default_factory=list)

    def tree(self, springs: Mapping[str, tuple[float, float]], gravity: Array) -> Tree:
        """The tree; springs are stiffness and rest, by the joint's name."""
        links = []
        for body, lump in zip(self._planned, self._lumps, strict=True):
            free = body.kind in ("free", "ball")
            stiffness, rest = (0.0, 0.0) if free else springs.get(body.name, (0.0, 0.0))
            links.append(
                Link(
                    name=body.name,
                    parent=body.parent,
                    position=body.place.origin,
                    rotation=body.place.rotation,
                    kind=body.kind,
                    axis=body.axis,
                    mass=lump.mass,
                    center=lump.center,
                    inertia=lump.inertia,
                    damping=0.0 if body.kind == "free" else body.damping,
                    stiffness=stiffness,
                    rest=(rest,),
                )
            )
        return Tree(links=tuple(links), gravity=gravity)

    @property
    def limits(self) -> tuple[Array, Array]:
        """Lower and upper bounds, each (nv,)."""
        rows = [body.bounds for body in self._planned for _ in range(VELOCITIES[body.kind])]
        lower, upper = np.array(rows, dtype=float).reshape(-1, 2).T
        return lower, upper

    def _add(self, joint: UrdfJoint, kind: Kind, parent: int, place: Place) -> int:
        self._planned.append(
            _Body(name=joint.name, parent=parent, place=place, kind=kind, axis=joint.axis,
                  damping=joint.damping, bounds=joint.bounds)
        )  # fmt: skip
        self._lumps.append(NOTHING)
        return len(self._planned) - 1

    def _hang(self, link: UrdfLink | None, body: int, place: Place) -> None:
        """Weld a link to a body, in whose frame it stands."""
        if link is None:
            return
        self.bodies[link.name] = body
        if body == WORLD:
            return
        own = link.lump.seen(place)
        if own.mass and own.mass == -self._lumps[body].mass:
            self.cancelled.append(link.name)
        else:
            self._lumps[body] = self._lumps[body].with_(own)


def planned(
    root: str, links: Mapping[str, UrdfLink], joints: Mapping[str, UrdfJoint], floating: bool
) -> Plan:
    """Bodies depth first, from the root; joints of one link in the file's order."""
    plan = Plan()
    below: dict[str, list[UrdfJoint]] = {}
    for joint in joints.values():
        below.setdefault(joint.parent, []).append(joint)
    body = WORLD
    if floating:
        name = root
        while name in joints:
            name += "_free"
        body = plan._add(_free(name, links[root]), "free", WORLD, HERE)
    plan._hang(links.get(root), body, HERE)
    waiting = [(joint, body, HERE) for joint in reversed(below.get(root, []))]
    while waiting:
        joint, body, place = waiting.pop()
        place = place.of(joint.place)
        if joint.kind is not None:
            body, place = plan._add(joint, joint.kind, body, place), HERE
        plan._hang(links[joint.child], body, place)
        waiting += [(one, body, place) for one in reversed(below.get(joint.child, []))]
    return plan


def _free(name: str, root: UrdfLink) -> UrdfJoint:
    """The joint of a root that moves freely."""
    return UrdfJoint(
        name=name,
        element=root.element,
        kind="free",
        parent="",
        child=root.name,
        place=HERE,
        axis=np.array([1.0, 0.0, 0.0]),
        damping=0.0,
        bounds=ENDLESS,
    )
