"""A robot as its file has it: a tree of bodies, what of the file is in it, and what is not."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.records.case import CaseKind
from physics_crosscheck.reference.mechanism.bodies import Coupling, ForceElement, RigidBody, Triple
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.tree import WORLD, Fluid, Tree


@dataclass(frozen=True, kw_only=True)
class Obstacle:
    """What makes it impossible to build a tree from a file.

    Attributes:
        sentence: what it is.
        file: in which it stands.
        line: of the file, counted from 1; 0 where it is no line's.
        remedy: what to do about it.
        kind: `robot` for a structure that is no tree, `file` for what can't be read, `unsupported`.
    """

    sentence: str
    file: Path
    line: int
    remedy: str
    kind: CaseKind = "robot"

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}" if self.line else f"{self.file}"
        return f"{place}: {self.sentence}; {self.remedy}"


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """What a file says and the tree does not.

    Attributes:
        what: it is, as "dry friction".
        count: how often.
        where: names of the joints or links, as many of them as have one.
    """

    what: str
    count: int
    where: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Part:
    """A link of the file, before those that are welded together are one body.

    Attributes:
        name: in the file.
        line: where it begins, from 1.
        mass: kg.
        center: of mass, in the part's frame, m, (3,).
        inertia: about the center of mass, in the part's frame, kg m^2, (3, 3).
        body: index of the tree's link that it is in; `WORLD` of what stands still, and of all
            where there is no tree.
    """

    name: str
    line: int
    mass: float
    center: Array
    inertia: Array
    body: int = WORLD


@dataclass(frozen=True, kw_only=True)
class Told:
    """What a tree is assembled of: bodies, joints and pulls with the numbers of the file.

    Attributes:
        bodies: parents first.
        gravity: m/s^2.
        pulls: tendons and actuators.
        couplings: joints that follow others.
        medium: in which the bodies move.
    """

    bodies: tuple[RigidBody, ...]
    gravity: Triple
    pulls: tuple[ForceElement, ...] = ()
    couplings: tuple[Coupling, ...] = ()
    medium: Fluid | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Robot:
    """What was read of a file.

    Attributes:
        name: the robot's own.
        file: that was read.
        tree: its bodies and joints, depth first; None just where there are obstacles.
        parts: the file's links, in the file's order.
        limits: lower and upper bound of each velocity's coordinate, infinite where there is none,
            rad or m, each (nv,).
        home: coordinates to begin from, (nv,).
        left_out: what the file says beyond the tree.
        obstacles: all that is in the way of a tree.
        controls: at which its actuators are held, as many as it has inputs.
        told: of which the tree is assembled; None where there is no tree.
        held: joints that stand still, since they move nothing that has inertia.
        shapes: files of meshes and the like without which the bodies can't be had, by the names
            that the file has for them.
        floats: whether the root link moves freely, which a URDF does not say.
        stated: settings that the file says itself, as `ModelSpec` has them.
    """

    name: str
    file: Path
    tree: Tree | None
    parts: tuple[Part, ...]
    limits: tuple[Array, Array]
    home: Array
    left_out: tuple[LeftOut, ...]
    obstacles: tuple[Obstacle, ...]
    controls: tuple[float, ...] = ()
    told: Told | None = None
    held: tuple[str, ...] = ()
    shapes: tuple[str, ...] = ()
    floats: bool = False
    stated: Mapping[str, object] = field(default_factory=dict)

    @property
    def bodies(self) -> tuple[tuple[str, ...], ...]:
        """For each link of the tree, the names of the parts that are welded together in it."""
        count = 0 if self.tree is None else len(self.tree.links)
        return tuple(tuple(p.name for p in self.parts if p.body == i) for i in range(count))


def refused(
    file: Path,
    name: str,
    obstacles: Iterable[Obstacle],
    *,
    parts: tuple[Part, ...] = (),
    left_out: tuple[LeftOut, ...] = (),
) -> Robot:
    """A robot without a tree; what is in the way by its lines, each once."""
    none = np.zeros(0)
    return Robot(
        name=name,
        file=file,
        tree=None,
        parts=parts,
        limits=(none, none),
        home=none,
        left_out=left_out,
        obstacles=tuple(dict.fromkeys(sorted(obstacles, key=lambda one: one.line))),
    )


def home_of(tree: Tree, limits: tuple[Array, Array]) -> Array:
    """Zero where a coordinate may be zero, else the middle of its bounds, (nv,)."""
    home = np.zeros(tree.nv)
    for i, (lower, upper) in enumerate(zip(*map(np.ndarray.tolist, limits), strict=True)):
        if not lower <= 0.0 <= upper:
            home[i] = _between(lower, upper)
    return home


def _between(lower: float, upper: float) -> float:
    """The middle of two bounds, or the finite one of them."""
    finite = [bound for bound in (lower, upper) if abs(bound) != float("inf")]
    return sum(finite) / len(finite)
