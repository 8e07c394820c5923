"""Rounding observed in companions: smooth dependence cancels, rounding remains on each rung."""

import numpy as np
import pytest

from physics_crosscheck.engine import Array
from physics_crosscheck.harness.numerics.ladder import EPSILON, RUNGS
from physics_crosscheck.harness.numerics.rounding import (
    COMPANION_EXPONENT,
    MAX_PAIRS,
    MIN_PAIRS,
    SHARED_DIGITS,
    Starts,
    with_companions,
    without_companions,
)
from physics_crosscheck.harness.numerics.segments import Observable, climb, extrapolate
from tests.numerics.conftest import MakeBench, SymplecticEuler

LAST_DIGIT = 2.0**-40


def starts(count: int = 200) -> Starts:
    rng = np.random.default_rng(5)
    return with_companions(rng.normal(size=(count, 3)), rng.normal(size=(count, 2)))


def ends(samples: Starts) -> Array:
    """Return ends as a smooth and curved function of start and input, of magnitude 1."""
    first = samples.gain * np.sin(samples.z[:, 0]) * np.exp(samples.w[:, 1])
    return np.column_stack([first, samples.z[:, 1] ** 2])


def test_smooth_dependence_is_not_observed_as_rounding() -> None:
    batch = starts()
    smooth = ends(batch)
    moved = np.abs(smooth[-MAX_PAIRS:] - smooth[batch.rows[-MAX_PAIRS:]])
    assert np.min(np.max(moved, axis=0)) > 0.1 * EPSILON**COMPANION_EXPONENT
    assert np.all(batch.observed_rounding(smooth) < 100 * EPSILON)


def test_rounding_is_observed_at_its_size_and_in_its_component() -> None:
    batch = starts()
    rounded = ends(batch)
    rounded[:, 1] = np.round(rounded[:, 1] / LAST_DIGIT) * LAST_DIGIT
    observed = batch.observed_rounding(rounded)
    assert observed[0] < 100 * EPSILON
    assert LAST_DIGIT / 2 <= observed[1] <= LAST_DIGIT  # three ends, each off by half a digit


def test_start_at_zero_shows_the_rounding_of_its_inputs() -> None:
    batch = with_companions(np.zeros((40, 1)), np.zeros((40, 1)))
    smooth = batch.gain[:, None] * np.linspace(0.5, 1.0, 40)[batch.rows, None]
    assert batch.observed_rounding(smooth)[0] < 10 * EPSILON
    rounded = np.round(smooth / LAST_DIGIT) * LAST_DIGIT
    assert LAST_DIGIT / 2 <= batch.observed_rounding(rounded)[0] <= LAST_DIGIT


def test_values_that_are_not_finite_are_ignored() -> None:
    batch = starts()
    rounded = np.round(ends(batch) / LAST_DIGIT) * LAST_DIGIT
    rounded[batch.rows[-1]] = np.nan
    rounded[-MAX_PAIRS] = np.inf
    observed = batch.observed_rounding(rounded)
    assert np.all((observed >= LAST_DIGIT / 2) & (observed <= LAST_DIGIT))


def test_companions_are_symmetric_and_keep_zeros() -> None:
    z = np.outer(np.arange(1, 101), [1.0, 0.0, -2.0])
    batch = with_companions(z, z)
    assert batch.pairs == MAX_PAIRS
    assert batch.count == 100
    assert len(batch.rows) == len(batch.z) == len(batch.w) == len(batch.gain) == 100 + 2 * MAX_PAIRS
    middle = z[batch.rows[-MAX_PAIRS:]]
    below, above = batch.z[100 : 100 + MAX_PAIRS], batch.z[-MAX_PAIRS:]
    assert np.array_equal(batch.z[:100], z)
    assert np.all(batch.gain[:100] == 1)
    assert np.all(below[:, 1] == 0)
    assert np.all(np.abs(below + above - 2 * middle) <= 2 * EPSILON * np.abs(middle))
    assert (
        0.5 * EPSILON**COMPANION_EXPONENT
        < np.max(np.abs(below - middle)[:, 0] / middle[:, 0])
        < 1.01 * EPSILON**COMPANION_EXPONENT
    )


def test_companions_are_spread_over_the_motion_off_its_start() -> None:
    rows = with_companions(np.ones((240, 1)), np.ones((240, 1))).rows[240:]
    assert np.array_equal(rows[:MAX_PAIRS], rows[MAX_PAIRS:])
    assert np.array_equal(rows[:MAX_PAIRS], np.arange(5, 240, 10))


def test_few_segments_have_several_companions_each() -> None:
    batch = with_companions(np.ones((2, 1)), np.ones((2, 1)))
    assert list(np.bincount(batch.rows)) == [1 + MIN_PAIRS, 1 + MIN_PAIRS]
    assert len(np.unique(batch.z[2:])) == 2 * MIN_PAIRS


