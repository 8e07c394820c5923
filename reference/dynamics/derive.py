"""Equations of motion from the energies: Lagrange's equations with Rayleigh dissipation.

d/dt(dL/dv) - dL/dq + dD/dv = Q(t), L = T - V (the source's Eq. 2.3; Goldstein, Classical
Mechanics, 3rd ed., section 1.5), for any number of coordinates.

Source: Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., section 3.3. Every
operation adds its own rounding to the errors of its operands, weighted by its partial derivatives.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import sympy as sp

from physics_crosscheck.reference.mechanism.declaration import Declaration, t
from physics_crosscheck.reference.mechanism.numeric import Array, NumericFunction, compile_function
from physics_crosscheck.reference.mechanism.system import System
from .equations import EquationsOfMotion

LONG_OPERATIONS = 80
"""Operations above which `simplify` takes seconds per expression, and minutes for an arm."""


def simplify_bounded(expression: sp.Expr) -> sp.Expr:
    """Return an equal expression: simplified if short, unchanged if long.

    A long expression is not expanded either: an arm's nested kinematics are shorter. Expressions
    with floats, such as a position found by a search, count as long earlier, since factoring floats
    may not end.
    """
    has_floats = expression.has(sp.Float)
    if sp.count_ops(expression) > LONG_OPERATIONS // (4 if has_floats else 1):
        return expression
    return sp.simplify(expression) if has_floats else _simplify_exact(expression)


@lru_cache(maxsize=1024)
def _simplify_exact(expression: sp.Expr) -> sp.Expr:
    """Simplify an expression without floats once: modes and scenarios of a system share terms."""
    return sp.simplify(expression)


def solved(matrix: sp.Matrix, right: sp.Matrix) -> sp.Matrix:
    """Return matrix^-1 right for a symmetric n x n matrix and an n x 1 column, by minors.

    sympy's own `det` expands intermediate results, which takes minutes for an arm and rounds worse.
    """
    n = matrix.rows
    minors: dict[tuple[tuple[int, ...], tuple[int, ...]], sp.Expr] = {((), ()): sp.Integer(1)}

    def minor(rows: tuple[int, ...], columns: tuple[int, ...]) -> sp.Expr:
        if (rows, columns) not in minors:
            minors[rows, columns] = sp.Add(
                *(
                    (-1) ** k
                    * matrix[rows[0], column]
                    * minor(rows[1:], columns[:k] + columns[k + 1 :])
                    for k, column in enumerate(columns)
                    if matrix[rows[0], column] != 0
                )
            )
        return minors[rows, columns]

    every = tuple(range(n))

    def without(i: int) -> tuple[int, ...]:
        return every[:i] + every[i + 1 :]

    determinant = minor(every, every)
    return sp.Matrix(
        [
            sp.Add(*((-1) ** (i + j) * minor(without(j), without(i)) * right[j] for j in every))
            / determinant
            for i in every
        ]
    )


UNIT = float(np.finfo(float).eps) / 2
"""Largest relative error of a sum, a product, a quotient or a root."""

LIBRARY = 4 * UNIT
"""Largest relative error of a sine, an exponential or another function in numpy."""

BoundedValue = tuple[Array, Array]
"""A value and its error bound, of one shape."""


def running_error(
    expressions: Sequence[sp.Expr],
    variables: Mapping[sp.Symbol, BoundedValue],
    rounded: bool = True,
) -> Array:
    """Return error bounds of expressions, (..., len(expressions)).

    Args:
        expressions: of the variables alone.
        variables: values and errors, all of one shape (...).
        rounded: whether to include rounding of the operations, besides the variables' errors.
    """
    bounded: dict[sp.Basic, BoundedValue] = dict(variables)
    shape = np.broadcast_shapes(*(np.shape(value) for value, _ in bounded.values()))
    with np.errstate(all="ignore"):
        results = [_walk(sp.sympify(e), bounded, float(rounded))[1] for e in expressions]
    errors = np.empty((*shape, len(results)))
    for i, error in enumerate(results):
        errors[..., i] = error
    return errors


def _walk(
    expression: sp.Expr, bounded: dict[sp.Basic, BoundedValue], rounded: float
) -> BoundedValue:
    if expression in bounded:
        return bounded[expression]
    if not expression.args:
        number = float(expression)
        exact = expression.is_Rational and sp.Rational(number) == expression
        off = 0.0 if exact else 2 * UNIT * abs(number) * rounded
        result = np.asarray(number), np.asarray(off)
    else:
        operands = [_walk(operand, bounded, rounded) for operand in expression.args]
        value, carried, rounding = _operation(expression, operands)
        result = value, carried + rounding * rounded
    bounded[expression] = result
    return result


def _operation(expression: sp.Expr, operands: Sequence[BoundedValue]) -> tuple[Array, Array, Array]:
    """Return the value, the propagated error of the operands, and the operation's own rounding."""
    values = [value for value, _ in operands]
    errors = [error for _, error in operands]
    match expression:
        case sp.Add():
            total = np.asarray(sum(values))
            size = np.asarray(sum(np.abs(value) for value in values))
            return total, np.asarray(sum(errors)), (len(values) - 1) * UNIT * size
        case sp.Mul():
            product = np.asarray(np.prod(np.broadcast_arrays(*values), axis=0))
            others = [
                np.prod(np.broadcast_arrays(1.0, *values[:i], *values[i + 1 :]), axis=0)
                for i in range(len(values))
            ]
            carried = sum(np.abs(o) * e for o, e in zip(others, errors, strict=True))
            return product, np.asarray(carried), (len(values) - 1) * UNIT * np.abs(product)
        case sp.Pow() if expression.exp.is_Rational:
            power = float(expression.exp)
            raised = np.power(values[0], power)
            slope = np.abs(power * np.power(values[0], power - 1))
            return raised, slope * errors[0], LIBRARY * np.abs(raised)
    return _function(expression, values, errors)


