"""The next state of the equations by an integrator's rule, to compare with an engine's step.

`next_states` implements the rules that engines document, without reference to any engine. A step
starts from positions q and velocities m as an engine stores them. For rotations m is not the rate
of q (`reference.solving.tree_stepping`).

A motion at other constants needs no derivation or compilation: `Family.with_constants` substitutes
numbers. `solving.solve` finds its motions by multiple shooting.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Literal

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from physics_crosscheck.reference.dynamics.derive import (
    Equations,
    bounded_symbols,
    running_error,
    slopes_by,
)
from physics_crosscheck.reference.dynamics.equations import EquationsOfMotion
from physics_crosscheck.reference.dynamics.tree_dynamics import Dynamics
from physics_crosscheck.reference.mechanism.chart import Coupled, MinimalCoordinates
from physics_crosscheck.reference.mechanism.declaration import Declaration, Scenario, t
from physics_crosscheck.reference.mechanism.laws import Substeps
from physics_crosscheck.reference.mechanism.numeric import Array, NumericFunction, compile_function
from physics_crosscheck.reference.mechanism.rotations import Scalars
from physics_crosscheck.reference.mechanism.signal import SignalPiece, pieces
from physics_crosscheck.reference.mechanism.tree import Tree


@dataclass(frozen=True)
class Family:
    """The equations of a system, for any values of its constants.

    Attributes:
        equations: with symbols for the constants.
        acceleration, power, mass, force, derivatives: functions whose last argument group is the
            constants.
    """

    equations: Equations
    acceleration: NumericFunction
    power: NumericFunction
    mass: NumericFunction
    force: NumericFunction
    derivatives: NumericFunction | None

    @staticmethod
    def compile(equations: Equations) -> Family:
        """Compile the equations of a system."""
        source, system = equations, equations.system
        symbols = [c.symbol for c in system.constants]

        def compiled(expressions: Sequence[sp.Expr]) -> NumericFunction:
            return compile_function(expressions, system.q, system.v, system.u, (t,), symbols)

        return Family(
            equations=source,
            acceleration=compiled(list(source.acceleration)),
            power=compiled([source.energy, source.supplied, source.dissipated]),
            mass=compiled(list(source.mass)),
            force=compiled(list(source.force)),
            derivatives=None if source.long else compiled(source.derivatives),
        )

    @cached_property
    def declared(self) -> Declaration:
        """The system's declaration, without the checks of `System`."""
        system = self.equations.system
        return Declaration(**{f.name: getattr(system, f.name) for f in fields(Declaration)})

    @cached_property
    def _signals(self) -> dict[str, tuple[SignalPiece, ...]]:
        return {}

    def signals(self, system: Declaration, scenario: Scenario) -> tuple[SignalPiece, ...]:
        """Return the inputs of a scenario; those without constants are resolved once."""
        symbols = {c.symbol for c in system.constants}
        free = set[sp.Basic]().union(
            *(sp.sympify(scenario.inputs[i]).free_symbols for i in system.inputs)
        )
        if free & symbols:
            return pieces(system, scenario)
        if scenario.name not in self._signals:
            self._signals[scenario.name] = pieces(system, scenario)
        return self._signals[scenario.name]

    def with_constants(self, constants: Mapping[str, float]) -> DrawnEquations:
        """Return the equations for the given constants; others keep their declared values."""
        system = self.declared
        changed = tuple(
            replace(c, value=float(constants.get(c.name, c.value))) for c in system.constants
        )
        return DrawnEquations(self, replace(system, constants=changed))


