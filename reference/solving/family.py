"""A system's equations with its constants as arguments, derived and compiled once.

A motion at other constants needs no derivation or compilation: `Family.with_constants` substitutes
numbers. `solving.solve` finds its motions by multiple shooting.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import sympy as sp

from physics_crosscheck.reference.dynamics.derive import Equations, bounded_symbols, slopes_by
from physics_crosscheck.reference.dynamics.equations import EquationsOfMotion
from physics_crosscheck.reference.dynamics.roundoff import running_error
from physics_crosscheck.reference.mechanism.declaration import Declaration, Scenario, t
from physics_crosscheck.reference.mechanism.numeric import Array, NumericFunction, compile_function
from physics_crosscheck.reference.mechanism.signal import SignalPiece, pieces


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
