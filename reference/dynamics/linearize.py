"""Taylor series of the equations, and their linearization about an equilibrium.

See the source's Eq. 3.1 (Taylor series of order n about a point) and Eq. 3.2 (first order).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mpmath as mp
import numpy as np
import sympy as sp
from numpy.typing import NDArray

from physics_crosscheck.reference.mechanism.declaration import (
    DeclarationError,
    Equilibrium,
    about,
    t,
)
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.real import shown
from physics_crosscheck.reference.mechanism.system import System
from .derive import LONG_OPERATIONS, Equations, simplify_bounded

DIGITS = 60
"""Working precision of the linear algebra; a defective eigenvalue keeps half of the digits."""


@dataclass(frozen=True, kw_only=True)
class TaylorLinearization:
    """M a + C v + K q = F u about an equilibrium, also as y' = A y + B u, z = Cy y + D u.

    q, v, z are deviations from the equilibrium; y = (q, v). The symbolic matrices keep the
    constants' symbols. The arrays have the constants substituted, correctly rounded.
    """

    equilibrium: str
    symbolic_position: tuple[sp.Expr, ...]
    position: Array
    mass: sp.ImmutableMatrix
    damping: sp.ImmutableMatrix
    stiffness: sp.ImmutableMatrix
    input: sp.ImmutableMatrix
    output: sp.ImmutableMatrix
    feedthrough: sp.ImmutableMatrix
    exact: Mapping[str, mp.matrix]

    @property
    def arrays(self) -> dict[str, Array]:
        """M, C, K, F, A, B, Cy, D as double arrays."""
        return {name: to_array(matrix) for name, matrix in self.exact.items()}


def linearize(equations: Equations, equilibrium: Equilibrium) -> TaylorLinearization:
    """Return the equations linearized about an equilibrium, which is checked or searched for.

    Raises:
        DeclarationError: if a declared position is not an equilibrium, or a search fails.
    """
    with about("Equilibrium", equilibrium.name):
        return _linearized(equations, equilibrium)


def _linearized(equations: Equations, equilibrium: Equilibrium) -> TaylorLinearization:
    system = equations.system
    symbolic_position = _position(equations, equilibrium)
    still = dict.fromkeys((*system.v, *system.u), sp.Integer(0))
    rest = dict(zip(system.q, symbolic_position, strict=True)) | still

    def evaluate(matrix: sp.Matrix) -> sp.ImmutableMatrix:
        return sp.ImmutableMatrix(matrix.xreplace(rest).applyfunc(simplify_bounded))

    force = sp.Matrix(equations.force)
    outputs = sp.Matrix([sp.sympify(o.expression) for o in system.outputs])
    mass = evaluate(sp.Matrix(equations.mass))
    damping = evaluate(-force.jacobian(system.v))
    stiffness = evaluate(-force.jacobian(system.q))
    pushes = (
        evaluate(force.jacobian(system.u))
        if system.u
        else sp.ImmutableMatrix.zeros(len(symbolic_position), 0)
    )
    seen = evaluate(outputs.jacobian((*system.q, *system.v)))
    through = (
        evaluate(outputs.jacobian(system.u))
        if system.u
        else sp.ImmutableMatrix.zeros(len(outputs), 0)
    )
    where = f"system {system.name!r}, equilibrium {equilibrium.name!r}"
    every = mass, damping, stiffness, pushes, seen, through
    for changing in (entry for matrix in every for entry in matrix if entry.has(t)):
        raise DeclarationError(
            f"{where}: the equations linearized about it depend on t, by "
            f"{shown(changing)}; energies and outputs must not depend on time; use "
            "an input"
        )
    with mp.workdps(DIGITS):
        values = system.values
        m, c, k, f, cy, d = (_numbers(matrix, values, where) for matrix in every)
        try:
            inverse = m**-1
        except ZeroDivisionError:
            raise DeclarationError(
                f"{where}: the mass matrix is singular there; choose a position at "
                "which every coordinate has an inertia, or correct T"
            ) from None
        n, inputs = len(symbolic_position), f.cols
        a = mp.zeros(2 * n)
        b = mp.zeros(2 * n, inputs) if inputs else mp.matrix(2 * n, 0)
        lower_k, lower_c = -inverse * k, -inverse * c
        lower_f = inverse * f if inputs else f
        for i in range(n):
            a[i, n + i] = mp.mpf(1)
            for j in range(n):
                a[n + i, j], a[n + i, n + j] = lower_k[i, j], lower_c[i, j]
            for j in range(inputs):
                b[n + i, j] = lower_f[i, j]
        position = np.array([float(sp.N(p.subs(values), 30)) for p in symbolic_position])
    return TaylorLinearization(
        equilibrium=equilibrium.name,
        symbolic_position=symbolic_position,
        position=position,
        mass=mass,
        damping=damping,
        stiffness=stiffness,
        input=pushes,
        output=seen,
        feedthrough=through,
        exact={"M": m, "C": c, "K": k, "F": f, "A": a, "B": b, "Cy": cy, "D": d},
    )


def _position(equations: Equations, equilibrium: Equilibrium) -> tuple[sp.Expr, ...]:
    system = equations.system
    where = f"system {system.name!r}, equilibrium {equilibrium.name!r}"
    still = dict.fromkeys((*system.v, *system.u, t), sp.Integer(0))
    forces = [f.xreplace(still) for f in equations.force]
    declared = tuple(sp.sympify(equilibrium.at[c]) for c in system.coordinates)
    values = system.values
    if not equilibrium.search:
        place = dict(zip(system.q, declared, strict=True))
        for coordinate, expression in zip(system.coordinates, forces, strict=True):
            force = expression.xreplace(place)
            # Check the number first: it is fast and usually decides.
            number = sp.N(force.xreplace(values), 30)
            if not (number.is_real and number.is_finite):
                raise DeclarationError(
                    f"{where}: the force on {coordinate.name} there is "
                    f"{shown(force)}, which is not a finite real number; choose "
                    "another position, or correct V"
                )
            if abs(number) > 1e-12 and (force := sp.simplify(force)) != 0:
                raise DeclarationError(
                    f"{where}: is not an equilibrium: the force on "
                    f"{coordinate.name} there is {force}; give the exact position, "
                    "or set search=True"
                )
        return declared
    forces = [p for p in forces if p != 0]
    # A coordinate without any force, such as a cart's on a level rail, keeps its position.
    held = {q for q in system.q if not any(p.has(q) for p in forces)}
    free = [q for q in system.q if q not in held]
    stays = {q: p for q, p in zip(system.q, declared, strict=True) if q in held}
    if len(forces) != len(free):
        raise DeclarationError(f"{where}: no rest position found near {declared}")
    if not free:
        return declared
    with mp.workdps(DIGITS):
        residual = sp.lambdify(free, [p.xreplace(values) for p in forces], "mpmath", cse=True)
        guess = [
            mp.mpf(sp.N(p.subs(values), 30))
            for q, p in zip(system.q, declared, strict=True)
            if q in free
        ]
        try:
            solution = mp.findroot(lambda *q: residual(*q), guess, tol=mp.mpf(10) ** (-80))
        except (ValueError, ZeroDivisionError):
            raise DeclarationError(f"{where}: no rest position found near {declared}") from None
        roots = [solution] if isinstance(solution, mp.mpf) else list(solution)
        moved = dict(zip(free, map(_recognized, roots), strict=True))
    return tuple(stays[q] if q in held else moved[q] for q in system.q)


def _numbers(matrix: sp.Matrix, values: Mapping[sp.Symbol, sp.Rational], where: str) -> mp.matrix:
    """Return a matrix with the constants substituted, at mpmath's working precision.

    Raises:
        DeclarationError: if an entry is not a finite real number.
    """
    try:
        if sum(sp.count_ops(entry) for entry in matrix) <= LONG_OPERATIONS:
            result = to_mp(matrix.subs(values))
        else:
            # Substitution one by one would take minutes.
            function = sp.lambdify(list(values), sp.Matrix(matrix), modules="mpmath", cse=True)
            result = function(*(mp.mpf(v.p) / v.q for v in values.values()))
        finite = all(isinstance(entry, mp.mpf) and mp.isfinite(entry) for entry in result)
    except (TypeError, ValueError, ZeroDivisionError):
        finite = False
    if not finite:
        raise DeclarationError(
            f"{where}: T, V, D or an output has a slope there that is not a finite "
            "real number; choose another position, or correct it"
        )
    return result


def _recognized(root: mp.mpf) -> sp.Expr:
    """Return 0 or a multiple of pi/2 where the root is that to 40 digits, else the root."""
    halves = mp.nint(2 * root / mp.pi)
    if abs(root - halves * mp.pi / 2) < mp.mpf(10) ** -40:
        return sp.pi * sp.Rational(int(halves), 2)
    return sp.Float(mp.nstr(root, 40), 40)


def taylor(expression: sp.Expr, point: Mapping[sp.Symbol, sp.Expr], order: int) -> sp.Expr:
    """Return the Taylor polynomial of given order about a point, in any number of variables.

    See the source's Eq. 3.1.
    """
    step = sp.Dummy("step")
    moved = expression.subs(
        {symbol: at + step * (symbol - at) for symbol, at in point.items()}, simultaneous=True
    )
    summands = [sp.diff(moved, step, i).subs(step, 0) / sp.factorial(i) for i in range(order + 1)]
    return sp.Add(*summands)


def classify(inputs: int, outputs: int) -> str:
    """Return SISO, SIMO, MISO or MIMO (the source's Fig. 2.8 and 2.9), or 'autonomous'."""
    if inputs == 0:
        return "autonomous"
    return f"{'S' if inputs == 1 else 'M'}I{'S' if outputs == 1 else 'M'}O"


def to_mp(matrix: sp.Matrix) -> mp.matrix:
    """Return a numeric sympy matrix at mpmath's working precision."""
    if not matrix.rows or not matrix.cols:
        return mp.matrix(matrix.rows, matrix.cols)
    rows: Sequence[Sequence[sp.Expr]] = matrix.tolist()
    return mp.matrix([[mp.mpf(sp.N(e, mp.mp.dps)) for e in row] for row in rows])


def to_array(matrix: mp.matrix) -> Array:
    """Return an mpmath matrix rounded to doubles."""
    out = np.zeros((matrix.rows, matrix.cols))
    for i in range(matrix.rows):
        for j in range(matrix.cols):
            out[i, j] = float(matrix[i, j])
    return out


s = sp.Symbol("s")
"""The Laplace variable of transfer functions."""


@dataclass(frozen=True, kw_only=True)
class Eigenvalue:
    """An eigenvalue of A.

    Attributes:
        value: eigenvalue, 1/s; for a complex pair, the one with positive imaginary part.
        multiplicity: number of occurrences (pairs counted once).
        frequency: |value|, rad/s; 0 for a rigid-body mode.
        damping: -Re(value)/|value|; nan if the frequency is 0.
    """

    value: complex
    multiplicity: int
    frequency: float
    damping: float


@dataclass(frozen=True, kw_only=True)
class UndampedMode:
    """A mode of M a + K q = 0: frequency (rad/s) and shape with largest entry 1.

    The frequency of a rigid-body mode is 0. A negative stiffness (an upright pendulum) has a growth
    rate, in 1/s, instead of a frequency.
    """

    frequency: float
    growth: float
    shape: Array

    @property
    def rigid(self) -> bool:
        """True for a rigid-body mode, which has neither frequency nor growth."""
        return self.frequency == 0 and self.growth == 0


def poles(linearization: TaylorLinearization) -> tuple[Eigenvalue, ...]:
    """Return the eigenvalues of A, slowest first.

    They are computed with 60 digits. A defective double root (a rigid-body mode, critical damping)
    then yields equal roots instead of a pair split by the square root of epsilon.
    """
    with mp.workdps(DIGITS):
        eigenvalues, _ = mp.eig(linearization.exact["A"], left=False, right=True)
        scale = max((abs(value) for value in eigenvalues), default=mp.mpf(1)) or mp.mpf(1)
        small = scale * mp.mpf(10) ** (-DIGITS // 4)
        groups: list[list[mp.mpc]] = []
        for value in eigenvalues:
            for group in groups:
                if abs(group[0] - value) < small:
                    group.append(value)
                    break
            else:
                groups.append([value])
        result = []
        for group in groups:
            mean = sum(group) / len(group)
            re = 0.0 if abs(mp.re(mean)) < small else float(mp.re(mean))
            im = 0.0 if abs(mp.im(mean)) < small else float(mp.im(mean))
            if im < 0:
                continue
            size = 0.0 if re == 0 and im == 0 else float(abs(mean))
            damping = 0.0 - re / size if size else float("nan")
            result.append(
                Eigenvalue(
                    value=complex(re, im), multiplicity=len(group), frequency=size, damping=damping
                )
            )
    return tuple(sorted(result, key=lambda p: (p.frequency, p.value.real)))


def modes(linearization: TaylorLinearization) -> tuple[UndampedMode, ...]:
    """Return undamped modes from the symmetric pencil (K, M), slowest first.

    Shapes of repeated roots are M-orthogonal (LAPACK dsygvd). A mode whose stiffness is zero, to
    rounding, is a rigid-body mode.
    """
    m, k = to_array(linearization.exact["M"]), to_array(linearization.exact["K"])
    from scipy.linalg import eigh  # slow import, not needed by every command

    values, shapes = eigh((k + k.T) / 2, m)
    scale = float(np.max(np.abs(values))) or 1.0
    result = []
    for value, shape in zip(values, shapes.T, strict=True):
        squared = 0.0 if abs(value) < 1e-12 * scale else float(value)
        largest = shape[np.argmax(np.abs(shape))]
        result.append(
            UndampedMode(
                frequency=np.sqrt(max(squared, 0.0)),
                growth=np.sqrt(max(-squared, 0.0)),
                shape=shape / largest,
            )
        )
    return tuple(sorted(result, key=lambda mode: (mode.frequency, mode.growth)))


def damped_shapes(
    linearization: TaylorLinearization,
) -> list[tuple[complex, NDArray[np.complex128]]]:
    """Return complex shapes of the damped modes as (eigenvalue, q part of its vector).

    The largest entry of each shape is 1.
    """
    # Use the poles, which are exact to a double. The double zero of a rigid-body mode would split
    # into an oscillating pair if A were analyzed in doubles.
    m, c, k = (to_array(linearization.exact[name]) for name in ("M", "C", "K"))
    result = []
    for pole in poles(linearization):
        if pole.value.imag > 0:
            matrices = (m * pole.value**2, c * pole.value, k)
            _, sizes, rows = np.linalg.svd(sum(matrices))
            largest = max(float(np.max(np.abs(term))) for term in matrices)
            for size, row in zip(sizes, rows.conj(), strict=True):
                if size < 1e-10 * largest:
                    result.append((pole.value, row / row[np.argmax(np.abs(row))]))
    return result


def transfer_functions(linearization: TaylorLinearization) -> sp.ImmutableMatrix:
    """Return outputs over inputs, symbolic in `s` and the constants: Cy (s I - A)^-1 B + D.

    They are computed from M s^2 + C s + K, whose inverse is half the size.
    """
    n = linearization.mass.rows
    dynamic = sp.Matrix(
        linearization.mass * s**2 + linearization.damping * s + linearization.stiffness
    )
    if sum(sp.count_ops(entry) for entry in dynamic) > LONG_OPERATIONS:
        return _numeric_transfer_functions(linearization)
    adjugate, determinant = dynamic.adjugate(), dynamic.det()
    response = adjugate * linearization.input
    seen = linearization.output[:, :n] + s * linearization.output[:, n:]
    numerator = seen * response + linearization.feedthrough * determinant
    return sp.ImmutableMatrix(
        numerator.applyfunc(lambda e: sp.cancel(sp.expand(e) / sp.expand(determinant)))
    )


def _numeric_transfer_functions(linearization: TaylorLinearization) -> sp.ImmutableMatrix:
    """Return transfer functions with numeric constants, since symbolic ones would fill pages."""
    m, c, k, f, cy, d = (
        sp.Matrix(rows.rows, rows.cols, lambda i, j, rows=rows: sp.Float(rows[i, j], DIGITS))
        for rows in (linearization.exact[name] for name in ("M", "C", "K", "F", "Cy", "D"))
    )
    n = m.rows
    dynamic = (m * s**2 + c * s + k).applyfunc(sp.expand)
    determinant = sp.expand(dynamic.det(method="berkowitz"))
    seen = cy[:, :n] + s * cy[:, n:]
    numerator = (seen * dynamic.adjugate(method="berkowitz") * f).applyfunc(sp.expand)
    numerator += d * determinant
    lead = sp.Poly(determinant, s).LC()
    return sp.ImmutableMatrix(
        numerator.applyfunc(
            lambda e: _shown(sp.expand(e / lead)) / _shown(sp.expand(determinant / lead))
        )
    )


def _shown(polynomial: sp.Expr) -> sp.Expr:
    """Round coefficients to fifteen digits, and set those that are only rounding to zero."""
    coefficients = sp.Poly(polynomial, s).all_coeffs()
    size = max((abs(c) for c in coefficients), default=sp.Integer(0))
    kept = [
        sp.N(c, 15) if abs(c) > size * sp.Float(10) ** -40 else sp.Integer(0) for c in coefficients
    ]
    return sp.Add(*(c * s**p for p, c in enumerate(reversed(kept))))


def evaluate_transfer(
    system: System, functions: sp.ImmutableMatrix, frequencies: Array
) -> NDArray[np.complex128]:
    """Return the transfer functions at s = j w, (len(frequencies), outputs, inputs)."""
    numeric = sp.lambdify(s, functions.subs(system.values).evalf(20), modules="numpy")
    return np.array([numeric(1j * w) for w in frequencies], dtype=np.complex128)