@dataclass(frozen=True)
class DrawnEquations(EquationsOfMotion):
    """A family's equations at one set of constants, those of `system`."""

    family: Family
    system: Declaration

    @cached_property
    def values(self) -> tuple[float, ...]:
        """Values of the constants, in declared order."""
        return tuple(float(c.value) for c in self.system.constants)

    @property
    def linear(self) -> bool:
        """True if the equations are linear, for any constants."""
        return self.family.equations.linear

    @cached_property
    def numeric_acceleration(self) -> NumericFunction:
        """a(q, v, u, (t,))."""
        return self.family.acceleration.bind(self.values)

    @cached_property
    def numeric_power(self) -> NumericFunction:
        """(energy, supplied, dissipated) of (q, v, u, (t,))."""
        return self.family.power.bind(self.values)

    @cached_property
    def numeric_mass(self) -> NumericFunction:
        """M of (q, v, u, (t,)), in row-major order."""
        return self.family.mass.bind(self.values)

    @cached_property
    def numeric_force(self) -> NumericFunction:
        """f of (q, v, u, (t,))."""
        return self.family.force.bind(self.values)

    @property
    def mass(self) -> sp.ImmutableMatrix:
        """M, with symbols for the constants."""
        return self.family.equations.mass

    @property
    def force(self) -> sp.ImmutableMatrix:
        """f, with symbols for the constants."""
        return self.family.equations.force

    def acceleration_error(
        self,
        states: Array,
        inputs: Array,
        times: Array,
        *,
        off: Array,
        time_error: Array,
        rounded: bool,
    ) -> Array:
        """Return a bound of the error of the accelerations, from a running error analysis."""
        variables = bounded_symbols(
            self.system, states, inputs, times, off=off, time_error=time_error
        )
        expressions = list(self.family.equations.acceleration)
        return running_error(expressions, variables, rounded=rounded)

    def signals(self, scenario: Scenario) -> tuple[SignalPiece, ...]:
        """Return the inputs of a scenario at these constants."""
        return self.family.signals(self.system, scenario)

    def slopes(self, states: Array, inputs: Array, times: Array) -> Array:
        """Return the slopes, computed numerically from the derivatives of M and f."""
        if self.family.derivatives is None:
            return super().slopes(states, inputs, times)
        return slopes_by(self.family.derivatives.bind(self.values), states, inputs, times)


Scheme = Literal["semi-implicit Euler", "Runge-Kutta 4"]


class Stepped(ABC):
    """M(q) dm/dt = f(q, m, u) for integrators; positions and velocities are (B, n)."""

    @abstractmethod
    def velocities(self, q: Array, rate: Array) -> Array:
        """Return the velocities that a step stores, for coordinate rates."""

    @abstractmethod
    def rates(self, q: Array, m: Array) -> Array:
        """Return the coordinate rates for stored velocities."""

    @abstractmethod
    def mass(self, q: Array) -> Array:
        """Return M, (B, n, n)."""

    @abstractmethod
    def force(self, q: Array, m: Array, u: Array) -> Array:
        """Return f under inputs or forces u, (B, n)."""

    @abstractmethod
    def advanced(self, q: Array, m: Array, h: float) -> Array:
        """Return the positions after h seconds at constant m."""

    @abstractmethod
    def exponential_rate(self, moved: Array, m: Array) -> Array:
        """Return m as the rate of the displacement in `advanced`, after displacements (B, n)."""


class SteppedEquations(Stepped):
    """Time-invariant equations whose velocities are coordinate rates; u are inputs."""

    def __init__(self, equations: Equations | DrawnEquations) -> None:
        self._mass, self._force = equations.numeric_mass, equations.numeric_force
        self._inputs = len(equations.system.inputs)
        self._still = not set(equations.system.q) & equations.mass.free_symbols
        self._constant: Array | None = None
        """The mass matrix if no coordinate occurs in it, cached for thousands of steps."""

    def velocities(self, q: Array, rate: Array) -> Array:
        """Return the rates."""
        return rate

    def rates(self, q: Array, m: Array) -> Array:
        """Return the velocities."""
        return m

    def mass(self, q: Array) -> Array:
        """Return M, (B, n, n)."""
        if self._constant is not None:
            return np.broadcast_to(self._constant, (len(q), *self._constant.shape))
        n, none = q.shape[1], np.zeros((len(q), self._inputs + 1))
        mass = self._mass(q, 0 * q, none[:, 1:], none[:, :1]).reshape(len(q), n, n)
        if self._still and len(q):
            self._constant = mass[0]
        return mass

    def force(self, q: Array, m: Array, u: Array) -> Array:
        """Return f, (B, n)."""
        return self._force(q, m, u, np.zeros((len(q), 1)))

    def advanced(self, q: Array, m: Array, h: float) -> Array:
        """Return q + h m."""
        return q + h * m

    def exponential_rate(self, moved: Array, m: Array) -> Array:
        """Return m."""
        return m