@pytest.mark.parametrize(("count", "pairs"), [(1, 4), (16, 4), (40, 10), (96, 24), (400, 24)])
def test_companions_are_a_bounded_quarter_of_the_starts(count: int, pairs: int) -> None:
    batch = with_companions(np.ones((count, 1)), np.ones((count, 1)))
    assert batch.pairs == pairs
    assert len(batch.rows) == count + 2 * pairs


def test_last_digits_of_the_start_are_scaled_by_sensitivity() -> None:
    batch = with_companions(np.full((40, 1), 0.7), np.full((40, 1), 0.3))
    ends = np.column_stack(
        [5 * batch.z[:, 0], batch.z[:, 0] - batch.w[:, 0], np.ones(len(batch.z))]
    )
    digits = batch.last_digits(ends) / (SHARED_DIGITS * EPSILON)
    assert np.all(digits <= np.array([3.5, 1.0, 0.0]) * (1 + 1e-4))
    assert np.all(digits >= np.array([3.5, 1.0, 0.0]) / 2)
    assert np.array_equal(without_companions(batch.z, batch.w).last_digits(ends), np.zeros(3))


def test_last_digits_ignore_values_that_are_not_finite() -> None:
    batch = with_companions(np.full((40, 1), 0.7), np.full((40, 1), 0.3))
    ends = 5 * batch.z
    whole = batch.last_digits(ends)
    ends[-1], ends[40] = np.nan, np.inf
    assert 0 < batch.last_digits(ends)[0] <= whole[0]


RATE, REST, SWING, LENGTH = 10.0, 1.0, 1e-3, 0.03


def hanging(digits: float) -> Observable:
    """Return a weight on a spring near rest, by a method of order 4 with a wrong stiffness.

    All else is exact, so two runs differ only in their last digit.
    """
    phase = np.linspace(0.0, 6.0, 60)
    z = REST + SWING * np.cos(phase)[:, None]
    starts = with_companions(z, RATE * SWING * np.sin(phase)[:, None])

    def values(rung: int) -> Array:
        share = np.longdouble(1) + digits * np.longdouble(EPSILON)
        rate, rest = RATE * np.sqrt(share), REST / share
        c, s = np.cos(rate * LENGTH), np.sin(rate * LENGTH)
        away, w = starts.z[:, 0] - rest, starts.w[:, 0]
        x, v = rest + away * c + w / rate * s, w * c - away * rate * s
        short = np.longdouble(1e-6 * SWING) / np.longdouble(rung) ** 4
        return np.column_stack([x + short, v + RATE * short]).astype(float)

    scale = np.array([SWING, RATE * SWING]) / 3
    return Observable(
        values=values,
        starts=starts,
        exponents=(4, 1),
        rounding_scale=np.array([REST, RATE * SWING]),
        scale=scale,
        where=lambda row, rung: "",
    )


def off(digits: float) -> Array:
    """Return errors relative to uncertainty, (60, 2), of the limit with a wrong stiffness."""
    right = hanging(0.0).values(10**9)[:60]
    limit = climb(hanging(digits), RUNGS[:6]).limit
    error: Array = np.abs(limit.value - right) / limit.uncertainty
    return error


def test_rounding_common_to_all_runs_is_in_the_uncertainty(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert np.max(off(4.0)) < 1
    assert np.max(off(1e4)) > 1  # a fault of a few more digits is not covered
    monkeypatch.setattr(Starts, "last_digits", lambda self, values: np.zeros(values.shape[1]))
    assert np.max(off(4.0)) > 10
    assert np.max(off(0.0)) < 1


def test_without_companions_no_rounding_is_observed() -> None:
    batch = without_companions(np.ones((5, 2)), np.ones((5, 2)))
    assert batch.count == len(batch.rows) == 5
    assert np.array_equal(batch.observed_rounding(np.ones((5, 3))), np.zeros(3))


class Held(SymplecticEuler):
    """Turns the last digit of a position into a velocity, like a spring at the stability limit."""

    def altered(self, z: Array, w: Array, q: Array, h: float) -> tuple[Array, Array]:
        return z, w + (np.round(z / LAST_DIGIT) * LAST_DIGIT - z) / h


def test_position_rounding_that_changes_velocity_is_in_the_uncertainty(
    bench: MakeBench,
) -> None:
    rig = bench(Held(), duration=12.0)
    result = extrapolate(rig.model, rig.coordinates, rig.motion, resolution=1e-6)
    error = np.abs(result.limit.value - rig.motion.end)
    # The worst case of the weights, from the finest rung alone, dominates the error.
    kick = LAST_DIGIT / 2 * max(result.rungs) / np.max(rig.motion.lengths)
    assert np.max(error[:, 1]) > kick
    assert np.max(error / result.limit.uncertainty) < 0.7
    assert np.max(result.limit.uncertainty[:, 1]) < 1e3 * kick
