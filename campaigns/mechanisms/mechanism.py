"""A mechanism as plain data: a tree of bodies on hinges and slides, as a model file has it.

Every number is one literal of the file that `campaigns.mechanisms.written` writes, so a fault in a
field is a fault in the file. Fields that a format lacks have their neutral value, such as the
armature and anchor of a joint in URDF.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, TypeVar

Numbers = tuple[float, ...]
Path = tuple[str | int, ...]
"""Path of a number: names of fields, and indices."""

Node = TypeVar("Node")

MJCF, URDF = "mjcf", "urdf"


@dataclass(frozen=True, kw_only=True)
class MechanismLink:
    """A body and its joint to the parent.

    Attributes:
        parent: index of the parent link; -1: the world.
        hinge: whether the joint is a hinge; a slide otherwise.
        position: of its frame in the parent's, m.
        turn: rotation of its frame: a quaternion (w, x, y, z) in MJCF; roll, pitch, yaw in URDF.
        anchor: of the joint in the body's frame, m; zero in URDF.
        axis: of the joint in the body's frame; of any length.
        mass: kg.
        centre: of mass in the body's frame, m.
        inertial_turn: rotation of the inertial frame, as `turn`; empty: the body's frame.
        inertia: xx, yy, zz and, with products, xy, xz, yz, about the centre, kg m^2.
        stiffness, rest, damping: of the joint.
        armature: inertia added to the joint; zero in URDF.
        reference: joint position in the pose that the file describes; zero in URDF.
    """

    parent: int
    hinge: bool
    position: Numbers
    turn: Numbers
    anchor: Numbers = (0.0, 0.0, 0.0)
    axis: Numbers
    mass: float
    centre: Numbers
    inertial_turn: Numbers = ()
    inertia: Numbers
    stiffness: float = 0.0
    rest: float = 0.0
    damping: float = 0.0
    armature: float = 0.0
    reference: float = 0.0


@dataclass(frozen=True, kw_only=True)
class AppliedForce:
    """A force or torque on a joint, not in the file: offset + amplitude sin(rate t + phase)."""

    joint: int
    offset: float
    amplitude: float
    rate: float
    phase: float

    @property
    def varies(self) -> bool:
        """True if the force depends on time."""
        return self.amplitude != 0


@dataclass(frozen=True, kw_only=True)
class RandomMechanism:
    """A tree of links, with an engine, its settings, and a start.

    Attributes:
        links: parents before their children.
        gravity: m/s^2.
        step: time step of the file, s.
        format: `MJCF` or `URDF`.
        engine, integrator: as in sidecars; the integrator may be empty.
        drives: forces on joints.
        q, v: positions and velocities at the start.
    """

    links: tuple[MechanismLink, ...]
    gravity: Numbers
    step: float
    format: str
    engine: str
    integrator: str
    drives: tuple[AppliedForce, ...]
    q: Numbers
    v: Numbers

    @property
    def kinds(self) -> tuple[bool, ...]:
        """True for each joint that is a hinge."""
        return tuple(link.hinge for link in self.links)

    @property
    def products(self) -> bool:
        """True if any body has products of inertia."""
        return any(any(link.inertia[3:]) for link in self.links)

    @property
    def group(self) -> str:
        """Engine, integrator and format, as a text."""
        engine = self.engine + (f" {self.integrator}" if self.integrator else "")
        tensors = ", products" if self.engine == "pybullet" and self.products else ""
        return f"{engine}, {self.format}{tensors}"


NOT_IN_FILE = ("drives", "q", "v")


def literals(mechanism: RandomMechanism) -> tuple[Path, ...]:
    """Return the paths of the nonzero numbers in the model file."""
    return tuple(p for p in _numbers(mechanism, ()) if p[0] not in NOT_IN_FILE)


def _numbers(node: object, path: Path) -> Iterator[Path]:
    if isinstance(node, float):
        if node:
            yield path
    elif isinstance(node, tuple):
        for index, item in enumerate(node):
            yield from _numbers(item, (*path, index))
    elif is_dataclass(node):
        for field in fields(node):
            yield from _numbers(getattr(node, field.name), (*path, field.name))


def with_fault(mechanism: RandomMechanism, path: Path, share: float) -> RandomMechanism:
    """Return the mechanism with the number at `path` multiplied by 1 + `share`."""
    return _with_change(mechanism, path, share)


def _with_change(node: Node, path: Path, share: float) -> Node:
    if not path:
        value: Any = node
        changed: Node = value * (1 + share)
        return changed
    first, *rest = path
    holder: Any = node
    if isinstance(first, int):
        items: Any = list(holder)
        items[first] = _with_change(items[first], tuple(rest), share)
        listed: Node = type(holder)(items)
        return listed
    part = _with_change(getattr(holder, first), tuple(rest), share)
    whole: Node = replace(holder, **{first: part})
    return whole
