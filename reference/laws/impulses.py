"""Limits, motors and contacts of a tree by sequential impulses.

An impulse of each row changes its velocity to a target, within bounds; friction stays in a cone.
The impulses p are a fixed point of p = bounded(p + (target - J v) / (J M^-1 J^T)), where v are the
velocities after the step. Sources: Bullet 3.2.7, btMultiBodyConstraintSolver.cpp (contacts, cone),
btMultiBodyJointLimitConstraint.cpp, btMultiBodyJointMotor.cpp; Catto, Iterative dynamics with
temporal coherence (2005).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.reference.mechanism.laws import (
    ContactPoint,
    HardJoint,
    HardSurface,
    ImpulseContact,
    ImpulseLaws,
    ImpulseRules,
)
from physics_crosscheck.reference.mechanism.numeric import Array
from .constraints import mixed_friction
from .mechanics import LawTree, Posture

LARGEST_FRICTION = 10.0
"""Largest friction of a pair of surfaces."""

LARGEST_IMPULSE = 1e10
"""Largest impulse of a contact, N s."""

SMALLEST = float(np.finfo(float).eps)
"""Smallest inverse inertia of a row that acts."""

SWEEPS, CONVERGED, SLOWEST = 4000, 1e-16, 0.9999
"""Sweeps over all rows, the change of a velocity at which they end, relative, and the largest ratio
of two changes by which their sum is extrapolated."""

FIRST_SOLUTION = 8
"""Sweep before which rows inside their bounds are solved together, as before each power of 2."""

ROUGHLY = 1e-9
"""Share of the largest change of a velocity that sweeps may leave."""

DEPENDENT = 1e-12
"""Singular value, relative to the largest one, below which rows depend on each other."""

DIGITS = 16
"""Last digits by which each term may be rounded."""


class FrictionCone(NamedTuple):
    """Friction rows whose joint impulse is at most `friction` times that of row `normal`."""

    normal: int
    rows: tuple[int, ...]
    friction: float


@dataclass(kw_only=True)
class ImpulseRows:
    """Rows at one state, as they are added.

    Attributes:
        jacobian: each (nv,).
        targets: velocities, m/s or rad/s.
        sizes: magnitude of the terms of each target.
        bounds: lowest and highest impulse.
        softness: velocity that an impulse of 1 leaves, 1/kg.
        guesses: impulses that the engine reports.
        names: kind of each row that is not friction.
        cones: friction; its rows have no bounds.
        pairs: a motor and a limit of the same joint.
    """

    jacobian: list[Array] = field(default_factory=list)
    targets: list[float] = field(default_factory=list)
    sizes: list[float] = field(default_factory=list)
    bounds: list[tuple[float, float]] = field(default_factory=list)
    softness: list[float] = field(default_factory=list)
    guesses: list[float] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    cones: list[FrictionCone] = field(default_factory=list)
    pairs: list[tuple[int, int]] = field(default_factory=list)

    def add(
        self,
        jacobian: Array,
        target: float,
        bounds: tuple[float, float],
        *,
        name: str = "",
        softness: float = 0.0,
        guess: float = 0.0,
        size: float = 0.0,
    ) -> int:
        """Add a row; return its index."""
        self.jacobian.append(jacobian)
        self.targets.append(target)
        self.sizes.append(max(abs(target), size))
        self.bounds.append(bounds)
        self.softness.append(softness)
        self.guesses.append(guess)
        self.names.append(name)
        return len(self.targets) - 1


_EXACT = tuple(one.name for one in fields(ImpulseRows) if one.name not in ("jacobian", "bounds"))
"""Fields of rows with the same impulses, besides Jacobian and bounds."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ImpulseStep:
    """The rows at one state.

    Attributes:
        model: the laws.
        posture: the state.
        free: velocities after a step without impulses, (nv,).
        rows: limits, motors and contacts.
        contacts: at the state.
    """

    model: ImpulseModel
    posture: Posture
    free: Array
    rows: ImpulseRows
    contacts: tuple[ContactPoint, ...]

    @property
    def step(self) -> float:
        """Step, s."""
        return self.model.laws.rules.step

    def solves(self, other: ImpulseStep) -> bool:
        """Return whether these impulses also solve another step from the same posture.

        It has the same rows, except for bounds that the impulses are inside of in both.
        """
        mine, theirs = self.rows, other.rows
        return (
            self.posture is other.posture
            and self.step == other.step
            and np.array_equal(self.free, other.free)
            and all(getattr(mine, name) == getattr(theirs, name) for name in _EXACT)
            and np.array_equal(self._jacobian, other._jacobian)
            and all(
                first == second or (max(first[0], second[0]) < p < min(first[1], second[1]))
                for p, first, second in zip(
                    self._solution[0], mine.bounds, theirs.bounds, strict=True
                )
            )
        )

    @cached_property
    def _jacobian(self) -> Array:
        return np.array(self.rows.jacobian).reshape(len(self.rows.targets), len(self.free))

    @cached_property
    def _response(self) -> Array:
        """Velocities per unit impulse, (nv, rows)."""
        return np.asarray(np.linalg.solve(self.posture.mass, self._jacobian.T), dtype=np.float64)

    @property
    def converged(self) -> bool:
        """True if the impulses are exact to the last digits."""
        impulses, change = self._solution
        effect = np.abs(self._response) @ change
        size = np.max(np.abs(self._response) @ np.abs(impulses), initial=0.0)
        return bool(np.max(effect, initial=0.0) <= ROUGHLY * size)

    @cached_property
    def _holds(self) -> NDArray[np.bool_]:
        """Rows that reach their target: within their bounds or their cone."""
        impulses, rows = self._solution[0], self.rows
        response = np.einsum("rv,vr->r", self._jacobian, self._response)
        low, high = np.array(rows.bounds).reshape(-1, 2).T
        result: NDArray[np.bool_] = (low < impulses) & (impulses < high) & (response > SMALLEST)
        for cone in rows.cones:
            members = list(cone.rows)
            largest = cone.friction * impulses[cone.normal]
            inside = np.linalg.norm(impulses[members]) < largest * (1 - ROUGHLY)
            result[members] = inside & (response[members] > SMALLEST)
        return result

    @cached_property
    def _solution(self) -> tuple[Array, Array]:
        """The impulses, and their change by a last sweep, extrapolated."""
        rows = self.rows
        solver = _Sweeps(rows, self._jacobian @ self._response, self._jacobian @ self.free)
        paired = {i for pair in rows.pairs for i in pair}
        joints = [i for i, name in enumerate(rows.names) if name in ("limits", "motors")]
        bounded = [i for i in joints if i not in paired]
        # Impulses of contacts need not be unique: those that the engine reports are a start.
        solver.run(bounded, ())
        normals = [i for i, name in enumerate(rows.names) if name == "contacts"]
        change = solver.run([*bounded, *normals], rows.cones)
        return solver.impulses, change

    @property
    def law(self) -> ImpulseStep:
        """The rows themselves."""
        return self

    @cached_property
    def acceleration(self) -> Array:
        """The mean accelerations of the step, (nv,)."""
        after: Array = self.free + self._response @ self._solution[0]
        result: Array = (after - self.posture.m) / self.step
        return result

    def uncertainty(self, a: Array, unbalanced: Array) -> Array:
        """Return the uncertainty of accelerations, (nv,), with the one that an engine's solver has.

        Args:
            a: accelerations.
            unbalanced: error of the engine's accelerations, (nv,).
        """
        impulses, change = self._solution
        mass, h, m = self.posture.mass, self.step, self.posture.m
        after, tall = np.abs(m + h * a), np.abs(self._jacobian).T
        response = np.einsum("rv,vr->r", self._jacobian, self._response)
        sizes = np.abs(self._jacobian) @ (after + np.abs(self.free)) + self.rows.sizes
        unsure = np.where(self._holds, sizes / np.maximum(response, SMALLEST), 0.0)
        loose = np.abs(mass) @ (after + np.abs(self.free)) + tall @ (np.abs(impulses) + unsure)
        rounding = np.abs(self.posture.inverse) @ loose + after + np.abs(m)
        result: Array = (DIGITS * SMALLEST * rounding + np.abs(self._response) @ change) / h
        return result + np.abs(unbalanced)

    @property
    def efforts(self) -> Iterator[tuple[int, float, float]]:
        """Joints with the mean force of their motor and its largest one."""
        places = [there.start for there in self.model.tree.tree.velocities]
        for i, name in enumerate(self.rows.names):
            if name == "motors":
                place = int(np.flatnonzero(self.rows.jacobian[i])[0])
                impulse, largest = self._solution[0][i], self.rows.bounds[i][1]
                yield places.index(place), float(impulse) / self.step, largest / self.step

    @property
    def acting_elements(self) -> Iterator[tuple[str, str | int]]:
        """Limits and motors at a limit that act, and the links that touch something."""
        for i, name in enumerate(self.rows.names):
            size, highest = abs(float(self._solution[0][i])), self.rows.bounds[i][1]
            kind = {"limits": "limit", "motors": "clamp"}.get(name, "")
            if kind and size and (kind == "limit" or size >= highest):
                yield kind, self.model.tree.names[int(np.flatnonzero(self.rows.jacobian[i])[0])]
        for contact in self.contacts:
            assert isinstance(contact, ImpulseContact)
            if contact.impulse[0]:
                yield from (("contact", i) for i in contact.surfaces)

    def next_state(self, a: Array, after: Array, _h: float) -> tuple[Array, Array]:
        """Return velocities and positions after a step; arguments as in `LawStep.next_state`."""
        velocity: Array = self.posture.m + self.step * a
        return velocity, self.model.advanced(self.posture, after)

    def velocity_uncertainty(self, _a: Array, unsure: Array) -> Array:
        """Return the uncertainty of the next velocities, (nv,), from that of accelerations."""
        return self.step * unsure

    drive_states = np.zeros(0)

    def acted(self, a: Array) -> Iterator[tuple[str, int]]:
        """Yield how often forces of each kind acted."""
        impulses = self._solution[0]
        for name in ("contacts", "limits", "motors"):
            rows = [i for i, one in enumerate(self.rows.names) if one == name]
            yield name, int(np.count_nonzero(impulses[rows]))
            if name == "motors":
                highest = np.array([self.rows.bounds[i][1] for i in rows])
                yield "motors at a limit", int(np.sum(np.abs(impulses[rows]) >= highest))


