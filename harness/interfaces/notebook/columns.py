"""Columns of a trajectory: states, outputs and energy of a mechanism."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import sympy as sp

from physics_crosscheck.reference.dynamics.derive import running_error
from physics_crosscheck.reference.dynamics.tree_equations import (
    ROUNDING_MARGIN,
    Charted,
    TreeEquations,
)
from physics_crosscheck.reference.mechanism.assemble import TreeSystem
from physics_crosscheck.reference.mechanism.declaration import Declaration, t
from physics_crosscheck.reference.mechanism.numeric import Array, compile_function
from physics_crosscheck.reference.mechanism.rotations import DOUBLES, LONG_DOUBLES
from physics_crosscheck.reference.mechanism.system import System
from .trajectory import units_of_rates

ENERGY = "energy"


@dataclass(frozen=True)
class Columns:
    """The k columns of a mechanism: coordinates, rates, outputs with other names, T + V.

    A mechanism has n coordinates.
    """

    declaration: System | TreeSystem

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns, (k,)."""
        return (*self._components, *(name for name, _, _ in self._besides), *self._energy)

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the columns, (k,)."""
        coordinate_units = [c.unit for c in self.declaration.coordinates]
        besides = (unit for _, unit, _ in self._besides)
        return (
            *coordinate_units,
            *units_of_rates(coordinate_units),
            *besides,
            *("J" for _ in self._energy),
        )

    def values(self, times: Array, states: Array) -> Array:
        """Return the columns, (S, k), at times (S,) and states (S, 2n)."""
        with np.errstate(all="ignore"):  # a diverged motion keeps inf and nan
            if isinstance(self.declaration, TreeSystem):
                return np.concatenate([states, self._tree_energy(states)], axis=1)
            n = states.shape[1] // 2
            more = compile_function(
                [e.xreplace(self._constants) for e in self._expressions],
                self.declaration.q,
                self.declaration.v,
                (t,),
            )(states[:, :n], states[:, n:], times[:, None])
        return np.concatenate([states, more], axis=1)

    def bounds(self, times: Array, states: Array, bound: Array) -> Array:
        """Return error bounds of the columns, (S, k), from error bounds of the states, (S, 2n).

        The bounds are first-order, plus rounding.
        """
        if isinstance(self.declaration, TreeSystem):
            return np.concatenate([bound, self._tree_energy_error(states, bound)], axis=1)
        exact = np.zeros_like(times)
        rounded = {t: (times, exact)}
        rounded |= {
            c.symbol: (np.full_like(times, c.value), exact) for c in self.declaration.constants
        }
        symbols = (*self.declaration.q, *self.declaration.v)
        rounded |= {s: (states[:, i], bound[:, i]) for i, s in enumerate(symbols)}
        return np.concatenate([bound, running_error(self._expressions, rounded)], axis=1)

    @property
    def _components(self) -> tuple[str, ...]:
        names = [c.name for c in self.declaration.coordinates]
        return (*names, *(f"{name}_dot" for name in names))

    @cached_property
    def _besides(self) -> tuple[tuple[str, str, sp.Expr], ...]:
        """Name, unit and expression of each output that is not a component."""
        return tuple(self._outputs(self.declaration))

    def _outputs(self, declaration: Declaration) -> Iterator[tuple[str, str, sp.Expr]]:
        symbols = (*declaration.q, *declaration.v)
        components = dict(zip(self._components, symbols, strict=True))
        for output in declaration.outputs:
            if components.get(output.name) != output.expression:
                name = f"output {output.name}" if output.name in components else output.name
                yield name, output.unit, sp.sympify(output.expression)

    @property
    def _energy(self) -> tuple[str, ...]:
        """Header of the energy column; empty if an output has this name."""
        return (ENERGY if ENERGY not in {name for name, _, _ in self._besides} else "T + V",)

    @property
    def _expressions(self) -> list[sp.Expr]:
        return [*(e for _, _, e in self._besides), self.declaration.T + self.declaration.V]

    @property
    def _constants(self) -> dict[sp.Symbol, sp.Float]:
        return {s: sp.Float(value, 17) for s, value in self.declaration.values.items()}

    def _tree_energy(self, states: Array) -> Array:
        assert isinstance(self.declaration, TreeSystem)
        n, count = states.shape[1] // 2, len(states)
        power = TreeEquations(self.declaration).numeric_power
        none = np.zeros((count, 0))
        return power(states[:, :n], states[:, n:], none, np.zeros((count, 1)))[:, :1]

    def _tree_energy_error(self, states: Array, bound: Array) -> Array:
        """Return first-order error bounds of the energy by differences, plus rounding: (S, 1)."""
        assert isinstance(self.declaration, TreeSystem)
        step = 1e-6 * np.maximum(np.max(np.abs(states), axis=0), 1e-3)
        total = np.zeros((len(states), 1))
        for i, h in enumerate(step):
            moved = h * np.eye(states.shape[1])[i]
            up, down = (self._tree_energy(states + by) for by in (moved, -moved))
            total += np.abs(up - down) / (2 * h) * bound[:, i : i + 1]
        bound_of_energy: Array = total + ROUNDING_MARGIN * self._tree_energy_rounding(states)
        return bound_of_energy

    def _tree_energy_rounding(self, states: Array) -> float:
        """Return the largest difference to long doubles in the energies, plus a last digit."""
        assert isinstance(self.declaration, TreeSystem)
        n = states.shape[1] // 2
        q, v = (part.T for part in (states[:, :n], states[:, n:]))
        energies = [
            Charted(self.declaration.tree, kind).powers(*map(kind.array, (q, v, 0 * v)))[0]
            for kind in (DOUBLES, LONG_DOUBLES)
        ]
        apart = np.max(np.abs(energies[0] - energies[1]))
        return float(apart + np.finfo(float).eps * np.max(np.abs(energies[0])))
