"""Characteristic scales of a model: inertia, possible velocities, rates and size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from physics_crosscheck.harness.compare.candidate import CompareError
from physics_crosscheck.harness.engines.protocol import Array, Model
from physics_crosscheck.harness.numerics.accelerations import Accelerations, Estimate
from physics_crosscheck.harness.numerics.coordinates import identity

MIN_RESPONSE = 1e-6
"""Share of the largest response to a force below which a direction counts as locked."""

STEP_DIVISORS = (1.0, 256.0, 65536.0)
"""Divisors of the step, tried until the response of each joint is resolved."""

MIN_TYPICAL_RATE = 0.02
"""Minimum typical rate, relative to the fastest.

Positions then move by 3e-3 of their size over a run, known to 3e-11 of that. Half closed, the
Robotiq 2F-85 moves at 3e-3; its positions are known to 7e-10.
"""

NO_INPUT = np.zeros((1, 0))

MAX_ACCELERATION = 4e9
"""Limit in rad/s^2 or m/s^2: an engine takes 1e10 for a run that has blown up."""


@dataclass(frozen=True, kw_only=True)
class CharacteristicScales:
    """Scales from a model's responses to small forces.

    Attributes:
        inverse: its inverse mass matrix in the drawn position, (nz, nz).
        tangent: velocities possible there, a column each, (nz, r).
        sizes: forces that make its inertia visible, (nz,).
        fastest, typical: rates of its motions, rad/s.
        unit: size of its motions, (nz,).
    """

    inverse: Array
    tangent: Array
    sizes: Array
    fastest: float
    typical: float
    unit: Array


def inverse_mass(accelerations: Accelerations, z: Array, w: Array, sizes: Array) -> Estimate:
    """Return the response of the accelerations to a force on each coordinate, (B, nz, nz).

    The forces have the given sizes and both signs. A response within its uncertainty is set to
    zero: its rounding error would look like an inertia.
    """
    n = len(sizes)
    pushes = np.concatenate([np.diag(sizes), -np.diag(sizes)])
    states = np.repeat(np.concatenate([z, w], axis=1), 2 * n, axis=0)
    measured = accelerations.measure(
        states, np.zeros((len(states), 0)), np.tile(pushes, (len(z), 1))
    )
    value, error = (
        one.reshape(len(z), 2, n, n).swapaxes(2, 3) / (2 * sizes)
        for one in (measured.value, measured.uncertainty)
    )
    response, errors = value[:, 0] - value[:, 1], error[:, 0] + error[:, 1]
    held = np.diagonal(np.abs(response) <= 10 * errors, axis1=1, axis2=2)
    response[held[:, :, None] | held[:, None, :]] = 0.0
    return Estimate(value=response, uncertainty=errors)


def free_directions(inverse: Array) -> Array:
    """Return columns (nz, r): velocities possible with this inverse mass matrix."""
    size = np.sqrt(np.maximum(np.diagonal(inverse), 0.0))
    safe = np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh((inverse + inverse.T) / 2 / np.outer(safe, safe))
    kept: Array = vectors[:, values > MIN_RESPONSE * max(float(values[-1]), 1e-300)]
    return kept * safe[:, None]


def characteristic_scales(
    model: Model, rng: np.random.Generator, start: Array, extent: Array
) -> CharacteristicScales:
    """Measure inertia, rates and sizes of a model, from small motions about a position.

    Args:
        model: to measure.
        rng: for the initial velocities.
        start: the position, (nz,).
        extent: sampling range of positions, (nz, 2).

    Raises:
        CompareError: if no force moves a joint.
    """
    unit = (extent[:, 1] - extent[:, 0]) / 2
    plain = 2 * np.pi / (1000 * model.step)
    # In motion: static friction would lock it at rest.
    going = 0.1 * unit * plain * rng.uniform(0.5, 1.0, len(unit))
    here = start[None], going[None]
    accelerations, ease, pushes = _eased(model, unit * plain, plain, here)
    if not np.isfinite(ease).all() or not (ease > 0).any():
        raise CompareError("forces on the joints move nothing, or nothing finite")
    sizes = np.maximum(pushes, unit * plain**2 / np.where(ease > 0, ease, np.max(ease)))
    inverse = inverse_mass(accelerations, *here, sizes).value[0]
    tangent = free_directions(inverse)
    tangent /= np.max(np.abs(tangent) / unit[:, None], axis=0)
    rates = _rates(accelerations, start, tangent, plain)
    fastest = max(float(np.max(rates)), plain)
    moving = rates[rates > 1e-3 * fastest]
    typical = float(np.median(moving)) if len(moving) else plain
    # Runs are short by the fastest rate. Far slower components would move by rounding only.
    # Components slower than the speed that forces at rest give them would reverse within a run,
    # where drag has a kink. With a servo's damper that is faster still, an engine gives up at such
    # accelerations.
    rest = accelerations.measure(
        np.hstack([start, 0 * start])[None], NO_INPUT, 0 * start[None]
    ).value
    falling = float(np.sqrt(np.max(np.nan_to_num(np.abs(rest[0])) / unit)))
    typical = max(typical, plain / 3, falling, MIN_TYPICAL_RATE * fastest)
    typical = min(typical, max(plain / 3, MAX_ACCELERATION / (fastest * float(np.max(unit)))))
    return CharacteristicScales(
        inverse=inverse,
        tangent=tangent,
        sizes=sizes,
        fastest=fastest,
        typical=typical,
        unit=unit,
    )


def _eased(
    model: Model, speed: Array, plain: float, here: tuple[Array, Array]
) -> tuple[Accelerations, Array, Array]:
    """Return resolved accelerations, each joint's response to a force (nz,), and the forces.

    Two effects hide a response. A servo's damper may be far faster than the model's own step: over
    longer steps no acceleration has a limit. Its force may also be so large that a small one is
    lost in its rounding error. Then a larger one is used, up to the force that would show a joint
    that moves by a millionth of the others.
    """
    pushes = np.ones(len(speed))
    candidates: list[tuple[float, Accelerations, Array, Array]] = []
    for quicker in STEP_DIVISORS:
        accelerations = Accelerations(
            model=model, coordinates=identity(len(speed)), speed=speed, fastest=quicker * plain
        )
        ease, error = _ease(accelerations, here, pushes)
        candidates.append((float(np.max(error)), accelerations, ease, error))
        if np.max(error) <= MIN_RESPONSE * np.max(ease):
            break
    _, accelerations, ease, error = min(candidates, key=lambda one: one[0])
    if (ease > 0).any():
        least = MIN_RESPONSE * float(np.min(ease[ease > 0]))
        pushes = np.where(ease > 0, 1.0, np.maximum(1.0, np.nan_to_num(error) / least))
        ease, _ = _ease(accelerations, here, pushes)
    return accelerations, ease, pushes


def _ease(
    accelerations: Accelerations, here: tuple[Array, Array], pushes: Array
) -> tuple[Array, Array]:
    """Return each joint's acceleration per unit of force on it, and its uncertainty, (nz,)."""
    response = inverse_mass(accelerations, *here, pushes)
    return np.diagonal(response.value[0]), np.diagonal(response.uncertainty[0])


def _rates(accelerations: Accelerations, start: Array, tangent: Array, plain: float) -> Array:
    """Return magnitudes of the eigenvalues of the linearization along the free directions."""
    r = tangent.shape[1]
    step = 1e-3
    moves = np.concatenate([tangent.T, -tangent.T]) * step
    none = np.zeros_like(moves)
    going = np.tile(0.1 * plain * tangent.sum(axis=1), (len(moves), 1))
    states = np.concatenate(
        [
            np.hstack([start + moves, going]),
            np.hstack([start + none, going + moves * plain]),
        ]
    )
    measured = accelerations.measure(
        states, np.zeros((len(states), 0)), np.zeros((len(states), len(start)))
    ).value.reshape(2, 2, r, len(start))
    if not np.isfinite(measured).all():
        return np.array([plain])
    slopes = (measured[:, 0] - measured[:, 1]) / (2 * step)
    back = np.linalg.pinv(tangent)
    stiffness, damping = (back @ slopes[0].T), (back @ slopes[1].T) / plain
    matrix = np.block([[np.zeros((r, r)), np.eye(r)], [stiffness, damping]])
    return np.abs(np.linalg.eigvals(matrix))
