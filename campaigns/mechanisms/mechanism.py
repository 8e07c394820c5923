"""A mechanism as plain data: a tree of bodies on hinges and slides, as a model file has it.

Every number stands for one literal of the file that `campaigns.mechanisms.written` makes of it, so
that a fault in a field is a fault in the file. What a format has no word for is at its neutral
value: no armature, anchor or offset of a joint in a URDF.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, TypeVar

Numbers = tuple[float, ...]
Path = tuple[str | int, ...]
"""Where a number stands: names of fields, and indices."""

Node = TypeVar("Node")

MJCF, URDF = "mjcf", "urdf"


@dataclass(frozen=True, kw_only=True)
class Link:
    """A body and the joint that holds it to its parent.

    Attributes:
        parent: index of the link it hangs on; -1: the world.
        hinge: or a slide.
        position: of its frame in its parent's, m.
        turn: of its frame: a quaternion (w, x, y, z) in MJCF; roll, pitch and yaw in URDF.
        anchor: of the joint in the body's frame, m; MJCF alone, zero in URDF.
        axis: of the joint in the body's frame; of any length.
        mass: kg.
        centre: of mass in the body's frame, m.
        inertial_turn: of the inertia's frame, as `turn`; empty: that of the body's.
        inertia: xx, yy, zz, and where there are products xy, xz, yz, about the centre, kg m^2.
        stiffness, rest, damping: of the joint.
        armature: inertia added to the joint; MJCF alone.
        reference: where the joint is as the file draws it; MJCF alone.
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
    """A force or torque on one joint: offset + amplitude sin(rate t + phase). Not in the file."""

    joint: int
    offset: float
    amplitude: float
    rate: float
    phase: float

    @property
    def varies(self) -> bool:
        return self.amplitude != 0


@dataclass(frozen=True, kw_only=True)
class Mechanism:
    """A tree of links, with how it is stepped and where it starts.

    Attributes:
        links: parents before their children.
        gravity: m/s^2.
        step: that the file ships with, seconds.
        format: `MJCF` or `URDF`.
        engine, integrator: as in sidecars; the integrator may be empty.
        drives: forces on joints.
        q, v: where it starts.
    """

    links: tuple[Link, ...]
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
        """Which joints are hinges."""
        return tuple(link.hinge for link in self.links)

    @property
    def products(self) -> bool:
        """Whether any body has products of inertia."""
        return any(any(link.inertia[3:]) for link in self.links)

    @property
    def group(self) -> str:
        """How it is stepped, in a few words."""
        own = self.engine + (f" {self.integrator}" if self.integrator else "")
        tensors = ", products" if self.engine == "pybullet" and self.products else ""
        return f"{own}, {self.format}{tensors}"


NOT_WRITTEN = ("drives", "q", "v")


def literals(mechanism: Mechanism) -> tuple[Path, ...]:
    """The numbers other than zero of the model file, by where they stand."""
    return tuple(p for p in _numbers(mechanism, ()) if p[0] not in NOT_WRITTEN)


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


def with_fault(mechanism: Mechanism, path: Path, share: float) -> Mechanism:
    """The same with one number off by a share of itself."""
    return _changed(mechanism, path, share)


def _changed(node: Node, path: Path, share: float) -> Node:
    if not path:
        value: Any = node
        changed: Node = value * (1 + share)
        return changed
    first, *rest = path
    holder: Any = node
    if isinstance(first, int):
        items: Any = list(holder)
        items[first] = _changed(items[first], tuple(rest), share)
        listed: Node = type(holder)(items)
        return listed
    part = _changed(getattr(holder, first), tuple(rest), share)
    whole: Node = replace(holder, **{first: part})
    return whole