@lru_cache(maxsize=64)
def _with_slopes(function: type[sp.Expr], count: int) -> Callable[..., Sequence[Array]]:
    """Return a function of `count` operands with its partial derivatives."""
    places = sp.symbols(f"x:{count}")
    form = function(*places)
    compiled: Callable[..., Sequence[Array]] = sp.lambdify(
        places, [form, *(sp.diff(form, x) for x in places)], "numpy"
    )
    return compiled


def _function(
    expression: sp.Expr, values: Sequence[Array], errors: Sequence[Array]
) -> tuple[Array, Array, Array]:
    compiled = _with_slopes(expression.func, len(values))
    value, *slopes = (np.asarray(array) for array in compiled(*values))
    # An exact operand adds no error, even where its derivative has no value.
    carried = sum(np.where(e > 0, np.abs(s) * e, 0.0) for s, e in zip(slopes, errors, strict=True))
    return value, np.asarray(carried), LIBRARY * np.abs(value)


LONG_FORCE_OPERATIONS = 1000
"""Operations in the forces above which symbolic derivatives are too slow."""


@dataclass(frozen=True)
class Equations(EquationsOfMotion):
    """M(q) a = f(q, v, u, t), symbolic, with numeric functions made from it.

    Attributes:
        mass: n x n mass matrix M, symmetric.
        force: n x 1 right-hand side f, the inputs included.
        energy: T + V, joules.
        dissipated: power v . dD/dv that the dampers take, watts.
        supplied: power v . Q that the inputs give, watts.
    """

    system: System
    mass: sp.ImmutableMatrix
    force: sp.ImmutableMatrix
    energy: sp.Expr
    dissipated: sp.Expr
    supplied: sp.Expr

    @cached_property
    def residual(self) -> sp.ImmutableMatrix:
        """M a - f: zero along every motion; row i is the equation of coordinate i."""
        return sp.ImmutableMatrix(self.mass * sp.Matrix(self.system.a) - self.force)

    @cached_property
    def acceleration(self) -> sp.ImmutableMatrix:
        """a = M^-1 f, symbolic."""
        return sp.ImmutableMatrix(solved(self.mass, self.force))

    @cached_property
    def first_order(self) -> sp.ImmutableMatrix:
        """dy/dt of the state y = (q, v): the first-order form, 2n x 1."""
        return sp.ImmutableMatrix([*self.system.v, *self.acceleration])

    @cached_property
    def energy_balance(self) -> sp.Expr:
        """dE/dt - supplied + dissipated along the motion: zero, unless T or V depend on t."""
        system = self.system
        rate = sp.diff(self.energy, t) - self.supplied + self.dissipated
        for q, v, a, residual in zip(system.q, system.v, system.a, self.residual, strict=True):
            # The residual is zero along the motion; v times it eliminates the accelerations.
            rate += sp.diff(self.energy, q) * v + sp.diff(self.energy, v) * a - v * residual
        balance = sp.simplify(sp.expand(rate))
        if balance.free_symbols & {*system.a}:
            balance = sp.simplify(
                balance.xreplace(dict(zip(system.a, self.acceleration, strict=True)))
            )
        return balance

    @cached_property
    def linear(self) -> bool:
        """True if M is constant and f linear in q, v, u, homogeneous and time-invariant."""
        variables = (*self.system.q, *self.system.v, *self.system.u)
        if self.mass.free_symbols & {*variables, t}:
            return False
        slopes = sp.Matrix(self.force).jacobian(variables)
        rest = dict.fromkeys(variables, sp.Integer(0))
        still = all(sp.simplify(f.xreplace(rest)) == 0 for f in self.force)
        return still and not slopes.free_symbols & {*variables, t}

    @cached_property
    def numeric_acceleration(self) -> NumericFunction:
        """a(q, v, u, t) with constants substituted; the argument groups are q, v, u, (t,)."""
        return self.compile(self.acceleration)

    @cached_property
    def numeric_power(self) -> NumericFunction:
        """(energy, supplied, dissipated) of (q, v, u, (t,))."""
        return self.compile([self.energy, self.supplied, self.dissipated])

    @cached_property
    def numeric_mass(self) -> NumericFunction:
        """M of (q, v, u, (t,)), in row-major order."""
        return self.compile(list(self.mass))

    @cached_property
    def numeric_force(self) -> NumericFunction:
        """f of (q, v, u, (t,))."""
        return self.compile(self.force)

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
        return running_error(list(self.acceleration), variables, rounded=rounded)

    def slopes(self, states: Array, inputs: Array, times: Array) -> Array:
        """Return the slopes by M da = df - dM a, since derivatives of M^-1 f are long formulas."""
        if self.long:
            return super().slopes(states, inputs, times)
        return slopes_by(self._derivatives, states, inputs, times)

    @cached_property
    def long(self) -> bool:
        """True if symbolic derivatives of the forces are too slow."""
        return bool(sum(sp.count_ops(f) for f in self.force) > LONG_FORCE_OPERATIONS)

    @cached_property
    def _derivatives(self) -> NumericFunction:
        return self.compile(self.derivatives)

    @property
    def derivatives(self) -> list[sp.Expr]:
        """M, f, and their derivatives by q and v."""
        variables, n = (*self.system.q, *self.system.v), len(self.system.q)
        mass, force = sp.Matrix(self.mass), sp.Matrix(self.force)
        slopes = mass.reshape(n * n, 1).jacobian(variables)
        return [*mass, *force, *force.jacobian(variables), *slopes]

    def compile(self, expressions: sp.ImmutableMatrix | list[sp.Expr]) -> NumericFunction:
        """Return expressions of q, v, u, t as a numeric function, with constants as doubles."""
        values = {symbol: sp.Float(value, 17) for symbol, value in self.system.values.items()}
        put_in = [sp.sympify(e).xreplace(values) for e in expressions]
        return compile_function(put_in, self.system.q, self.system.v, self.system.u, (t,))


