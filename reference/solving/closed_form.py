"""Closed-form solution of linear systems by the matrix exponential, with extra digits.

If a linear equation generates the inputs, the generator's state is appended to the system's (Van
Loan 1978). A segment is then one product with exp(A H).
"""

from __future__ import annotations

from collections.abc import Sequence

import mpmath as mp
import numpy as np
from mpmath.libmp import to_fixed
from numpy.typing import NDArray

from physics_crosscheck.reference.dynamics.linearize import TaylorLinearization
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.signal import (
    DIGITS,
    Generator,
    SignalPiece,
    numeric_inputs,
)
from .segments import Motion, Span, chebyshev_nodes


def augmented(linearization: TaylorLinearization, generators: Sequence[Generator]) -> mp.matrix:
    """Return [[A, B e], [0, S]]: the system with the generators of its inputs appended."""
    a, b = linearization.exact["A"], linearization.exact["B"]
    size = a.rows + sum(g.matrix.rows for g in generators)
    matrix = mp.zeros(size)
    for i in range(a.rows):
        for j in range(a.cols):
            matrix[i, j] = a[i, j]
    place = a.rows
    for column, generator in enumerate(generators):
        for i in range(a.rows):
            matrix[i, place] = b[i, column]
        block = generator.matrix
        for i in range(block.rows):
            for j in range(block.cols):
                matrix[place + i, place + j] = block[i, j]
        place += block.rows
    return matrix


def solve_closed_form(
    linearization: TaylorLinearization,
    start: Array,
    signals: Sequence[SignalPiece],
    spans: tuple[Span, ...],
) -> Motion:
    """Solve all segments of a linear system.

    Each span is stepped with `DIGITS` digits from its first state. A segment starts from that state
    rounded to doubles; the rounding is propagated to the segment's end through exp(A H).
    """
    size = len(start)
    origin = np.concatenate([linearization.position, np.zeros(size // 2)])
    starts, ends, nodes = [], [], []
    with mp.workdps(DIGITS):
        state = [mp.mpf(y) - mp.mpf(o) for y, o in zip(start, origin, strict=True)]
        for span, signal in zip(spans, signals, strict=True):
            generators = signal.generators
            assert generators is not None  # checked by the caller
            matrix = augmented(linearization, generators)
            full = list(state)
            for generator in generators:
                full += generator.state(span.start)
            shares = (*map(mp.mpf, chebyshev_nodes()), mp.mpf(1))
            *inner, rows = exponentials(matrix * mp.mpf(span.length), shares)
            exact = [full]
            for _ in range(span.count):
                exact.append([mp.fdot(row, exact[-1]) for row in rows])
            rounded = np.array([[float(y) for y in s] for s in exact])
            lost = np.array([[float(y - mp.mpf(float(y))) for y in s[:size]] for s in exact])
            forward = np.array([[float(v) for v in row[:size]] for row in rows[:size]])
            starts.append(rounded[:-1, :size])
            # A segment starts `lost` below the exact state, so it also ends below it.
            ends.append(rounded[1:, :size] + (lost[1:] - lost[:-1] @ forward.T))
            within = [rounded[:-1] @ np.array(step, dtype=np.float64).T for step in inner]
            nodes.append(np.stack(within, axis=1)[:, :, :size])
            nodes[-1][:, -1] = rounded[1:, :size]
            state = exact[-1][:size]
    end = np.concatenate(ends)
    return Motion.join(
        spans,
        numeric_inputs(signals),
        start=np.concatenate(starts) + origin,
        end=end + origin,
        nodes=np.concatenate(nodes) + origin,
        bound=np.finfo(float).eps * np.max(np.abs(end + origin), axis=0),
        method=f"matrix exponential of the linear equations, {DIGITS} digits",
    )


Integers = NDArray[np.object_]
"""Fixed-point numbers."""

FIXED_BITS = 320
"""Bits behind the point: 40 digits of entries that are 1e-50 of the largest."""

FIXED_ROUNDING = 256
"""Last digits that a term may lose; integers round down, so that -1 never vanishes."""


def exponentials(matrix: mp.matrix, shares: Sequence[mp.mpf]) -> list[list[list[mp.mpf]]]:
    """Return the rows of exp(share * matrix) for shares of at most 1, by one Taylor series.

    The matrix is halved until its norm is below 1, and each sum is squared as often. Fixed-point
    integers are ten times as fast as the library's numbers.
    """
    halvings = max(0, int(mp.ceil(mp.log(mp.mnorm(matrix, 1) + 1, 2))))
    entries = [to_fixed(x._mpf_, FIXED_BITS - halvings) for x in matrix]
    reduced = np.array(entries, dtype=object).reshape(matrix.rows, matrix.cols)
    powers: list[Integers] = [np.diag([1 << FIXED_BITS] * matrix.rows).astype(object)]
    while np.abs(powers[-1]).max() > FIXED_ROUNDING:
        powers.append((powers[-1] @ reduced >> FIXED_BITS) // len(powers))
    return [_exponential(powers, to_fixed(share._mpf_, FIXED_BITS), halvings) for share in shares]


def _exponential(powers: Sequence[Integers], share: int, halvings: int) -> list[list[mp.mpf]]:
    """Sum a Taylor series by Horner's rule, and square the sum."""
    total = powers[-1]
    for power in reversed(powers[:-1]):
        total = (total * share >> FIXED_BITS) + power
    for _ in range(halvings):
        total = total @ total >> FIXED_BITS
    return [[mp.ldexp(mp.mpf(x), -FIXED_BITS) for x in row] for row in total.tolist()]


def state_at(
    linearization: TaylorLinearization, start: Sequence[float], signal: SignalPiece, time: float
) -> list[mp.mpf]:
    """Return the state after `time` seconds under the inputs of one piece, with `DIGITS` digits.

    Raises:
        ValueError: if an input has no generator.
    """
    if signal.generators is None:
        raise ValueError("no linear equation generates an input of this piece")
    with mp.workdps(DIGITS):
        offsets = [*linearization.position, *np.zeros(len(linearization.position))]
        full = [mp.mpf(y) - mp.mpf(o) for y, o in zip(start, offsets, strict=True)]
        for generator in signal.generators:
            full += generator.state(signal.start)
        final = mp.expm(augmented(linearization, signal.generators) * mp.mpf(time)) * mp.matrix(
            full
        )
        return [final[i] + mp.mpf(o) for i, o in enumerate(offsets)]
