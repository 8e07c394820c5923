"""A mechanism as a model file has it: a tree of bodies; numbers are formulas of constants."""

from __future__ import annotations

from dataclasses import dataclass

Triple = tuple[str, str, str]


@dataclass(frozen=True)
class Turn:
    """A fixed turn by an angle (a formula, rad) about an axis."""

    axis: tuple[float, float, float]
    angle: str


@dataclass(frozen=True, kw_only=True)
class Joint:
    """A hinge or slide.

    Attributes:
        name: as the file has it.
        symbol: name of its coordinate.
        at: the place of its axis in the body, formulas.
        zero: where the body is as drawn, a formula.
        limits: lowest and highest position, or None.
        force: name of the input that drives it.
        where: file:line.
    """

    name: str
    symbol: str
    hinge: bool
    axis: tuple[float, float, float]
    at: Triple
    zero: str
    damping: str
    stiffness: str
    rest: str
    armature: str
    limits: tuple[float, float] | None
    where: str
    force: str = ""


@dataclass(frozen=True, kw_only=True)
class Body:
    """A body, its frame placed in its parent's: shifted, turned, then moved by its joints.

    Attributes:
        symbol: name of its frame; `centred`: of the one at its centre of mass.
        parent: name of its parent's frame, `ground` for none.
        centre, principal: shift and turns to the frame of its moments.
        moments, products: Ixx, Iyy, Izz and Ixy, Ixz, Iyz there.
        place: what engines call it, `body:rod`; empty where the file gives it no name.
    """

    name: str
    symbol: str
    parent: str
    at: Triple
    turns: tuple[Turn, ...]
    joints: tuple[Joint, ...]
    mass: str
    centre: Triple
    principal: tuple[Turn, ...]
    moments: Triple
    products: Triple
    centred: str = ""
    place: str = ""

    @property
    def heavy(self) -> bool:
        """Whether it has mass or moments."""
        return self.mass != "0" or any(m != "0" for m in self.moments)


@dataclass(frozen=True)
class Mechanism:
    """All that was read, and what there is to say about it."""

    bodies: tuple[Body, ...]
    gravity: Triple
    remarks: tuple[str, ...]

    @property
    def joints(self) -> tuple[Joint, ...]:
        """Every joint, in the order of the tree."""
        return tuple(joint for body in self.bodies for joint in body.joints)