def stepped_equations(equations: Equations | DrawnEquations) -> SteppedEquations | None:
    """Return the equations for stepping; None if they depend on time, unlike an engine's step."""
    timed = any(t in e.free_symbols for e in (*equations.mass, *equations.force))
    return None if timed else SteppedEquations(equations)


class SteppedBodies(Stepped):
    """A tree of bodies; u are generalized forces."""

    def __init__(self, tree: Tree) -> None:
        self._tree = SteppedTree(tree)

    def velocities(self, q: Array, rate: Array) -> Array:
        """Return angular velocities for rotations, rates otherwise."""
        return self._tree.velocities(_rows(q), _rows(rate)).T

    def rates(self, q: Array, m: Array) -> Array:
        """Return the coordinate rates."""
        return self._tree.rates(_rows(q), _rows(m)).T

    def mass(self, q: Array) -> Array:
        """Return M, (B, n, n)."""
        return np.moveaxis(self._tree.mass(_rows(q)), -1, 0)

    def force(self, q: Array, m: Array, u: Array) -> Array:
        """Return f, (B, n)."""
        return self._tree.force(_rows(q), _rows(m), _rows(u)).T

    def advanced(self, q: Array, m: Array, h: float) -> Array:
        """Return the positions after h seconds; each rotation has a fixed axis."""
        return self._tree.advanced(_rows(q), _rows(m), h).T

    def exponential_rate(self, moved: Array, m: Array) -> Array:
        """Return m by the inverse differential of the exponential map."""
        return self._tree.exponential_rate(_rows(moved), _rows(m)).T


def _rows(values: Array) -> Array:
    """Return values (B, n) by coordinate, (n, B), each in one piece."""
    return np.ascontiguousarray(values.T)


def next_states(
    stepped: Stepped,
    states: Array,
    u: Array,
    h: float,
    *,
    scheme: Scheme,
    damping: Array | None = None,
    stiffness: Array | None = None,
    by_velocity: bool = False,
    coupled: NDArray[np.bool_] | None = None,
    substeps: Substeps | None = None,
    steps: int = 1,
) -> Array:
    """Return states (B, 2n) after steps of h seconds, by a rule on the equations.

    Args:
        stepped: the mechanism.
        states: q and rates, (B, 2n).
        u: constant over each step, (B, steps, inputs).
        h: seconds.
        scheme: "semi-implicit Euler" is m + h a, then q advanced by the new m. "Runge-Kutta 4" is
            the classical rule, or the Munthe-Kaas rule for rotating bodies.
        damping: D of (M + h D) a = f, (n, n), implicit damping; None for an explicit f.
        stiffness: K of (M + h D + h^2 K) a = f - h K m, (n, n), implicit springs.
        by_velocity: use D = -df/dm of all forces instead of `damping`.
        coupled: with `by_velocity`, mask of the pairs in D, (n, n); None for all pairs.
        substeps: a division of each step, for coordinates with rates; None for no division.
        steps: number of steps.

    Returns:
        The states; not finite if the motion blows up.
    """
    n = states.shape[1] // 2
    q: Array = states[:, :n]
    m: Array = stepped.velocities(q, states[:, n:])
    for k in range(steps):
        held = u[:, k]
        if scheme == "Runge-Kutta 4":
            q, m = _runge_kutta(stepped, q, m, held, h)
            continue
        if substeps is not None:
            q, m = _substepped(stepped, q, m, held, h, substeps)
            continue
        implicit = damping
        if by_velocity:
            implicit = _by_velocity(stepped, q, m, held) * (1 if coupled is None else coupled)
        m = m + h * _acceleration(
            stepped, q, m, held, _ImplicitTerms.from_matrices(h, implicit, stiffness)
        )
        q = stepped.advanced(q, m, h)
    return np.concatenate([q, stepped.rates(q, m)], axis=1)


