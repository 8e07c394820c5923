"""A mechanism of a model file: a tree of bodies whose numbers are formulas of constants."""

from __future__ import annotations

from dataclasses import dataclass

Triple = tuple[str, str, str]


@dataclass(frozen=True)
class Turn:
    """A fixed rotation by an angle (a formula, rad) about an axis."""

    axis: tuple[float, float, float]
    angle: str


@dataclass(frozen=True, kw_only=True)
class FormulaJoint:
    """A hinge or slide.

    Attributes:
        name: name in the file.
        symbol: name of its coordinate.
        position: position of its axis in the body, formulas.
        zero: coordinate of the body as drawn, a formula.
        limits: lowest and highest position, or None.
        force: name of the input that drives it.
        where: file:line.
    """

    name: str
    symbol: str
    hinge: bool
    axis: tuple[float, float, float]
    position: Triple
    zero: str
    damping: str
    stiffness: str
    rest: str
    armature: str
    limits: tuple[float, float] | None
    where: str
    force: str = ""


@dataclass(frozen=True, kw_only=True)
class FormulaBody:
    """A body. Its frame is shifted and rotated in its parent's frame, then moved by its joints.

    Attributes:
        symbol: name of its frame.
        centred: name of the frame at its centre of mass.
        parent: name of its parent's frame; `ground` without a parent.
        centre, principal: shift and rotations to the frame of its moments of inertia.
        moments, products: Ixx, Iyy, Izz and Ixy, Ixz, Iyz in that frame.
        place: name in engines, such as `body:rod`; empty if the file gives it no name.
    """

    name: str
    symbol: str
    parent: str
    position: Triple
    turns: tuple[Turn, ...]
    joints: tuple[FormulaJoint, ...]
    mass: str
    centre: Triple
    principal: tuple[Turn, ...]
    moments: Triple
    products: Triple
    centred: str = ""
    place: str = ""

    @property
    def heavy(self) -> bool:
        """True if the body has mass or moments of inertia."""
        return self.mass != "0" or any(m != "0" for m in self.moments)


@dataclass(frozen=True)
class Mechanism:
    """Everything that was read, and remarks about it."""

    bodies: tuple[FormulaBody, ...]
    gravity: Triple
    remarks: tuple[str, ...]

    @property
    def joints(self) -> tuple[FormulaJoint, ...]:
        """All joints, in the order of the tree."""
        return tuple(joint for body in self.bodies for joint in body.joints)