class _Sweeps:
    """Impulses that are corrected row by row.

    Args:
        rows: the rows.
        response: J M^-1 J^T.
        free: velocities of the rows without impulses.
    """

    def __init__(self, rows: ImpulseRows, response: Array, free: Array) -> None:
        self._rows, self._matrix, self._response = rows, response, list(response.T)
        self._inertias = np.diagonal(response) + rows.softness
        self._inertia: list[float] = self._inertias.tolist()
        self._impulses = [float(guess) for guess in rows.guesses]
        self._velocities = free + response @ self.impulses
        self._size = float(np.max(np.abs(free), initial=0.0)) + max(rows.sizes, default=0.0)

    @property
    def impulses(self) -> Array:
        """The impulses, (rows,)."""
        return np.array(self._impulses)

    def run(self, bounded: Sequence[int], cones: Sequence[FrictionCone]) -> Array:
        """Sweep until nothing changes; return the rest of the change, extrapolated, (rows,)."""
        size, before = np.inf, np.inf
        old = self.impulses
        change = np.zeros_like(old)
        inner = [*bounded, *(i for pair in self._rows.pairs for i in pair)]
        for sweep in range(1, SWEEPS + 1):
            if sweep >= FIRST_SOLUTION and sweep.bit_count() == 1:
                self._solve_inner(inner)
            for i in bounded:
                self._bound(i)
            for motor, limit in self._rows.pairs:
                self._share(motor, limit)
            for cone in cones:
                self._project(cone)
            now = self.impulses
            change, old = np.abs(now - old), now
            before, size = size, float(np.max(change * self._inertias, initial=0.0))
            if size <= CONVERGED * self._size:
                break
        rate = min(size / before, SLOWEST) if 0 < before < np.inf else 0.0
        result: Array = change / (1 - rate)
        return result

    def _solve_inner(self, rows: Sequence[int]) -> None:
        """Move rows inside their bounds together to their targets, or until one is at a bound.

        Sweeps alone converge slowly where many joints are coupled.
        """
        bounds = np.array(self._rows.bounds).reshape(-1, 2)[list(rows)]
        p = self.impulses[list(rows)]
        is_inner = (bounds[:, 0] < p) & (p < bounds[:, 1]) & (self._inertias[rows] > SMALLEST)
        inner = np.array(rows, dtype=int)[is_inner]
        softness = np.array(self._rows.softness)[inner]
        size = np.sqrt(self._inertias[inner])
        matrix = (self._matrix[np.ix_(inner, inner)] + np.diag(softness)) / np.outer(size, size)
        lacks = np.array(self._rows.targets)[inner] - self._velocities[inner]
        lacks -= softness * p[is_inner]
        # Contacts of a flat foot depend on each other: their least change keeps a solution.
        change = np.linalg.lstsq(matrix, lacks / size, rcond=DEPENDENT)[0] / size
        ends = np.where(change > 0, bounds[is_inner, 1], bounds[is_inner, 0]) - p[is_inner]
        room = np.where(change != 0, ends / np.where(change != 0, change, 1.0), np.inf)
        share = min(1.0, float(np.min(room, initial=np.inf)))
        if np.isfinite(change).all():
            for i, impulse in zip(inner.tolist(), p[is_inner] + share * change, strict=True):
                self._set(i, float(impulse))

    def _wanted(self, i: int) -> float:
        """Return the impulse at which a row reaches its target."""
        impulse, rows = self._impulses[i], self._rows
        if self._inertia[i] <= SMALLEST:
            return impulse
        lacks = rows.targets[i] - self._velocities.item(i) - rows.softness[i] * impulse
        return impulse + lacks / self._inertia[i]

    def _set(self, i: int, impulse: float) -> None:
        if impulse != self._impulses[i]:
            self._velocities += self._response[i] * (impulse - self._impulses[i])
            self._impulses[i] = impulse

    def _bound(self, i: int) -> None:
        lowest, highest = self._rows.bounds[i]
        self._set(i, min(max(self._wanted(i), lowest), highest))

    def _share(self, motor: int, limit: int) -> None:
        """Set the impulses of a motor and of a limit that together move one joint.

        Row by row they would work against each other until the motor is at its limit.
        """
        sign, targets = float(np.sign(self._response[limit][motor])), self._rows.targets
        inertia, largest = self._inertias[limit], self._rows.bounds[motor][1]
        still = self._velocities.item(limit) - inertia * (
            self._impulses[limit] + sign * self._impulses[motor]
        )
        driven, pushed = sign * targets[motor], targets[limit]
        exerted = min(max((driven - still) / inertia, -largest), largest)
        push = 0.0
        if still + inertia * exerted < pushed:
            opposed = -largest if driven < pushed else exerted
            push = min((pushed - still) / inertia - opposed, self._rows.bounds[limit][1])
            exerted = min(max((driven - still) / inertia - push, -largest), largest)
        self._set(motor, float(sign * exerted))
        self._set(limit, float(push))

    def _project(self, cone: FrictionCone) -> None:
        """Project the impulses of a cone's rows, which are corrected together."""
        wanted = [self._wanted(i) for i in cone.rows]
        size, largest = (
            float(np.linalg.norm(wanted)),
            cone.friction * self._impulses[cone.normal],
        )
        share = largest / size if size > largest else 1.0
        for i, impulse in zip(cone.rows, wanted, strict=True):
            self._set(i, share * impulse)


