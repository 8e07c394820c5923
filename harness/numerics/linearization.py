"""An engine's own linearization, from small perturbations about an equilibrium.

Where an engine returns accelerations, their differences are the entries of A and B. Otherwise
extrapolated segments, perturbed in each state and input, give the transition matrix over the
segment. Its logarithm gives A and B.
"""

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.engines.protocol import LoadedModel
from physics_crosscheck.harness.records.base import Rows, number, rounded, rows
from physics_crosscheck.harness.records.model import EngineLinearization, EnginePole
from physics_crosscheck.harness.records.outcome import differs
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.segments import Segments
from .accelerations import Estimate
from .coordinates import CoordinateMap
from .differences import OperatingPoint, slopes
from .ladder import EPSILON, RUNGS
from .rounding import with_companions
from .segments import extrapolate
from .stepping import ROUNDED_DIGITS, ROUNDING_MARGIN, is_linear

RUNGS_USED = RUNGS[:8]

ZERO_RATE_SHARE = 1e-4
"""Eigenvalues below this share of the motions' rate are considered rounded zeros."""

SERIES_TERMS = 60
"""Terms of the logarithm's series. Over a twentieth of the fastest period each is a third of the
previous one."""


def linearize_engine(
    model: LoadedModel,
    coordinates: CoordinateMap,
    point: OperatingPoint,
    resolution: float,
    thorough: bool = True,
) -> tuple[EngineLinearization, Estimate]:
    """Linearize an engine's model about an equilibrium, and compare.

    Returns the record, and the matrix [A, B] with the uncertainty of each entry.

    Args:
        point: the equilibrium.
        resolution: smallest difference that counts, as a share of the largest entry.
        thorough: whether segments are run even if the engine returns accelerations.
    """
    taylor = point.matrices
    a, b = taylor["A"], taylor["B"]
    fastest = _fastest(a, point.amplitude)
    direct = None if thorough else _by_accelerations(model, coordinates, point)
    if direct is None:
        generator, is_wrong = _by_segments(model, coordinates, point, fastest, resolution)
    else:
        generator = direct
        is_wrong = _entries_differ(direct, np.hstack([a, b]), point, 1.0, resolution)
    uncertainty, size = generator.uncertainty, len(a)
    found_a, found_b = generator.value[:size, :size], generator.value[:size, size:]
    frequencies = fastest * np.geomspace(0.05, 5.0, 120)
    # Slightly off the imaginary axis, where undamped poles lie.
    line = (1j * frequencies + 0.02 * fastest).astype(np.complex128)
    ours = _response(found_a, found_b, taylor["Cy"], taylor["D"], line)
    theirs = _response(a, b, taylor["Cy"], taylor["D"], line)
    axis = (1j * frequencies).astype(np.complex128)
    on_axis = [
        np.abs(_response(m, n, taylor["Cy"], taylor["D"], axis))
        for m, n in ((found_a, found_b), (a, b))
    ]
    poles, taylor_poles, shapes = _pair(found_a, a)
    transfer_error = float("nan")
    if b.size and len(taylor["Cy"]):
        transfer_error = float(np.max(np.abs(ours - theirs)) / np.max(np.abs(theirs)))
    record = EngineLinearization(
        equilibrium=point.name,
        a=rows(found_a.tolist()),
        b=rows(found_b.tolist()),
        a_error=number(_relative(found_a, a)),
        b_error=number(_relative(found_b, b)),
        poles=tuple(map(_pole, poles)),
        taylor_poles=tuple(map(_pole, taylor_poles)),
        transfer_error=number(transfer_error),
        a_bound=number(_share(uncertainty[:size, :size], a)),
        b_bound=number(_share(uncertainty[:size, size:], b)),
        differs=is_wrong,
        mode_similarity=number(shapes),
        frequencies=rounded(frequencies.tolist(), 5),
        response=_magnitudes(on_axis[0]),
        taylor_response=_magnitudes(on_axis[1]),
    )
    return record, generator


def _pole(value: complex) -> EnginePole:
    size = abs(value)
    return EnginePole(
        real=number(value.real),
        imaginary=number(value.imag),
        frequency=number(size),
        damping=number(-value.real / size) if size else None,
    )


def _magnitudes(response: Array) -> tuple[Rows, ...]:
    return tuple(tuple(rounded(row, 5) for row in matrix) for matrix in response.tolist())


def _fastest(a: Array, amplitude: Array) -> float:
    """Return the fastest rate, rad/s; without springs and dampers, that of the motions."""
    n = len(a) // 2
    eigenvalue = float(np.max(np.abs(np.linalg.eigvals(a))))
    seen = float(np.max(amplitude[n:] / np.maximum(amplitude[:n], 1e-300)))
    return max(eigenvalue if eigenvalue > ZERO_RATE_SHARE * seen else seen, 1e-6)


def _by_accelerations(
    model: LoadedModel, coordinates: CoordinateMap, point: OperatingPoint
) -> Estimate | None:
    """Return A and B, (2n, 2n + inputs), as differences of accelerations.

    None if the engine returns none, or its coordinates are not linear in those of the equations.
    """
    (states, inputs), n = point.perturbed, coordinates.back.size
    if not is_linear(coordinates, states):
        return None
    starts = with_companions(*coordinates.to_engine(states), model.epsilon)
    held = inputs[starts.rows] * starts.gain[:, None]
    with np.errstate(all="ignore"):
        took = model.accelerations(starts.z, starts.w, coordinates.pushes(starts.z, held))
    if took is None or not np.isfinite(took).all():
        return None
    lost = ROUNDED_DIGITS * model.epsilon * np.max(np.abs(took), axis=0)
    lost = lost + ROUNDING_MARGIN * (starts.last_digits(took) + starts.observed_rounding(took))
    back = coordinates.back_slope(starts.z[:1]).reshape(n, -1)
    rates = took[: len(states)] @ back.T
    error = np.broadcast_to(lost @ np.abs(back).T, rates.shape)
    lower = slopes(rates, error, point.deltas)
    upper = np.eye(n, lower.value.shape[1], k=n)
    return Estimate(
        value=np.concatenate([upper, lower.value]),
        uncertainty=np.concatenate([np.zeros_like(upper), lower.uncertainty]),
    )


