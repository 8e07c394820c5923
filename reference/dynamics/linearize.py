"""Taylor series of the equations, and their linearization about an equilibrium.

See the source's Eq. 3.1 (Taylor series of order n about a point) and Eq. 3.2 (first order).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mpmath as mp
import numpy as np
import sympy as sp

from physics_crosscheck.reference.mechanism.declaration import (
    DeclarationError,
    Equilibrium,
    about,
    t,
)
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.real import shown
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