@dataclass(frozen=True, kw_only=True, eq=False)
class ImpulseModel:
    """A tree with limits, motors and contacts that act by impulses.

    Attributes:
        laws: the file's numbers.
        tree: the bodies.
    """

    laws: ImpulseLaws
    tree: LawTree

    def under(self, laws: ImpulseLaws) -> ImpulseModel:
        """Return the same tree under other laws."""
        return replace(self, laws=laws)

    has_next_state = True

    @property
    def drive_count(self) -> int:
        """Number of motors."""
        return len(self.laws.rules.controls)

    def drive_ranges(self, controls: int, _states: int) -> tuple[Array, Array]:
        """Return ranges of the driven joints, infinite without one, and no states."""
        ranges = np.tile([-np.inf, np.inf], (controls, 1))
        for joint in self.laws.joints:
            if joint.lower <= joint.upper:
                ranges[joint.control] = joint.lower, joint.upper
        return ranges, np.zeros((0, 2))

    @property
    def limits(self) -> Iterator[tuple[int, float, float]]:
        """Joints with their lower and upper limits."""
        for joint in self.laws.joints:
            if joint.lower <= joint.upper:
                yield joint.joint, joint.lower, joint.upper

    def elements(self) -> Iterator[tuple[str, str | int]]:
        """Yield nothing: a part of a file names its own elements."""
        return iter(())

    def solve(
        self,
        posture: Posture,
        controls: Array,
        _states: Array,
        contacts: Sequence[ContactPoint],
        _start: Array,
        _residual: Array | None = None,
    ) -> ImpulseStep:
        """Return the rows at a state, which solve themselves.

        Args:
            posture: the state.
            controls: target positions of the motors; NaN for a motor that is off.
            contacts: with impulses, at which the solution starts.
        """
        rows, h = ImpulseRows(), self.laws.rules.step
        for joint in self.laws.joints:
            self._add_joint(rows, posture, joint, float(controls[joint.control]))
        free = posture.m + h * np.linalg.solve(posture.mass, posture.smooth)
        free = free + h * self._about_center(posture)
        for contact in contacts:
            assert isinstance(contact, ImpulseContact)
            _ContactImpulses(self, rows, posture, contact, free).add()
        touching = tuple(contacts)
        return ImpulseStep(model=self, posture=posture, free=free, rows=rows, contacts=touching)

    def advanced(self, posture: Posture, m: Array) -> Array:
        """Return the positions after a step at velocities m, (nv,)."""
        h = self.laws.rules.step
        y: Array = self.tree.advance(posture.y[None], m[None], h)[0]
        if self.laws.root is None:
            return y
        there, arm = self._root_motion(posture)
        turned = next(self.tree.postures(y[None], m[None])).poses[0].rotation
        spin = posture.poses[0].rotation @ m[there][:3]
        y[there][3:] += h * np.cross(spin, arm) + arm - turned @ np.array(self.laws.root)
        return y

    def unsaturated(self, posture: Posture, shares: Array) -> tuple[Array, Array]:
        """Return target positions at which motors exert shares of their efforts, and no states."""
        h, gain = self.laws.rules.step, self.laws.rules.gain
        joints, force = self.laws.joints, posture.smooth.copy()
        places = [self.tree.tree.velocities[joint.joint].start for joint in joints]
        for place, joint in zip(places, joints, strict=True):
            force[place] += shares[joint.control] * joint.effort
        after = posture.m + h * np.linalg.solve(posture.mass, force)
        controls = np.zeros(len(shares))
        controls[[joint.control for joint in joints]] = posture.y[places] + after[places] * h / gain
        return controls, np.zeros(0)

    def _root_motion(self, posture: Posture) -> tuple[slice, Array]:
        """Return the root's velocities, and its center of mass from its origin, in the world."""
        arm: Array = posture.poses[0].rotation @ np.array(self.laws.root)
        return self.tree.tree.velocities[0], arm

    def _about_center(self, posture: Posture) -> Array:
        """Return the acceleration of the root's origin that a step about the center lacks."""
        result = np.zeros_like(posture.m)
        if self.laws.root is not None:
            there, arm = self._root_motion(posture)
            spin = posture.poses[0].rotation @ posture.m[there][:3]
            result[there][3:] = np.cross(spin, np.cross(spin, arm))
        return result

    def _add_joint(
        self, rows: ImpulseRows, posture: Posture, joint: HardJoint, control: float
    ) -> None:
        rules, place = self.laws.rules, self.tree.tree.velocities[joint.joint].start
        along, position = np.eye(len(posture.m))[place], float(posture.y[place])
        limited = joint.lower <= joint.upper
        size = (abs(position) + abs(control)) / rules.step
        motor = None
        if np.isfinite(control) and joint.effort > 0:
            low, high = joint.targets
            control = min(max(control, low), high) if low <= high else control
            limit, target = joint.effort * rules.step, rules.gain * (control - position)
            motor = rows.add(along, target / rules.step, (-limit, limit),
                             name="motors", size=rules.gain * size)  # fmt: skip
        for distance, sign in ((position - joint.lower, 1.0), (joint.upper - position, -1.0)):
            if limited and distance <= 0:
                pushed = distance > -rules.deepest
                recovered = rules.limit_recovery / rules.step if pushed else 0.0
                size = abs(position) * recovered
                row = rows.add(sign * along, -distance * recovered, (0.0, rules.largest),
                               name="limits", size=size)  # fmt: skip
                rows.pairs += [] if motor is None else [(motor, row)]