@dataclass(frozen=True)
class _ImplicitTerms:
    """Implicit terms of a step: `mass` is added to M, (n, n) or (B, n, n).

    `by_velocity`, (n, n), times the velocity at the step's start is subtracted from the forces;
    None for no such term.
    """

    mass: Array
    by_velocity: Array | None

    @staticmethod
    def from_matrices(
        h: float, damping: Array | None, stiffness: Array | None
    ) -> _ImplicitTerms | None:
        """Return the implicit terms of D and K; None if there are neither."""
        if stiffness is None:
            return None if damping is None else _ImplicitTerms(h * damping, None)
        springs = h * stiffness
        mass = h * springs if damping is None else h * (damping + springs)
        return _ImplicitTerms(mass, springs)


def _acceleration(
    stepped: Stepped, q: Array, m: Array, u: Array, implicit: _ImplicitTerms | None
) -> Array:
    mass, force = stepped.mass(q), stepped.force(q, m, u)
    matrix: Array = mass if implicit is None else mass + implicit.mass
    if implicit is not None and implicit.by_velocity is not None:
        force = force - m @ implicit.by_velocity.T
    columns = force[:, :, None]
    if len(q[0]) == 1:  # the same division
        with np.errstate(all="ignore"):
            return (columns / matrix)[:, :, 0]
    try:
        return np.linalg.solve(matrix, columns).astype(float)[:, :, 0]
    except np.linalg.LinAlgError:  # the mass matrix is arbitrary once a motion has blown up
        return np.full_like(q, np.nan)


def _substepped(
    stepped: Stepped, q: Array, m: Array, u: Array, h: float, law: Substeps
) -> tuple[Array, Array]:
    """Take one step in substeps, joint by joint."""
    response, dt = _responses(stepped.mass(q)), h / law.count
    unit = np.diagonal(response, axis1=1, axis2=2)
    still, free = (stepped.force(q, 0 * m, one) for one in (u, 0 * u))
    held = still - law.stiffness * (law.target - q) - law.damping * law.speed
    lagging = stepped.force(q, m, u) - still + (law.damping + law.passive) * m
    m = m + h * (response @ lagging[:, :, None])[:, :, 0]
    pushed, outer = dt * (response @ held[:, :, None])[:, :, 0], dt * (still - free)
    softness = dt * (dt * law.stiffness + law.damping)
    gain, least = 1 / (1 + softness * unit), np.minimum(dt * law.passive, 1 / unit)
    rubbed, moved = np.zeros_like(m), np.zeros_like(m)
    for i in range(law.count):
        m = m + pushed
        goal = law.target - q - (h - (i + 1) * dt) * law.speed
        for k in law.order:
            servo = law.damping[k] * law.speed[k] + law.stiffness[k] * (goal[:, k] - moved[:, k])
            total = outer[:, k] + gain[:, k] * (dt * servo - softness[k] * m[:, k])
            bound = dt * law.effort[k]
            m = m + response[:, :, k] * (np.clip(total, -bound, bound) - outer[:, k])[:, None]
            rub = -least[:, k] * m[:, k]
            m, rubbed[:, k] = m + response[:, :, k] * rub[:, None], rubbed[:, k] + rub
        moved = moved + dt * m
    for k in law.order * law.repeats:
        bound = h * law.passive[k] * abs(m[:, k])
        rub = np.clip(rubbed[:, k] - m[:, k] / unit[:, k], -bound, bound) - rubbed[:, k]
        m, rubbed[:, k] = m + response[:, :, k] * rub[:, None], rubbed[:, k] + rub
    return stepped.advanced(q, moved, 1.0), m


def _responses(mass: Array) -> Array:
    """Return M^-1, (B, n, n); NaN if it is singular."""
    try:
        return np.asarray(np.linalg.inv(mass), dtype=float)
    except np.linalg.LinAlgError:  # arbitrary once a motion has blown up
        return np.full_like(mass, np.nan)