def bounded_symbols(
    system: Declaration,
    states: Array,
    inputs: Array,
    times: Array,
    *,
    off: Array,
    time_error: Array,
) -> dict[sp.Symbol, BoundedValue]:
    """Return value and error of every symbol of the equations; see `acceleration_error`."""
    none = np.zeros_like(times)
    variables = {t: (times, time_error)}
    variables |= {c.symbol: (np.full_like(times, c.value), none) for c in system.constants}
    variables |= {s: (states[..., i], none) for i, s in enumerate((*system.q, *system.v))}
    variables |= {s: (inputs[..., i], off[..., i]) for i, s in enumerate(system.u)}
    return variables


def slopes_by(derivatives: NumericFunction, states: Array, inputs: Array, times: Array) -> Array:
    """Return the accelerations' derivatives, (B, n, 2n), by compiled `Equations.derivatives`."""
    n = states.shape[1] // 2
    values = derivatives(states[:, :n], states[:, n:], inputs, times[:, None])
    parts = np.split(values, np.cumsum([n * n, n, 2 * n * n]), axis=1)
    m = parts[0].reshape(-1, n, n)
    try:
        a = np.linalg.solve(m, parts[1][:, :, None])[:, :, 0]
        turning = np.einsum("bijx,bj->bix", parts[3].reshape(-1, n, n, 2 * n), a)
        slopes: Array = np.linalg.solve(m, parts[2].reshape(-1, n, 2 * n) - turning)
    except np.linalg.LinAlgError:
        return np.full((len(states), n, 2 * n), np.inf)
    return slopes


