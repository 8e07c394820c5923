"""Drives: control, state, force and force limits of actuators.

Sources: MuJoCo's documentation, Computation, Actuation model; muscles: Modeling, Muscles, and
Millard et al. 2013, J. Biomech. Eng. 135(2), for the time constants.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from physics_crosscheck.reference.mechanism.laws import Actuator, Curve, Laws, Numbers, Range
from physics_crosscheck.reference.mechanism.numeric import Array
from .mechanics import Posture
from .soft import SMALLEST, Part


@dataclass(frozen=True, kw_only=True, eq=False)
class Driven:
    """Drives at one state.

    Attributes:
        forces: of each drive, (drives,).
        joint_forces: on the velocities, (nv,).
        states: at the step's end, (states,).
        clipped: drives at a limit of their own or of a tendon, by index.
        damping: -d(joint forces)/d(velocities), (nv, nv); drives at a limit have none, unless the
            integrator keeps it.
    """

    forces: Array
    joint_forces: Array
    states: Array
    clipped: frozenset[int]
    damping: Array


def drive(
    laws: Laws,
    posture: Posture,
    accelerations: Array,
    controls: Array,
    states: Array,
) -> Driven:
    """Return the forces of all drives.

    Args:
        laws: the file's numbers.
        posture: the state.
        accelerations: norm of the acceleration per unit force of each path in the drawn
            configuration, (P,), which scales muscles.
        controls, states: inputs and states of all drives.
    """
    count, nv = len(laws.drives), len(posture.m)
    forces, slopes = np.zeros(count), np.zeros(count)
    after = states.copy()
    rows = np.array([posture.rows[actuator.path] for actuator in laws.drives]).reshape(count, nv)
    for i, actuator in enumerate(laws.drives):
        law = _Drive(actuator, posture, accelerations[actuator.path])
        given = controls[actuator.control]
        value = control = _clipped(given, actuator.control_range)
        if actuator.state >= 0:
            given = states[actuator.state]
            rate = law.rate(control, given) if actuator.on else 0.0
            after[actuator.state] = law.next_state(given, rate, laws.step)
            value = after[actuator.state] if actuator.early else given
        if actuator.on:
            value = law.period(value)
            forces[i] = law.force(value)
            slopes[i] = law.linear_slope(given) if _keeps_damping(laws) else law.slope(value)
    forces, clipped = _within_limits(laws, forces)
    joint_forces, limited = _within_joints(laws, posture, rows.T @ forces)
    if not _keeps_damping(laws):
        slopes[list(_limited_drives(laws, posture, clipped, limited))] = 0.0
    return Driven(
        forces=forces,
        joint_forces=joint_forces,
        states=after,
        clipped=frozenset(clipped),
        damping=-np.einsum("di,d,dj->ij", rows, slopes, rows),
    )


def _keeps_damping(laws: Laws) -> bool:
    """Return whether drives at a limit keep their damping, as their control is given."""
    return laws.integrator == "implicit dampers"


def clamps(laws: Laws, posture: Posture, driven: Driven, controls: Array) -> Iterator[Part]:
    """Yield the ends of ranges that limit controls, drives and joints, where they act."""
    for i, actuator in enumerate(laws.drives):
        if not actuator.on:
            continue
        if way := _end(float(driven.forces[i]), actuator.force_range):
            yield Part("force", i, way)
        way = _end(float(controls[actuator.control]), actuator.control_range)
        if way and (actuator.state >= 0 or i not in driven.clipped):
            yield Part("control", i, way)
        held = actuator.state >= 0 and _end(driven.states[actuator.state], actuator.state_range)
        if held:
            yield Part("state", i, held)
    for joint, (limits, lifted) in laws.joint_ranges.items():
        there = posture.parent.tree.velocities[joint]
        whole = driven.joint_forces[there] + (posture.lift[there] if lifted else 0.0)
        yield from {Part("joint force", joint, way) for x in whole if (way := _end(x, limits))}
    for i, (members, limits) in enumerate(laws.sums):
        if way := _end(float(driven.forces[list(members)].sum()), limits):
            yield Part("tendon force", i, way)


def _end(value: float, limits: Range | None) -> int:
    """Return the end of a range that a value is at or beyond, -1 or 1; 0 between them."""
    if limits is None:
        return 0
    slack = SMALLEST * max(map(abs, limits))
    return int(value >= limits[1] - slack) - int(value <= limits[0] + slack)


def _limited_drives(
    laws: Laws, posture: Posture, clipped: set[int], limited: set[int]
) -> Iterator[int]:
    """Yield the drives at a limit of their own, of their path or of their only joint."""
    for i, actuator in enumerate(laws.drives):
        joints = [joint for joint, _ in posture.parent.paths[actuator.path].joints]
        if i in clipped or (len(joints) == 1 and joints[0] in limited):
            yield i


def unsaturated(
    laws: Laws, posture: Posture, accelerations: Array, shares: Array
) -> tuple[Array, Array]:
    """Return controls and states at which no drive is at a limit; NaN for others.

    Args:
        laws, posture, accelerations: as in `drive`.
        shares: of each drive's range of forces or controls, from -1 to 1, (drives,).
    """

    def force(i: int) -> float:
        least, largest = _force_range(laws, posture, i)
        return float((least + largest) / 2 + shares[i] * (largest - least) / 2)

    return _inputs(laws, posture, accelerations, shares, force)


def holding(laws: Laws, posture: Posture, accelerations: Array) -> tuple[Array, Array]:
    """Return controls and states at which drives balance the other forces along their paths."""

    def force(i: int) -> float:
        row = posture.rows[laws.drives[i].path]
        size = float(row @ row)
        return -float(row @ posture.smooth) / size if size else float("nan")

    return _inputs(laws, posture, accelerations, np.zeros(len(laws.drives)), force)


def eased(
    laws: Laws, posture: Posture, accelerations: Array, controls: Array, states: Array
) -> tuple[Array, Array]:
    """Return changes of coordinates and velocities, (nv,), that move drives off their force limits.

    Each drive on one joint gets another position, each other one another velocity.
    """
    moved, sped = np.zeros_like(posture.m), np.zeros_like(posture.m)
    for i, actuator in enumerate(laws.drives):
        law, row = (
            _Drive(actuator, posture, accelerations[actuator.path]),
            posture.rows[actuator.path],
        )
        value = _clipped(controls[actuator.control], actuator.control_range)
        value = value if actuator.state < 0 else float(states[actuator.state])
        lacks = sum(_force_range(laws, posture, i)) / 2 - law.force(value)
        if not np.isfinite(lacks) or actuator.bias != "affine":
            continue
        single = len(posture.parent.paths[actuator.path].joints) == 1
        for change, slope in ((moved, actuator.biases[1] if single else 0.0),
                              (sped, actuator.biases[2])):  # fmt: skip
            if slope and row.any():
                change += row * lacks / (slope * float(row @ row))
                break
    return moved, sped


def _inputs(
    laws: Laws,
    posture: Posture,
    accelerations: Array,
    shares: Array,
    wanted: Callable[[int], float],
) -> tuple[Array, Array]:
    """Return controls and states at which drives exert wanted forces; NaN for others.

    Where these are not finite, drives get shares of their ranges of controls or states.
    """
    controls = np.full(max((actuator.control for actuator in laws.drives), default=-1) + 1, np.nan)
    states = np.full(max((actuator.state for actuator in laws.drives), default=-1) + 1, np.nan)
    for i, actuator in enumerate(laws.drives):
        law = _Drive(actuator, posture, accelerations[actuator.path])
        still, unit = law.force(0.0), law.force(1.0)
        limits = actuator.control_range if actuator.state < 0 else actuator.state_range
        # A muscle that exerts nearly no force would need any activation.
        limits = (0.0, 1.0) if actuator.gain == "muscle" and limits is None else limits
        low, high = limits or (-1.0, 1.0)
        value = (low + high) / 2 + shares[i] * (high - low) / 2
        force = wanted(i)
        if np.isfinite(force) and unit != still:
            value = _clipped((force - still) / (unit - still), limits)
        if actuator.state < 0:
            controls[actuator.control] = value
        else:
            states[actuator.state] = value
    return controls, states


def _force_range(laws: Laws, posture: Posture, index: int) -> Range:
    """Return forces of a drive that no limit reaches; all drives of its joint share the range."""
    actuator, tree = laws.drives[index], posture.parent.tree
    ranges = [] if actuator.force_range is None else [actuator.force_range]
    ranges += [_share(limits, len(on)) for on, limits in laws.sums if index in on]
    for joint, (limits, _) in laws.joint_ranges.items():
        rows = [posture.rows[other.path][tree.velocities[joint]] for other in laws.drives]
        drives = sum(bool(row.any()) for row in rows)
        ranges += [_share(limits, drives * gear) for gear in rows[index] if gear]
    lower, upper = zip(*ranges, strict=True) if ranges else ((-np.inf,), (np.inf,))
    return max(lower), min(upper)


def _share(limits: Range, parts: float) -> Range:
    """Return a range divided by a number of either sign."""
    low, high = sorted(limit / parts for limit in limits)
    return low, high


def _clipped(value: float, limits: Range | None) -> float:
    return value if limits is None else float(np.clip(value, *limits))


def _within_limits(laws: Laws, forces: Array) -> tuple[Array, set[int]]:
    """Limit the sums of drives, then each drive; return the forces, and the drives at a limit."""
    result, clipped = forces.copy(), set[int]()
    for drives, limits in laws.sums:
        which = list(drives)
        total = float(forces[which].sum())
        if total and not limits[0] < total < limits[1]:
            result[which] = forces[which] * (limits[int(total > 0)] / total)
            clipped |= set(which)
    for i, actuator in enumerate(laws.drives):
        if actuator.force_range is not None:
            result[i] = np.clip(result[i], *actuator.force_range)
            if not actuator.force_range[0] < result[i] < actuator.force_range[1]:
                clipped.add(i)
    return result, clipped


def _within_joints(laws: Laws, posture: Posture, forces: Array) -> tuple[Array, set[int]]:
    """Limit the joint forces of drives; return them, and the joints that are at a limit.

    A joint's drives may compensate its weight as well.
    """
    result, limited = forces.copy(), set[int]()
    for joint, (limits, lifted) in laws.joint_ranges.items():
        there = posture.parent.tree.velocities[joint]
        lift = posture.lift[there] if lifted else 0.0
        whole = forces[there] + lift
        result[there] = np.clip(whole, *limits) - lift
        if np.any((whole <= limits[0]) | (whole >= limits[1])):
            limited.add(joint)
    return result, limited


@dataclass(frozen=True, eq=False)
class _Drive:
    """A drive at one state; `acceleration` is that of its path per unit force."""

    drive: Actuator
    posture: Posture
    acceleration: float

    @property
    def length(self) -> float:
        return float(self.posture.lengths[self.drive.path])

    @property
    def velocity(self) -> float:
        return float(self.posture.rows[self.drive.path] @ self.posture.m)

    def period(self, value: float) -> float:
        """Return a control that is an angle as the equal one that is nearest to the length."""
        period = self.drive.period
        if not period:
            return value
        return value - period * float(np.round((value - self.length) / period))

    def rate(self, control: float, state: float) -> float:
        """Return the rate of the state."""
        match self.drive.dynamics:
            case "integrator":
                return control
            case "filter" | "exact filter":
                return (control - state) / max(SMALLEST, self.drive.constants[0])
            case "muscle":
                return _muscle_rate(control, state, self.drive.constants)
        return 0.0

    def next_state(self, state: float, rate: float, step: float) -> float:
        """Return the state after a step, within its range."""
        time = step
        if self.drive.dynamics == "exact filter":
            constant = max(SMALLEST, self.drive.constants[0])
            time = constant * (1 - float(np.exp(-step / constant)))
        return _clipped(state + rate * time, self.drive.state_range)

    def force(self, value: float) -> float:
        """Return the force before its limits."""
        gain = self._curve(self.drive.gain, self.drive.gains, active=True)
        return gain * value + self._curve(self.drive.bias, self.drive.biases, active=False)

    def slope(self, value: float) -> float:
        """Return the derivative of the force by the velocity."""
        slope = self.linear_slope(value)
        if self.drive.gain == "muscle":
            slope += value * self._muscle(self.drive.gains).force_slope(self.velocity)
        return slope

    def linear_slope(self, value: float) -> float:
        """Return the derivative by the velocity, without the curve of a muscle."""
        gain = self.drive.gains[2] if self.drive.gain == "affine" else 0.0
        bias = self.drive.biases[2] if self.drive.bias == "affine" else 0.0
        return gain * value + bias

    def _curve(self, curve: Curve, numbers: Numbers, *, active: bool) -> float:
        match curve:
            case "fixed":
                return numbers[0]
            case "affine":
                return numbers[0] + numbers[1] * self.length + numbers[2] * self.velocity
            case "muscle":
                muscle = self._muscle(numbers)
                return muscle.active(self.velocity) if active else muscle.passive
        return 0.0

    def _muscle(self, numbers: Numbers) -> _Muscle:
        return _Muscle(numbers, self.length, self.drive.stretch, self.acceleration)


@dataclass(frozen=True)
class _Muscle:
    """A muscle at one length.

    `numbers` are its range (2), force, scale, lmin, lmax, vmax, fpmax and fvmax.
    """

    numbers: Numbers
    length: float
    stretch: Range
    acceleration: float

    @property
    def peak(self) -> float:
        """Largest active force at rest; a negative number scales with the acceleration."""
        force, scale = self.numbers[2:4]
        return scale / max(SMALLEST, self.acceleration) if force < 0 else force

    @property
    def _optimum(self) -> float:
        return (self.stretch[1] - self.stretch[0]) / max(
            SMALLEST, self.numbers[1] - self.numbers[0]
        )

    @property
    def _normalized(self) -> float:
        return self.numbers[0] + (self.length - self.stretch[0]) / max(SMALLEST, self._optimum)

    def active(self, velocity: float) -> float:
        """Return the force per unit activation."""
        return -self.peak * self._by_length * self._by_velocity(velocity)[0]

    def force_slope(self, velocity: float) -> float:
        """Return its derivative by the velocity."""
        return -self.peak * self._by_length * self._by_velocity(velocity)[1]

    @property
    def passive(self) -> float:
        """The force without activation: half quadratic, then linear."""
        length, middle = self._normalized, (1 + self.numbers[5]) / 2
        if length <= 1:
            return 0.0
        width = max(SMALLEST, middle - 1)
        x = (length - 1) / width
        curve = x**2 / 2 if length <= middle else 0.5 + (length - middle) / width
        return -self.peak * self.numbers[7] * curve

    @property
    def _by_length(self) -> float:
        """A bump of four parabolas, 1 at length 1."""
        length, low, high = self._normalized, self.numbers[4], self.numbers[5]
        below, above = (low + 1) / 2, (1 + high) / 2
        if not low <= length <= high:
            return 0.0
        if length <= below:
            return ((length - low) / max(SMALLEST, below - low)) ** 2 / 2
        if length <= 1:
            return 1 - ((1 - length) / max(SMALLEST, 1 - below)) ** 2 / 2
        if length <= above:
            return 1 - ((length - 1) / max(SMALLEST, above - 1)) ** 2 / 2
        return ((high - length) / max(SMALLEST, high - above)) ** 2 / 2

    def _by_velocity(self, velocity: float) -> tuple[float, float]:
        """Return the factor by velocity, and its derivative."""
        unit = max(SMALLEST, self._optimum * self.numbers[6])
        v, plateau = velocity / unit, self.numbers[8]
        rise = plateau - 1
        if v <= -1:
            return 0.0, 0.0
        if v <= 0:
            return (v + 1) ** 2, 2 * (v + 1) / unit
        if v <= rise:
            width = max(SMALLEST, rise)
            return plateau - (rise - v) ** 2 / width, 2 * (rise - v) / width / unit
        return plateau, 0.0


def _muscle_rate(control: float, state: float, constants: Numbers) -> float:
    rise, fall, width = constants[:3]
    excess = float(np.clip(control, 0, 1)) - state
    factor = 0.5 + 1.5 * float(np.clip(state, 0, 1))
    rising, falling = rise * factor, fall / factor
    if width < SMALLEST:
        constant = rising if excess > 0 else falling
    else:
        constant = falling + (rising - falling) * _sigmoid(excess / width + 0.5)
    return excess / max(SMALLEST, constant)


def _sigmoid(x: float) -> float:
    """Return a polynomial that rises from 0 to 1 between 0 and 1, with flat ends."""
    x = float(np.clip(x, 0, 1))
    return x**3 * (6 * x**2 - 15 * x + 10)