def _by_velocity(stepped: Stepped, q: Array, m: Array, u: Array) -> Array:
    """Return -df/dm, (B, n, n), by central differences, exact for forces quadratic in m."""
    columns = []
    for i, size in enumerate(np.maximum(np.max(np.abs(m), axis=0), 1e-3)):
        moved = size * np.eye(m.shape[1])[i]
        forward, backward = (stepped.force(q, m + by, u) for by in (moved, -moved))
        columns.append((backward - forward) / (2 * size))
    return np.stack(columns, axis=2)


def _runge_kutta(stepped: Stepped, q: Array, m: Array, u: Array, h: float) -> tuple[Array, Array]:
    """Take one step of classical Runge-Kutta, of Munthe-Kaas' method for rotating bodies.

    Displacements from the step's start are summed, which keeps the order for rotations (Munthe-Kaas
    1999, Appl. Numer. Math. 29, 115-127).
    """
    rates, accelerations = [m], [_acceleration(stepped, q, m, u, None)]
    for share in (0.5, 0.5, 1.0):
        moved = share * h * rates[-1]
        position = stepped.advanced(q, moved, 1.0)
        now: Array = m + share * h * accelerations[-1]
        rates.append(stepped.exponential_rate(moved, now))
        accelerations.append(_acceleration(stepped, position, now, u, None))
    move, gain = (h / 6 * (a + d + 2 * (b + c)) for a, b, c, d in (rates, accelerations))
    return stepped.advanced(q, move, 1.0), m + gain


class SteppedTree:
    """M(x) dm/dt = f(x, m, u) of a tree for integrators, with stored velocities m.

    Arrays are (n, B), in the independent coordinates.

    Args:
        tree: the links.
    """

    def __init__(self, tree: Tree) -> None:
        self._dynamics, self._chart = Dynamics(tree), MinimalCoordinates(tree)
        self._coupled = Coupled(tree)

    def velocities(self, x: Scalars, rate: Scalars) -> Scalars:
        """Return the stored velocities for coordinate rates."""
        return self._chart.stored_velocities(self._all(x), self._rates(rate))[self._coupled.kept]

    def rates(self, x: Scalars, m: Scalars) -> Scalars:
        """Return the coordinate rates for stored velocities."""
        return self._chart.rates_of_stored(self._all(x), self._rates(m))[self._coupled.kept]

    def advanced(self, x: Scalars, m: Scalars, h: float) -> Scalars:
        """Return the coordinates after h seconds at constant velocities."""
        return self._chart.advance(self._all(x), self._rates(m), h)[self._coupled.kept]

    def exponential_rate(self, moved: Scalars, m: Scalars) -> Scalars:
        """Return m as the rate of the displacement of `advanced`, after displacements."""
        return self._chart.exponential_rate(self._rates(moved), self._rates(m))[self._coupled.kept]

    def mass(self, x: Scalars) -> Scalars:
        """Return M, (n, n, B)."""
        y = self._all(x)
        mass = self._dynamics.mass(self._chart.positions(y))
        if not self._chart.plain:
            half = self._chart.to_joint_axes(y, mass.swapaxes(0, 1))
            mass = self._chart.to_joint_axes(y, half.swapaxes(0, 1)).swapaxes(0, 1)
        return self._coupled.mass(mass)

    def force(self, x: Scalars, m: Scalars, u: Scalars) -> Scalars:
        """Return f under forces u: moments about link axes, forces along the joint's axes."""
        y, m = self._all(x), self._rates(m)
        forces = np.zeros_like(m)
        forces[self._coupled.kept] = u
        residual = self._dynamics.residual(
            self._chart.positions(y),
            self._chart.tree_velocities(y, m),
            self._chart.frame_acceleration(y, m),
            self._chart.forces(y, forces),
        )
        return self._coupled.forces(self._chart.to_joint_axes(y, residual))

    def _all(self, x: Scalars) -> Scalars:
        return self._coupled.positions(x)

    def _rates(self, kept: Scalars) -> Scalars:
        return self._coupled.rates(kept)
