"""The linear twin: an engine's own linearization, from limits of small perturbations.

Extrapolated segments from an equilibrium, moved a little in each state and input, give the
transition matrix over the segment; its logarithm is the engine's A and B.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.optimize
from numpy.typing import NDArray

from harness.engines.protocol import Model
from harness.numerics.coordinates import CoordinateMap
from harness.numerics.ladder import RUNGS, limits, weights
from harness.numerics.segments import run_ends
from reference.numeric import Array

SIZES = (1.0, 0.5, 0.25)
"""Perturbations, in units of the largest; their even powers are extrapolated away."""

LARGEST = 0.02
RUNGS_USED = RUNGS[:8]


@dataclass(frozen=True)
class EngineLinearization:
    """Engine and Taylor linearization about one equilibrium.

    Attributes:
        a, b: the engine's matrices; a is (2n, 2n), b is (2n, inputs).
        a_error, b_error: largest difference from Taylor's in any entry, relative to the largest
            entry.
        poles: the engine's eigenvalues, sorted like `taylor_poles`.
        transfer_error: largest difference of the transfer functions from Taylor's over the grid of
            frequencies, relative to the largest value there; nan without inputs.
        frequencies: that grid, rad/s.
        response, taylor_response: |transfer function|, (frequencies, outputs, inputs).
        shapes: smallest modal assurance criterion between paired eigenvectors; 1 is equal.
    """

    equilibrium: str
    a: Array
    b: Array
    a_error: float
    b_error: float
    poles: tuple[complex, ...]
    taylor_poles: tuple[complex, ...]
    transfer_error: float
    frequencies: Array
    response: Array
    taylor_response: Array
    shapes: float


def twin(
    model: Model,
    coordinates: CoordinateMap,
    equilibrium: str,
    position: Array,
    taylor: Mapping[str, Array],
    amplitude: Array,
    push: Array,
) -> EngineLinearization:
    """Linearize an engine's model about an equilibrium, and compare.

    Args:
        position: equilibrium positions, (n,).
        taylor: A, B, Cy, D of the Taylor linearization.
        amplitude: size of the system's motions, per component, (2n,).
        push: size of its inputs, (inputs,).
    """
    a, b = taylor["A"], taylor["B"]
    fastest = max(float(np.max(np.abs(np.linalg.eigvals(a)))), 1e-6)
    length = 2 * np.pi / fastest / 20
    matrix = _transition(model, coordinates, position, length, amplitude, push)
    generator = scipy.linalg.logm(matrix).real / length
    size = len(a)
    found_a, found_b = generator[:size, :size], generator[:size, size:]
    frequencies = fastest * np.geomspace(0.05, 5.0, 120)
    # Off the imaginary axis by a little: undamped poles lie on it.
    line = (1j * frequencies + 0.02 * fastest).astype(np.complex128)
    ours = _response(found_a, found_b, taylor["Cy"], taylor["D"], line)
    theirs = _response(a, b, taylor["Cy"], taylor["D"], line)
    axis = (1j * frequencies).astype(np.complex128)
    on_axis = [
        np.abs(_response(m, n, taylor["Cy"], taylor["D"], axis))
        for m, n in ((found_a, found_b), (a, b))
    ]
    poles, taylor_poles, shapes = _pair(found_a, a)
    return EngineLinearization(
        equilibrium,
        found_a,
        found_b,
        _relative(found_a, a),
        _relative(found_b, b),
        poles,
        taylor_poles,
        float(np.max(np.abs(ours - theirs)) / np.max(np.abs(theirs))) if b.size else float("nan"),
        frequencies,
        on_axis[0],
        on_axis[1],
        shapes,
    )


def _transition(
    model: Model,
    coordinates: CoordinateMap,
    position: Array,
    length: float,
    amplitude: Array,
    push: Array,
) -> Array:
    """exp([[A, B], [0, 0]] length), from central differences, extrapolated in size and in h."""
    size = len(amplitude)
    origin = np.concatenate([position, np.zeros(size - len(position))])
    deltas = LARGEST * np.concatenate([np.minimum(amplitude, 1.0), push])
    columns = len(deltas)
    starts, inputs = [], []
    for share in SIZES:
        for sign in (1.0, -1.0):
            moved = sign * share * np.diag(deltas)
            starts.append(origin + moved[:, :size])
            inputs.append(moved[:, size:])
    start, held = np.concatenate(starts), np.concatenate(inputs)
    z, w = coordinates.to_engine(start)
    even = weights(tuple(int(1 / s) for s in SIZES), (2, 2))
    values = []
    for rung in RUNGS_USED:
        u = np.repeat(held[:, None, :], rung, axis=1)
        ends = run_ends(model, coordinates, z, w, length / rung, rung, u, start)
        parts = ends.reshape(len(SIZES), 2, columns, size)
        slopes = (parts[:, 0] - parts[:, 1]) / 2
        slopes /= np.array(SIZES)[:, None, None] * deltas[:, None]
        values.append(np.tensordot(even, slopes, axes=1))
    unit = np.ones(size)
    limit = limits(values, RUNGS_USED, model.exponents(False), unit, unit)
    matrix = np.eye(columns)
    matrix[:size] = limit.value.T
    return matrix


Complex = NDArray[np.complex128]


def _response(a: Array, b: Array, c: Array, d: Array, line: Complex) -> Complex:
    identity = np.eye(len(a))
    return np.array([c @ np.linalg.solve(s * identity - a, b) + d for s in line])


def _relative(found: Array, wanted: Array) -> float:
    if not wanted.size:
        return 0.0
    return float(np.max(np.abs(found - wanted)) / np.max(np.abs(wanted)))


def _pair(found: Array, wanted: Array) -> tuple[tuple[complex, ...], tuple[complex, ...], float]:
    """Eigenvalues of both, paired by distance, and how parallel their vectors are at least.

    Vectors of repeated eigenvalues are not unique and are left out.
    """
    values, vectors = np.linalg.eig(found)
    targets, target_vectors = np.linalg.eig(wanted)
    cost = np.abs(values[:, None] - targets[None, :])
    rows, columns = scipy.optimize.linear_sum_assignment(cost)
    scale = np.max(np.abs(targets)) or 1.0
    least = 1.0
    for row, column in zip(rows, columns, strict=True):
        gaps = np.delete(np.abs(targets - targets[column]), column)
        if len(gaps) and np.min(gaps) < 1e-4 * scale:
            continue
        parallel = abs(np.vdot(vectors[:, row], target_vectors[:, column])) ** 2
        least = min(least, float(parallel))
    wanted_poles = targets[columns]
    order = sorted(range(len(rows)), key=lambda i: (abs(wanted_poles[i]), wanted_poles[i].imag))
    return (
        tuple(complex(values[rows[i]]) for i in order),
        tuple(complex(wanted_poles[i]) for i in order),
        least,
    )
