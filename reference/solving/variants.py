"""The equations with free constants and extra terms, as hypotheses about a model.

A discrepancy is explained by the parameter that makes the equations reproduce the model's motion.
All parameters enter one numeric function, so that segments with many perturbed parameters are
integrated at once.
"""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
import sympy as sp

from physics_crosscheck.reference.dynamics.derive import Equations, solved
from physics_crosscheck.reference.mechanism.declaration import Coordinate, t
from physics_crosscheck.reference.mechanism.numeric import (
    Array,
    NumericFunction,
    Rows,
    compile_function,
)
from .collocation import collocate, once_per_times
from .segments import Segments

Kind = Literal[
    "constant", "inertia", "damping", "quadratic damping", "friction", "spring", "offset force"
]
"""Kind of a parameter: a constant, or one of the terms of `_extra_terms`."""

FRICTION_SPEED_SHARE = 1e-3
"""Speed below which Coulomb friction is smoothed, relative to the motion's."""


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One parameter whose value may differ from the equations.

    Attributes:
        name: name of the constant, or of the coordinate with the extra term.
        kind: `constant`, or an extra term.
        unit: its unit.
        nominal: its value in the equations; 0 for an extra term.
        size: a significant change: the nominal value, or the value that makes the extra term as
            large as the motion's forces.
    """

    name: str
    kind: Kind
    unit: str
    nominal: float
    size: float


@dataclass(frozen=True)
class Variants:
    """Accelerations a(q, v, u, (t,), p) with the parameters p free; picklable.

    Attributes:
        parameters: in the order of p.
        acceleration: argument groups q, v, u, (t,), p.
    """

    parameters: tuple[Parameter, ...]
    acceleration: NumericFunction

    @property
    def nominal(self) -> Array:
        """Parameters of the declared system, (P,)."""
        return np.array([parameter.nominal for parameter in self.parameters])

    @property
    def sizes(self) -> Array:
        """Significant changes, (P,)."""
        return np.array([parameter.size for parameter in self.parameters])

    def flows(self, points: Array, segments: Segments) -> Array:
        """Return the ends (K, B, 2n) of B segments at each of K parameter points (K, P)."""
        ends = np.empty((len(points), *segments.start.shape))
        for length, rows in segments.by_length():
            ends[:, rows] = self._flow(points, segments, rows, length)
        return ends

    def _flow(self, points: Array, segments: Segments, rows: Rows, length: float) -> Array:
        """Return the ends (K, B, 2n) of segments of one length."""
        count, batch = len(points), len(rows)
        rows, parameters = np.tile(rows, count), np.repeat(points, batch, axis=0)
        n = segments.start.shape[1] // 2
        inputs = once_per_times(
            lambda instants: segments.inputs_within(rows, instants.reshape(len(rows), -1))
        )

        def field(instants: Array, states: Array) -> Array:
            shape = (len(rows),) + (1,) * (states.ndim - 2) + (parameters.shape[1],)
            a = self.acceleration(
                states[..., :n],
                states[..., n:],
                inputs(instants).reshape(*instants.shape, -1),
                instants[..., None],
                parameters.reshape(shape),
            )
            return np.concatenate([states[..., n:], a], axis=-1)

        ends, _ = collocate(field, segments.t[rows], segments.start[rows], length)
        return ends.reshape(count, batch, -1)


def variants(equations: Equations, amplitude: Array) -> Variants:
    """Free every constant, and add typical extra terms to every coordinate.

    Args:
        equations: the derived equations.
        amplitude: size of the system's motions, (2n,); it scales the extra terms.
    """
    system = equations.system
    n = len(system.coordinates)
    parameters = [
        Parameter(
            name=c.name,
            kind="constant",
            unit=c.unit,
            nominal=c.value,
            size=abs(c.value) or 1.0,
        )
        for c in system.constants
    ]
    symbols = [c.symbol for c in system.constants]
    mass = np.array(equations.mass.subs(system.values).subs(_rest(equations)).tolist(), dtype=float)
    added_mass = sp.zeros(n)
    added_force = sp.zeros(n, 1)
    for i, coordinate in enumerate(system.coordinates):
        speed, extent = max(amplitude[n + i], 1e-9), max(amplitude[i], 1e-9)
        inertia = abs(float(mass[i, i])) or 1.0
        for term in _extra_terms(coordinate, inertia, speed=speed, extent=extent):
            symbol = sp.Symbol(f"extra_{term.kind.replace(' ', '_')}_{i}", real=True)
            symbols.append(symbol)
            if term.force is None:
                added_mass[i, i] += symbol
            else:
                added_force[i] -= symbol * term.force
            parameters.append(
                Parameter(
                    name=coordinate.name,
                    kind=term.kind,
                    unit=term.unit,
                    nominal=0.0,
                    size=term.size,
                )
            )
    total = sp.Matrix(equations.mass) + added_mass
    acceleration = solved(total, sp.Matrix(equations.force) + added_force)
    function = compile_function(list(acceleration), system.q, system.v, system.u, (t,), symbols)
    return Variants(tuple(parameters), function)


def _rest(equations: Equations) -> dict[sp.Symbol, int]:
    return dict.fromkeys((*equations.system.q, *equations.system.v, t), 0)


class _Term(NamedTuple):
    """An extra term: -p * force on a coordinate; without a force, p is added to its inertia.

    `size` makes it as large as the motion's forces, in `unit`.
    """

    kind: Kind
    force: sp.Expr | None
    size: float
    unit: str


def _extra_terms(
    coordinate: Coordinate, inertia: float, *, speed: float, extent: float
) -> tuple[_Term, ...]:
    """Return the typical extra terms of a coordinate, one per row.

    Args:
        coordinate: the coordinate.
        inertia: its inertia at rest.
        speed, extent: amplitudes of its velocity and position.
    """
    v, q, force = coordinate.v, coordinate.q, inertia * speed * max(speed / extent, 1e-3)
    turns, per = coordinate.unit == "rad", coordinate.unit
    N, kg = ("N*m", "kg*m^2") if turns else ("N", "kg")
    return (
        _Term("inertia", None, inertia, kg),
        _Term("damping", v, force / speed, f"{N}*s/{per}"),
        _Term("quadratic damping", v * sp.Abs(v), force / speed**2, f"{N}*s^2/{per}^2"),
        _Term("friction", sp.tanh(v / (FRICTION_SPEED_SHARE * speed)), force, N),
        _Term("spring", q, force / extent, f"{N}/{per}"),
        _Term("offset force", sp.Integer(-1), force, N),
    )
