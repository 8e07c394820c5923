"""A model file as the numbers that an engine compiles it to: a tree of bodies on slides and hinges.

This shows how an engine reads defaults, frames, units and shapes.
"""

from __future__ import annotations

from dataclasses import dataclass

from physics_crosscheck.reference.mechanism.laws import Laws

Numbers = tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class CompiledJoint:
    """A joint.

    Attributes:
        name: as in the file; empty if it has no name.
        kind: "hinge", "slide", or the engine's own word.
        position, axis: position (m) and unit vector in the body's frame.
        zero: its position in the file's drawn configuration; 0 for a ball or free joint.
        rest: the position at which its spring is relaxed, likewise.
        stiffness, damping: coefficients of force, (first, second, ...) power.
        armature: inertia added to its own motion.
        friction: dry friction.
        limits: lower and upper, or None.
        rest_place, rest_turn: position (m) and quaternion at which the spring of a ball or free
            joint is relaxed.
    """

    name: str
    kind: str
    position: Numbers
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
        name: as in the file; empty if it has no name.
        parent: index of its parent, counted from 1; 0 for the ground.
        position, turn: its frame in its parent's: metres and a unit quaternion (w, x, y, z).
        mass, centre: kg, and metres in its frame.
        principal: orientation of its principal axes, a quaternion in its frame.
        moments: principal moments of inertia, kg*m^2.
        joints: between its parent and it.
        lift: the share of its weight that gravity compensation cancels.
        ordinary: whether only forces move it and its weight is mass times gravity.
        dragged: whether a fluid acts on it as on a box.
    """

    name: str
    parent: int
    position: Numbers
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
class CompiledFrame:
    """A frame on a body.

    Attributes:
        body: its index, counted from 1; 0 for the ground.
        position, turn: metres and a unit quaternion, in the body's frame.
    """

    body: int
    position: Numbers
    turn: Numbers


@dataclass(frozen=True, kw_only=True)
class CompiledShape:
    """A shape or a site.

    Attributes:
        name: its place, as in `Model.shapes`.
        frame: its frame, as the file states it.
        size: the numbers that give its extent, m; empty for a mesh.
        kind: its form.
        visual: whether it touches nothing.
        mesh: path of the mesh's file as the engine resolves it; empty without one.
        scale: factors of the mesh's coordinates.
    """

    name: str
    frame: CompiledFrame
    size: Numbers
    kind: str
    visual: bool = False
    mesh: str = ""
    scale: Numbers = (1.0, 1.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class CompiledLength:
    """A length that is not a linear combination of hinge and slide positions, of one of these
    kinds.

    Attributes:
        branches: a cable of straight segments: shares, each with the frames that the segments join.
        frame: the frame on which `gear` is a force and a moment, along its own axes or those of
            `against`, which receives the opposite.
        against: the other frame, or None.
        joint: index of a ball or free joint on which `gear` is a moment, or a force and a moment;
            -1 without one.
        gear: force and moment per unit of F.
        in_parent: whether moments on a joint are along the axes of its parent body.
    """

    branches: tuple[tuple[float, tuple[CompiledFrame, ...]], ...] = ()
    frame: CompiledFrame | None = None
    against: CompiledFrame | None = None
    joint: int = -1
    gear: Numbers = ()
    in_parent: bool = False


@dataclass(frozen=True, kw_only=True)
class CompiledForce:
    """A force along a length s, which is a combination of hinge and slide positions or another
    length.

    F = b0 + b1 s + b2 w + (g0 + g1 s + g2 w) u - sum of k_i x^i - sum of d_i w |w|^(i - 1), where w
    = ds/dt and x is the distance of s outside `rest`. Each joint receives F times its coefficient.

    Attributes:
        name: of the tendon or actuator.
        joints: coefficients by the index of the joint among all, in the bodies' order.
        along: the other length, or None.
        bias, gain: (b0, b1, b2) and (g0, g1, g2).
        control: index of its input u, or of the state that replaces it; -1 without one.
        range: of its input, or None.
        stiffness, damping: (k_1, k_2, ...), (d_1, d_2, ...).
        rest: the range of lengths in which springs exert no force.
        armature: mass that moves as s does.
    """

    name: str
    joints: tuple[tuple[int, float], ...] = ()
    along: CompiledLength | None = None
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
        name: as in the file; empty if it has no name.
        on: name of the joint or other element that it acts on.
        kind: kind of that element, dependence of its force, law and dynamics.
        numbers: named numbers that its force depends on: gear, gain, bias, constants of its
            dynamics, and its own damper and armature.
        ranges: ranges of its control, state and force, and further features such as a delay.
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
    """A hinge or slide whose position is multiplier * leader + offset.

    Attributes:
        follower, leader: indices of the joints among all; without a leader the position is the
            offset.
        multiplier, offset: in the units of both.
        others: further leaders, each with its multiplier.
    """

    follower: int
    leader: int | None
    multiplier: float
    offset: float
    others: tuple[tuple[int, float], ...] = ()


@dataclass(frozen=True, kw_only=True)
class CompiledFluid:
    """A fluid in which the bodies move, each as the box of its mass and moments of inertia.

    Attributes:
        density, viscosity: kg/m^3, Pa s.
        wind: m/s.
    """

    density: float
    viscosity: float
    wind: tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class CompiledTree:
    """All bodies except the ground, parents first, in the order of the file.

    Attributes:
        gravity: m/s^2.
        pulls: tendons and actuators.
        couplings: joints that follow others.
        controls: number of actuator inputs.
        fluid: the fluid around the bodies, or None.
        name: of the model; empty if it has no name.
        besides: elements that the settings `smooth` and `couplings` leave out, each with its count.
        uncovered: other effects on the bodies that have no formula.
        actuators: in the order of the file.
        states: number of actuator states.
        shapes: file names, as in the model, of meshes that the inertias depend on.
        engine_variants: where the engine's force law differs from the file: a cause, and the forces
            that the engine computes.
        laws: numbers of limits, friction, equalities, contacts and drives; None if unknown.
        paths: force elements without coefficients, along which these act.
        placed: shapes and sites.
        options: settings of the whole file, in words, by attribute.
        excluded: pairs of bodies whose shapes do not touch, by index.
        others: effects in no other field: subject, attribute and value, in words.
    """

    bodies: tuple[CompiledBody, ...]
    gravity: tuple[float, float, float]
    fluid: CompiledFluid | None
    pulls: tuple[CompiledForce, ...] = ()
    couplings: tuple[CompiledCoupling, ...] = ()
    controls: int = 0
    name: str = ""
    besides: tuple[tuple[str, int], ...] = ()
    uncovered: tuple[str, ...] = ()
    actuators: tuple[CompiledActuator, ...] = ()
    states: int = 0
    shapes: tuple[str, ...] = ()
    engine_variants: tuple[tuple[str, tuple[CompiledForce, ...]], ...] = ()
    laws: Laws | None = None
    paths: tuple[CompiledForce, ...] = ()
    placed: tuple[CompiledShape, ...] = ()
    options: tuple[tuple[str, str], ...] = ()
    excluded: tuple[tuple[int, int], ...] = ()
    others: tuple[tuple[str, str, str], ...] = ()
