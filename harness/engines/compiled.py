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
        zero: its value where the file draws the mechanism; of a ball or free joint, 0.
        rest: where its spring is relaxed, likewise.
        stiffness, damping: coefficients of force, (first, second, ...) power.
        armature: inertia added to its own motion.
        friction: dry friction.
        limits: lower and upper, where it has them.
        rest_place, rest_turn: where the spring of a ball or free joint is relaxed: metres, and a
            quaternion.
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
    rest_place: Numbers = (0.0, 0.0, 0.0)
    rest_turn: Numbers = (1.0, 0.0, 0.0, 0.0)


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
        lift: share of its weight that is taken from it.
        ordinary: whether it is moved by forces alone, and weighs what it weighs.
        dragged: whether a medium acts on it as on a box.
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
    lift: float = 0.0
    dragged: bool = True


@dataclass(frozen=True, kw_only=True)
class CompiledMark:
    """A frame on a body.

    Attributes:
        body: its index, counted from 1; 0 for the ground.
        at, turn: metres and a unit quaternion, in the body's frame.
    """

    body: int
    at: Numbers
    turn: Numbers


@dataclass(frozen=True, kw_only=True)
class CompiledWay:
    """A length that is no combination of hinges and slides: of one of these kinds.

    Attributes:
        branches: a cord of straight lines: shares, each with the frames that lines join.
        frame: on which `gear` is a force and a moment, along its axes, or those of `against`, which
            feels the opposite.
        against: the other frame, where there is one.
        joint: a ball or free one, by its index, on which `gear` is a moment, or a force and a
            moment; -1 for none.
        gear: force and moment by F.
        in_parent: whether moments on a joint are along the axes of what carries it.
    """

    branches: tuple[tuple[float, tuple[CompiledMark, ...]], ...] = ()
    frame: CompiledMark | None = None
    against: CompiledMark | None = None
    joint: int = -1
    gear: Numbers = ()
    in_parent: bool = False


@dataclass(frozen=True, kw_only=True)
class CompiledPull:
    """A force along a length s: of hinges' and slides' positions, or of another way.

    F = b0 + b1 s + b2 w + (g0 + g1 s + g2 w) u - sum of k_i x^i - sum of d_i w |w|^(i - 1), where
    w = ds/dt and x is by how much s is outside `rest`; on each joint acts F times its coefficient.

    Attributes:
        name: of the tendon or actuator.
        joints: coefficients by the index of the joint among all, in the bodies' order.
        along: the other way.
        bias, gain: (b0, b1, b2) and (g0, g1, g2).
        control: index of its input u, or of the state that it holds; -1 for none.
        range: of its input, where it has one.
        stiffness, damping: (k_1, k_2, ...), (d_1, d_2, ...).
        rest: between which lengths springs pull nothing.
        armature: mass that moves as s does.
    """

    name: str
    joints: tuple[tuple[int, float], ...] = ()
    along: CompiledWay | None = None
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gain: tuple[float, float, float] = (0.0, 0.0, 0.0)
    control: int = -1
    range: tuple[float, float] | None = None
    stiffness: Numbers = ()
    damping: Numbers = ()
    rest: tuple[float, float] = (0.0, 0.0)
    armature: float = 0.0


@dataclass(frozen=True, kw_only=True)
class CompiledActuator:
    """An actuator.

    Attributes:
        name: as in the file; empty for none.
        on: the joint, or what else it acts on.
        kind: what it acts on, what its force depends on, by which law, and its dynamics.
        numbers: by what they are, those on which its force depends: its gear, gain and bias, the
            constants of its dynamics, and its own damper and armature.
        ranges: those of its control, its state and its force, where it has them; and what else
            acts as its control changes, as a delay.
        covered: whether its force has a formula, so that it acts in smooth motions.
        control: index of its first input.
        states: indices of its own states.
    """

    name: str
    on: str
    kind: tuple[str, ...]
    numbers: tuple[tuple[str, Numbers], ...]
    ranges: tuple[tuple[str, Numbers], ...]
    covered: bool
    control: int
    states: tuple[int, ...]


@dataclass(frozen=True, kw_only=True)
class CompiledCoupling:
    """A hinge or slide whose position is multiplier * that of another + offset.

    Attributes:
        follower, leader: indices of the joints among all; no leader where it stands at the offset.
        multiplier, offset: in the units of both.
        others: further joints that it follows, each with its multiplier.
    """

    follower: int
    leader: int | None
    multiplier: float
    offset: float
    others: tuple[tuple[int, float], ...] = ()


@dataclass(frozen=True, kw_only=True)
class CompiledMedium:
    """A fluid in which the bodies move, each as the box of its mass and moments.

    Attributes:
        density, viscosity: kg/m^3, Pa s.
        wind: m/s.
    """

    density: float
    viscosity: float
    wind: tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class CompiledTree:
    """All bodies but the ground, parents first, in the order of the file.

    Attributes:
        gravity: m/s^2.
        pulls: tendons and actuators.
        couplings: joints that follow others.
        controls: how many inputs the actuators have.
        medium: in which the bodies move; None for none.
        name: of the model; empty for none.
        besides: what else the file has that the settings `smooth` and `couplings` leave out, each
            with its number.
        uncovered: what else acts on the bodies.
        actuators: in the order of the file.
        states: how many states the actuators have.
        shapes: files of meshes and the like without which the bodies can't be had, by the names
            that the file has for them.
        taken: what the engine does with pulls on its own: a cause, and the pulls as it takes them.
    """

    bodies: tuple[CompiledBody, ...]
    gravity: tuple[float, float, float]
    medium: CompiledMedium | None
    pulls: tuple[CompiledPull, ...] = ()
    couplings: tuple[CompiledCoupling, ...] = ()
    controls: int = 0
    name: str = ""
    besides: tuple[tuple[str, int], ...] = ()
    uncovered: tuple[str, ...] = ()
    actuators: tuple[CompiledActuator, ...] = ()
    states: int = 0
    shapes: tuple[str, ...] = ()
    taken: tuple[tuple[str, tuple[CompiledPull, ...]], ...] = ()
