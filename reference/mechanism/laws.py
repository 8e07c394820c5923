"""Numbers of the forces that are not smooth: limits, dry friction, equalities, contacts, drives.

`reference.laws` states how they act. Joints, bodies and paths are indices: joints in the order of
the tree's links, bodies as a file lists them from 1 (0 is the ground), paths as force elements of a
tree without coefficients.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Numbers = tuple[float, ...]
Range = tuple[float, float]

Dynamics = Literal["none", "integrator", "filter", "exact filter", "muscle"]
"""How the state of a drive follows its control."""

Curve = Literal["none", "fixed", "affine", "muscle"]
"""How the gain or the bias of a drive depends on its length and velocity."""


Mixing = Literal["largest", "product", "mean", "harmonic", "smallest"]
"""How the frictions of two surfaces give that of their contact."""


@dataclass(frozen=True, kw_only=True)
class Softness:
    """How a constraint gives way (MuJoCo's documentation, Computation, Parameters).

    Attributes:
        reference: time constant (s) and damping ratio; or minus stiffness (1/s^2) and minus damping
            (1/s) of the acceleration.
        impedance: at zero depth, at full depth, that depth (m or rad), midpoint, power.
    """

    reference: Range
    impedance: Numbers


@dataclass(frozen=True, kw_only=True)
class SoftLaw:
    """A documented law of soft rows, in place of a rigid contact or of dry friction.

    While a row acts, its acceleration is (1 - d) a0 + d aref, where a0 is the one without the row,
    and aref = -b v - k d r. Source: `reference.laws.soft`.

    Attributes:
        softness: k, b and d.
        friction_ratio: of the softness of normal forces to that of friction.
        points: number of equal points that share the contact.
        weight: inverse inertia that scales the softness, relative to that along the row.
    """

    softness: Softness
    friction_ratio: float = 1.0
    points: int = 1
    weight: float = 1.0


@dataclass(frozen=True, kw_only=True)
class Anchor:
    """A frame on a body.

    Attributes:
        body: its index.
        position, turn: m and a unit quaternion (w, x, y, z), in the body's frame.
    """

    body: int
    position: Numbers
    turn: Numbers = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class SoftLimit:
    """A range of a joint or of a path; a ball joint's angle stays below `upper`.

    Attributes:
        joint, path: index of the one that it limits; -1 for the other.
        lower, upper, margin: m or rad.
    """

    joint: int = -1
    path: int = -1
    lower: float
    upper: float
    margin: float
    softness: Softness


@dataclass(frozen=True, kw_only=True)
class SoftFriction:
    """Dry friction of each velocity of a joint, or of a path, up to `force` (N or N m)."""

    joint: int = -1
    path: int = -1
    force: float
    softness: Softness


@dataclass(frozen=True, kw_only=True)
class SoftEquality:
    """An equality.

    Attributes:
        joints, paths: one or two of a kind: the first one's displacement equals `polynomial` of the
            second one's.
        polynomial: coefficients, constant first.
        starts: positions or lengths from which displacements count, one each.
        anchors: two frames whose origins coincide.
        turn_scale: m/rad, converts the rotation between the anchors to a distance; None if they
            can rotate.
    """

    joints: tuple[int, ...] = ()
    paths: tuple[int, ...] = ()
    polynomial: Numbers = ()
    starts: Numbers = ()
    anchors: tuple[Anchor, Anchor] | None = None
    turn_scale: float | None = None
    softness: Softness


@dataclass(frozen=True, kw_only=True)
class Surface:
    """A shape's surface.

    Attributes:
        body: index of its body.
        dimension: of its contact force: 1, 3, 4 or 6.
        friction: sliding, torsional (m), rolling (m); or of five directions, as of a contact.
        priority: a larger one determines the contact.
        mix: weight of its softness.
        margin: distance at which contact begins, m.
        masks: two surfaces touch if a bit of the first mask of one is in the second one of the
            other.
    """

    body: int
    dimension: int
    friction: Numbers
    priority: int
    mix: float
    margin: float
    softness: Softness
    masks: tuple[int, int] = (1, 1)

    def touches(self, other: Surface) -> bool:
        """Return whether two surfaces touch by their masks."""
        return bool(self.masks[0] & other.masks[1] or other.masks[0] & self.masks[1])

    @property
    def frictions(self) -> Numbers:
        """Friction of five directions, as in `ContactParameters`."""
        sliding, *others = self.friction
        if len(others) > 2:
            return self.friction
        return (sliding, sliding, others[0], others[1], others[1])


@dataclass(frozen=True, kw_only=True)
class CompliantSurface:
    """A surface whose normal force is k x (1 + d dx/dt) at a depth x (Hunt and Crossley).

    Attributes:
        friction: sliding.
        stiffness: k, N/m.
        dissipation: d, s/m.
    """

    friction: float
    stiffness: float
    dissipation: float


@dataclass(frozen=True, kw_only=True)
class ContactParameters:
    """Parameters of the contact of two surfaces.

    Attributes:
        friction: of five directions: two sliding, torsional, two rolling.
        sliding: as `Softness.reference`, of the friction of elliptic cones; zeros for the same.
        other attributes: as in `Surface`.
    """

    dimension: int
    friction: Numbers
    margin: float
    softness: Softness
    sliding: Range = (0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Actuator:
    """An actuator on a path.

    Attributes:
        control: index of its input.
        state: index of its state; -1 without one.
        control_range, state_range, force_range: limits, or None.
        dynamics, constants: how its state follows the control.
        gain, gains: factor of the control or state.
        bias, biases: force at zero control.
        early: whether the force uses the state at the step's end.
        stretch: range of lengths of a muscle.
        period: of a control that is an angle; 0 for no period.
        on: whether it acts.
    """

    path: int
    control: int
    state: int = -1
    control_range: Range | None = None
    state_range: Range | None = None
    force_range: Range | None = None
    dynamics: Dynamics = "none"
    constants: Numbers = ()
    gain: Curve = "fixed"
    gains: Numbers = (1.0,)
    bias: Curve = "none"
    biases: Numbers = ()
    early: bool = False
    stretch: Range = (0.0, 0.0)
    period: float = 0.0
    on: bool = True


@dataclass(frozen=True, kw_only=True)
class Laws:
    """All laws of a file.

    Attributes:
        step: s.
        integrator: "euler", "implicitfast", "implicit", or "implicit dampers": those of joints,
            paths and drives, also of drives at a limit; another one has no rule for the next state.
        dampers: (first, second, ...) powers of drives' and joints' own dampers, by joint, without
            `TreeLink.damping`; the Euler step evaluates them at its end.
        elliptic: whether friction cones are elliptic, or pyramids.
        mixing: of the frictions of two surfaces.
        friction_ratio: of the softness of normal forces to that of friction.
        least_friction: smallest friction coefficient.
        drift: whether equalities of frames count their acceleration at constant velocities.
        sliding_drift: whether ball joints then move with the slides after them in their body.
        safe: whether a time constant is at least two steps.
        damps_implicitly: whether the Euler step evaluates joint dampers at its end.
        light: bodies whose inverse weight is one over their mass: alone on slides along the axes.
        sums: drives, by index, whose forces together have limits.
        joint_ranges: limits of all drives by joint, and whether they compensate its weight.
        compliant: of the ground and of each shape, in place of `surfaces`, for near-rigid laws.
        pairs: numbers of pairs of surfaces that a file states itself, by their indices.
        touching: pairs of surfaces, in order, whose masks, bodies and exclusions allow contacts.
        uncovered: what acts on the bodies and has no law here.
    """

    step: float
    integrator: str
    elliptic: bool = False
    mixing: Mixing = "largest"
    friction_ratio: float = 1.0
    least_friction: float = 1e-5
    drift: bool = True
    sliding_drift: bool = False
    safe: bool = True
    damps_implicitly: bool = True
    dampers: Mapping[int, Numbers] = field(default_factory=dict)
    limits: tuple[SoftLimit, ...] = ()
    frictions: tuple[SoftFriction, ...] = ()
    equalities: tuple[SoftEquality, ...] = ()
    surfaces: tuple[Surface, ...] = ()
    compliant: tuple[CompliantSurface, ...] = ()
    pairs: tuple[tuple[int, int, ContactParameters], ...] = ()
    touching: frozenset[tuple[int, int]] = frozenset()
    drives: tuple[Actuator, ...] = ()
    sums: tuple[tuple[tuple[int, ...], Range], ...] = ()
    joint_ranges: Mapping[int, tuple[Range, bool]] = field(default_factory=dict)
    light: frozenset[int] = frozenset()
    uncovered: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactPoint:
    """A contact that a collision detector reports.

    Attributes:
        surfaces: indices of the two surfaces.
        distance: m, negative when they overlap.
        position: in the world, m, (3,).
        frame: axes as rows: the normal from the first surface to the second one, two tangents,
            (3, 3).
    """

    surfaces: tuple[int, int]
    distance: float
    position: NDArray[np.float64]
    frame: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class HardSurface:
    """A surface whose contacts are impulses.

    Attributes:
        friction: sliding.
        restitution: share of the approach speed that a contact returns.
        spring: stiffness (N/m) and damping (N s/m) of a soft contact; None if it is rigid.
        anchored: whether friction also removes the drift between the two points of a contact.
    """

    friction: float
    restitution: float = 0.0
    spring: Range | None = None
    anchored: bool = False


@dataclass(frozen=True, kw_only=True)
class HardJoint:
    """The range and the motor of a hinge or slide.

    Attributes:
        joint: its index.
        control: index of the motor's target.
        lower, upper: m or rad; without a limit, the lower bound is above the upper one.
        targets: range of the motor's target, likewise.
        effort: largest force of its motor, N or N m; 0 for no motor.
    """

    joint: int
    control: int
    lower: float
    upper: float
    targets: Range
    effort: float


@dataclass(frozen=True, kw_only=True)
class NearRigidRules:
    """Settings of an engine whose constraints are near-rigid (`reference.laws.near_rigid`).

    Attributes:
        step: s.
        damped_mass: whether constraint forces act on M + h D, with joint dampers D, or on M.
        has_limits: whether joint limits act.
        dry_friction_share: softness of dry friction, as a share of its inverse inertia; 0 if it
            does not act.
        share: smallest softness of a row, as a share of its inverse inertia.
        stiffness: of a limit, N/m or N m/rad.
        dissipation: time in which a limit dissipates, s.
        window: rows exist within this multiple of the motion in a step.
        slip: smallest softness of a contact's friction, as a share of the inverse inertia.
        slowest: slip velocity at which friction is at 0.7 of its largest value, m/s.
        default: the ground, and a surface that the file does not describe.
        surface_tags: of the element that states a surface, and of its numbers: friction if the next
            is missing, friction, stiffness, dissipation.
        shapes: link, and index among its collision elements, of each shape that can touch.
        filters: whether the file filters contacts of its links by groups.
    """

    step: float
    damped_mass: bool = True
    has_limits: bool = True
    dry_friction_share: float = 0.0
    share: float = 0.0
    stiffness: float = np.inf
    dissipation: float = 0.0
    window: float = 0.0
    slip: float = 0.0
    slowest: float = 1.0
    default: CompliantSurface = CompliantSurface(friction=0.0, stiffness=0.0, dissipation=0.0)
    surface_tags: tuple[str, str, str, str, str] = ("", "", "", "", "")
    shapes: tuple[tuple[str, int], ...] = ()
    filters: bool = False


@dataclass(frozen=True, kw_only=True)
class SoftRules:
    """Settings of an engine whose constraints are soft (`reference.laws.soft`), for a URDF.

    Attributes:
        laws: all but limits and dry friction, which the file states.
        softness: of these.
        bodies: names of the links that bodies begin with, by index; the ground first.
        shapes: names of the shapes, by the index of their surface.
    """

    laws: Laws
    softness: Softness
    bodies: tuple[str, ...]
    shapes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class ImpulseRules:
    """Settings of an engine whose constraints are impulses, and what its files leave open.

    Attributes:
        step: s.
        limit_recovery, contact_recovery, friction_recovery: share of a violation that a step
            removes, of limits, of contacts and of anchored friction.
        deepest: depth beyond which a limit is not pushed back, m or rad.
        largest: largest impulse of a limit, N s or N m s.
        slop: added to the distance of a contact, m.
        bounce: approach speed below which nothing bounces, m/s.
        gain: share of its position error that a motor removes in a step.
        drag: damping of links that the engine adds by default, 1/s; 0 in all comparisons.
        mixing: of the frictions of two surfaces.
        default: a surface that the file does not describe.
        floor: the surface of the ground.
        controls: names of the joints whose motors have a control, by index.
        bodies: names of the bodies that contacts refer to, by index; the ground first.
    """

    step: float
    limit_recovery: float
    contact_recovery: float
    friction_recovery: float
    deepest: float
    largest: float
    slop: float
    bounce: float
    gain: float
    drag: float
    default: HardSurface
    floor: HardSurface
    controls: tuple[str, ...]
    bodies: tuple[str, ...]
    mixing: Mixing = "product"


Rules = ImpulseRules | NearRigidRules | SoftRules
"""Settings of an engine, for the laws of a URDF."""


@dataclass(frozen=True, kw_only=True)
class ImpulseLaws:
    """Limits, motors and contacts that act by impulses.

    Attributes:
        rules: settings of the engine.
        joints: ranges and motors.
        surfaces: of the bodies, as in `ImpulseRules.bodies`.
        root: center of mass of a floating root that is stepped about it, in its frame, m; or None.
    """

    rules: ImpulseRules
    joints: tuple[HardJoint, ...]
    surfaces: tuple[HardSurface, ...]
    root: Numbers | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class ImpulseContact(ContactPoint):
    """A contact with the impulse that the engine reports; `position` is on the first surface.

    Attributes:
        other: the point on the other surface, m, (3,).
        impulse: on the other surface, along the axes of `frame`, N s, (3,).
    """

    other: NDArray[np.float64]
    impulse: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Substeps:
    """Substeps of a step, in which held forces and then the drives of joints act, one by one.

    Velocity terms act once before them. The mass matrix and the responses of joints are those of
    the step's start. A drive is implicit in the velocity of its own joint.

    Attributes:
        count: of the substeps.
        repeats: sweeps after them, which correct passive damping only.
        order: of the joints, by index of the coordinate.
        stiffness, damping: of the drives, (n,), N/m and N s/m, or N m/rad and N m s/rad.
        target, speed: positions and rates that the drives want at the end of the step, (n,).
        effort: largest force of a drive with the input of its joint, (n,).
        passive: explicit damping of the joints, no larger than what stops them, (n,).
    """

    count: int
    repeats: int
    order: tuple[int, ...]
    stiffness: NDArray[np.float64]
    damping: NDArray[np.float64]
    target: NDArray[np.float64]
    speed: NDArray[np.float64]
    effort: NDArray[np.float64]
    passive: NDArray[np.float64]

    def reordered(self, rows: tuple[int, ...]) -> Substeps:
        """Return the same with coordinate `rows[i]` as the i-th."""
        names = ("stiffness", "damping", "target", "speed", "effort", "passive")
        arrays = {name: getattr(self, name)[list(rows)] for name in names}
        return replace(self, order=tuple(map(rows.index, self.order)), **arrays)
