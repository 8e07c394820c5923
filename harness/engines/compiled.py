"""A model file as the numbers that an engine makes of it: a tree of bodies on slides and hinges.

What an engine makes of defaults, frames, units and shapes need not be guessed so.
"""

from __future__ import annotations

from dataclasses import dataclass

Numbers = tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class CompiledJoint:
    """A joint.

    Attributes:
        name: as in the file; empty for none.
        kind: "hinge", "slide", or what else the engine calls it.
        at, axis: in the body's frame, metres and a unit vector.
        zero: its value where the file draws the mechanism.
        rest: where its spring is relaxed.
        stiffness, damping: coefficients of force, (first, second, ...) power.
        armature: inertia added to its own motion.
        friction: dry friction.
        limits: lower and upper, where it has them.
    """

    name: str
    kind: str
    at: Numbers
    axis: Numbers
    zero: float
    rest: float
    stiffness: Numbers
    damping: Numbers
    armature: float
    friction: float
    limits: tuple[float, float] | None


@dataclass(frozen=True, kw_only=True)
class CompiledBody:
    """A body.

    Attributes:
        name: as in the file; empty for none.
        parent: index of its parent, counted from 1; 0 for the ground.
        at, turn: its frame in its parent's, metres and a unit quaternion (w, x, y, z).
        mass, centre: kg, metres in its frame.
        principal: the frame of its principal moments, a quaternion in its own.
        moments: principal moments, kg*m^2.
        joints: between its parent and it.
        ordinary: whether it is moved by forces alone, and weighs what it weighs.
    """

    name: str
    parent: int
    at: Numbers
    turn: Numbers
    mass: float
    centre: Numbers
    principal: Numbers
    moments: Numbers
    joints: tuple[CompiledJoint, ...]
    ordinary: bool


@dataclass(frozen=True, kw_only=True)
class CompiledTree:
    """All bodies but the ground, parents first, in the order of the file.

    Attributes:
        gravity: m/s^2.
        medium: whether wind, density or viscosity act on the bodies.
        name: of the model; empty for none.
        besides: what else the file has that the settings `smooth` and `couplings` leave out, each
            with its number.
        uncovered: what else acts on the bodies.
    """

    bodies: tuple[CompiledBody, ...]
    gravity: tuple[float, float, float]
    medium: bool
    name: str = ""
    besides: tuple[tuple[str, int], ...] = ()
    uncovered: tuple[str, ...] = ()
