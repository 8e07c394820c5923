"""Natural frequencies, damping ratios, mode shapes and transfer functions of a linearization."""

from __future__ import annotations

from dataclasses import dataclass

import mpmath as mp
import numpy as np
import sympy as sp
from numpy.typing import NDArray

from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.system import System
from .derive import LONG_OPERATIONS
from .linearize import DIGITS, TaylorLinearization, to_array

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