@dataclass(frozen=True)
class _ContactImpulses:
    """The rows of a contact, from the first surface to the other one."""

    model: ImpulseModel
    rows: ImpulseRows
    posture: Posture
    contact: ImpulseContact
    free: Array

    def add(self) -> None:
        """Add the normal row, and those of friction."""
        rows, contact, h = self.rows, self.contact, self._rules.step
        linear = self._relative
        if not linear.any():
            return  # two bodies that do not move
        softness, recovery = self._spring
        first, other = self._surfaces
        distance = contact.distance + self._rules.slop
        approach = float(linear[0] @ self.free)
        bounced = max(0.0, -first.restitution * other.restitution * approach)
        target = bounced if abs(approach) >= self._rules.bounce else 0.0
        target -= distance / h if distance > 0 else distance * recovery / h
        size = (abs(distance) + float(np.max(np.abs(contact.position)))) / h
        normal = rows.add(linear[0], target, (0.0, LARGEST_IMPULSE), name="contacts",
                          softness=softness, size=size,
                          guess=float(contact.impulse[0]))  # fmt: skip
        drift = contact.frame[1:] @ (contact.other - contact.position)
        anchored = first.anchored or other.anchored
        recovery_speed = -self._rules.friction_recovery / h * drift * anchored
        across = tuple(
            rows.add(
                linear[i], float(recovery_speed[i - 1]), (0.0, 0.0), guess=float(contact.impulse[i])
            )
            for i in (1, 2)
        )
        friction = mixed_friction(self._rules.mixing, first.friction, other.friction)
        rows.cones.append(FrictionCone(normal, across, min(friction, LARGEST_FRICTION)))

    @property
    def _rules(self) -> ImpulseRules:
        return self.model.laws.rules

    @property
    def _surfaces(self) -> tuple[HardSurface, HardSurface]:
        first, other = self.contact.surfaces
        return self.model.laws.surfaces[first], self.model.laws.surfaces[other]

    @property
    def _relative(self) -> Array:
        """Velocities of the other body relative to the first one, along the axes, (3, nv)."""
        first, other = self.contact.surfaces
        moving = self.posture.jacobian(other, self.contact.other)[0]
        result: Array = self.contact.frame @ (
            moving - self.posture.jacobian(first, self.contact.position)[0]
        )
        return result

    @property
    def _spring(self) -> tuple[float, float]:
        """Softness (1/kg) and recovery of the contact; springs of two surfaces act in series."""
        springs = [surface.spring for surface in self._surfaces]
        if all(spring is None for spring in springs):
            return 0.0, self._rules.contact_recovery
        stated = [RIGID if spring is None else spring for spring in springs]
        stiffness = 1 / sum(1 / spring[0] for spring in stated)
        damping, h = sum(spring[1] for spring in stated), self._rules.step
        whole = h * stiffness + damping
        return 1 / (whole * h), h * stiffness / whole


RIGID = 1e30, 0.1
"""Stiffness and damping of a rigid surface in contact with a soft one, N/m and N s/m."""