def _spread(force: sp.Expr) -> sp.Expr:
    """Expand a short force into readable terms."""
    return force if sp.count_ops(force) > LONG_OPERATIONS else sp.expand(force)


def derive(system: System) -> Equations:
    """Return the equations of motion of a system."""
    mass, force = _mass_and_force(system.T, system.V, system.D, system.q, system.v)
    return Equations(
        system=system,
        mass=mass,
        force=sp.ImmutableMatrix([f + g for f, g in zip(force, system.forces(), strict=True)]),
        energy=system.T + system.V,
        dissipated=sp.Add(*(vi * sp.diff(system.D, vi) for vi in system.v)),
        supplied=sp.Add(*(vi * qi for vi, qi in zip(system.v, system.forces(), strict=True))),
    )


@lru_cache(maxsize=16)  # audits of several models use the same system in one process
def _mass_and_force(
    kinetic: sp.Expr,
    potential: sp.Expr,
    dissipation: sp.Expr,
    q: tuple[sp.Symbol, ...],
    v: tuple[sp.Symbol, ...],
) -> tuple[sp.ImmutableMatrix, tuple[sp.Expr, ...]]:
    """Return M, (n, n), and M a without the inputs, (n,)."""
    lagrangian = kinetic - potential
    momenta = [sp.diff(lagrangian, vi) for vi in v]
    mass = sp.hessian(kinetic, v).applyfunc(simplify_bounded)
    force = []
    for qi, vi, pi in zip(q, v, momenta, strict=True):
        # d/dt p(q, v, t) = M a + (dp/dq) v + dp/dt; all but M a moves to the right side.
        transport = sp.Add(*(sp.diff(pi, qj) * vj for qj, vj in zip(q, v, strict=True)))
        transport += sp.diff(pi, t)
        rest = sp.diff(lagrangian, qi) - sp.diff(dissipation, vi) - transport
        force.append(_spread(simplify_bounded(rest)))
    return sp.ImmutableMatrix(mass), tuple(force)