def _entries_differ(
    engine: Estimate, wanted: Array, point: OperatingPoint, length: float, resolution: float
) -> bool:
    """Return whether an entry of a matrix differs from Taylor's."""
    both = point.matrices["A"], point.matrices["B"]
    largest = [np.max(np.abs(one), initial=0.0) or 1.0 for one in both]
    scale = length * np.repeat(largest, [one.shape[1] for one in both])
    # Rounding of Taylor's matrix in doubles.
    error = (engine.uncertainty + 16 * EPSILON * np.abs(wanted)) / scale
    return bool(np.any(differs(np.abs(engine.value - wanted) / scale, error, resolution)))


def _by_segments(
    model: LoadedModel,
    coordinates: CoordinateMap,
    point: OperatingPoint,
    fastest: float,
    resolution: float,
) -> tuple[Estimate, bool]:
    """Return A and B as rows of a square matrix, and whether a transition differs from Taylor's."""
    length = 2 * np.pi / fastest / 20
    transition = _transition(model, coordinates, point, length)
    from scipy.linalg import expm, logm  # slow import, not needed by every command

    generator = Estimate(
        value=logm(transition.value).real / length, uncertainty=_of_logarithm(transition) / length
    )
    # Transitions are compared, since they have a limit even without a logarithm.
    size, rates = len(point.amplitude), np.zeros_like(transition.value)
    rates[:size] = np.hstack([point.matrices["A"], point.matrices["B"]])
    upper = Estimate(value=transition.value[:size], uncertainty=transition.uncertainty[:size])
    return generator, _entries_differ(upper, expm(rates * length)[:size], point, length, resolution)


def _transition(
    model: LoadedModel, coordinates: CoordinateMap, point: OperatingPoint, length: float
) -> Estimate:
    """Return exp([[A, B], [0, 0]] length), extrapolated in perturbation size and in h."""
    size, deltas = len(point.amplitude), point.deltas
    states, inputs = point.perturbed
    segments = Segments.unsolved(states, length, inputs, scale=deltas[:size])
    limit = extrapolate(model, coordinates, segments, rungs=RUNGS_USED).limit
    derivatives = slopes(limit.value, limit.uncertainty, deltas)
    matrix, doubt = np.eye(len(deltas)), np.zeros((len(deltas), len(deltas)))
    matrix[:size], doubt[:size] = derivatives.value, derivatives.uncertainty
    return Estimate(value=matrix, uncertainty=doubt)


def _of_logarithm(matrix: Estimate) -> Array:
    """Return the uncertainty of ln(I + M), from each series term M^k / k to first order."""
    size = np.abs(matrix.value - np.eye(len(matrix.value)))
    term, power = matrix.uncertainty, size
    total = term.copy()
    for k in range(2, SERIES_TERMS):
        term = size @ term + matrix.uncertainty @ power
        power = power @ size
        total += term / k
    small = bool(np.all(term <= EPSILON * np.max(total)))
    return total if small else np.full_like(total, np.inf)


Complex = NDArray[np.complex128]


def _response(a: Array, b: Array, c: Array, d: Array, line: Complex) -> Complex:
    identity = np.eye(len(a))
    return np.array([c @ np.linalg.solve(s * identity - a, b) + d for s in line])


def _relative(engine: Array, wanted: Array) -> float:
    return _share(np.abs(engine - wanted), wanted)


def _share(values: Array, wanted: Array) -> float:
    """Return the largest value, relative to the largest entry; absolute if all are zero."""
    if not wanted.size:
        return 0.0
    return float(np.max(values) / (np.max(np.abs(wanted)) or 1.0))


def _pair(engine: Array, wanted: Array) -> tuple[tuple[complex, ...], tuple[complex, ...], float]:
    """Pair the eigenvalues of both by distance; also return the lowest similarity of vectors.

    Vectors of repeated eigenvalues are not unique and are ignored.
    """
    values, vectors = np.linalg.eig(engine)
    targets, target_vectors = np.linalg.eig(wanted)
    cost = np.abs(values[:, None] - targets[None, :])
    from scipy.optimize import linear_sum_assignment  # slow import, not needed by every command

    picked, columns = linear_sum_assignment(cost)
    scale = np.max(np.abs(targets)) or 1.0
    least = 1.0
    for row, column in zip(picked, columns, strict=True):
        gaps = np.delete(np.abs(targets - targets[column]), column)
        if len(gaps) and np.min(gaps) < 1e-4 * scale:
            continue
        parallel = abs(np.vdot(vectors[:, row], target_vectors[:, column])) ** 2
        least = min(least, float(parallel))
    wanted_poles = targets[columns]
    order = sorted(range(len(picked)), key=lambda i: (abs(wanted_poles[i]), wanted_poles[i].imag))
    return (
        tuple(complex(values[picked[i]]) for i in order),
        tuple(complex(wanted_poles[i]) for i in order),
        least,
    )
