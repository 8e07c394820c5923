"""Rounding observed in companions: what is smooth drops out, what is rounded shows by the rung."""

import numpy as np
import pytest

from physics_crosscheck.harness.engines.protocol import Array, Force
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


def ends(found: Starts) -> Array:
    """Ends as a smooth and curved function of start and input, with numbers of size one."""
    one = found.gain * np.sin(found.z[:, 0]) * np.exp(found.w[:, 1])
    return np.column_stack([one, found.z[:, 1] ** 2])


def test_what_the_end_depends_on_smoothly_is_not_observed() -> None:
    found = starts()
    smooth = ends(found)
    moved = np.abs(smooth[-MAX_PAIRS:] - smooth[found.rows[-MAX_PAIRS:]])
    assert np.min(np.max(moved, axis=0)) > 0.1 * EPSILON**COMPANION_EXPONENT
    assert np.all(found.observed_rounding(smooth) < 100 * EPSILON)


def test_rounding_is_observed_at_its_size_and_in_its_component() -> None:
    found = starts()
    rounded = ends(found)
    rounded[:, 1] = np.round(rounded[:, 1] / LAST_DIGIT) * LAST_DIGIT
    observed = found.observed_rounding(rounded)
    assert observed[0] < 100 * EPSILON
    assert LAST_DIGIT / 2 <= observed[1] <= LAST_DIGIT  # of three ends, each off by half a digit


def test_a_start_at_rest_in_zero_shows_the_rounding_of_what_its_inputs_make_of_it() -> None:
    found = with_companions(np.zeros((40, 1)), np.zeros((40, 1)))
    smooth = found.gain[:, None] * np.linspace(0.5, 1.0, 40)[found.rows, None]
    assert found.observed_rounding(smooth)[0] < 10 * EPSILON
    rounded = np.round(smooth / LAST_DIGIT) * LAST_DIGIT
    assert LAST_DIGIT / 2 <= found.observed_rounding(rounded)[0] <= LAST_DIGIT


def test_values_that_are_not_finite_show_nothing_and_hide_nothing() -> None:
    found = starts()
    rounded = np.round(ends(found) / LAST_DIGIT) * LAST_DIGIT
    rounded[found.rows[-1]] = np.nan
    rounded[-MAX_PAIRS] = np.inf
    observed = found.observed_rounding(rounded)
    assert np.all((observed >= LAST_DIGIT / 2) & (observed <= LAST_DIGIT))


def test_companions_are_as_far_on_either_side_and_leave_zeros_alone() -> None:
    z = np.outer(np.arange(1, 101), [1.0, 0.0, -2.0])
    found = with_companions(z, z)
    assert found.pairs == MAX_PAIRS
    assert found.count == 100
    assert len(found.rows) == len(found.z) == len(found.w) == len(found.gain) == 100 + 2 * MAX_PAIRS
    middle = z[found.rows[-MAX_PAIRS:]]
    one, other = found.z[100 : 100 + MAX_PAIRS], found.z[-MAX_PAIRS:]
    assert np.array_equal(found.z[:100], z)
    assert np.all(found.gain[:100] == 1)
    assert np.all(one[:, 1] == 0)
    assert np.all(np.abs(one + other - 2 * middle) <= 2 * EPSILON * np.abs(middle))
    assert (
        0.5 * EPSILON**COMPANION_EXPONENT
        < np.max(np.abs(one - middle)[:, 0] / middle[:, 0])
        < 1.01 * EPSILON**COMPANION_EXPONENT
    )


def test_companions_are_spread_over_the_motion_off_its_start() -> None:
    rows = with_companions(np.ones((240, 1)), np.ones((240, 1))).rows[240:]
    assert np.array_equal(rows[:MAX_PAIRS], rows[MAX_PAIRS:])
    assert np.array_equal(rows[:MAX_PAIRS], np.arange(5, 240, 10))


def test_few_segments_have_several_companions_each() -> None:
    found = with_companions(np.ones((2, 1)), np.ones((2, 1)))
    assert list(np.bincount(found.rows)) == [1 + MIN_PAIRS, 1 + MIN_PAIRS]
    assert len(np.unique(found.z[2:])) == 2 * MIN_PAIRS


@pytest.mark.parametrize(("count", "pairs"), [(1, 4), (16, 4), (40, 10), (96, 24), (400, 24)])
def test_companions_are_a_quarter_of_the_starts_but_neither_few_nor_many(
    count: int, pairs: int
) -> None:
    found = with_companions(np.ones((count, 1)), np.ones((count, 1)))
    assert found.pairs == pairs
    assert len(found.rows) == count + 2 * pairs


def test_last_digits_are_those_of_the_start_as_far_as_the_end_depends_on_them() -> None:
    found = with_companions(np.full((40, 1), 0.7), np.full((40, 1), 0.3))
    ends = np.column_stack(
        [5 * found.z[:, 0], found.z[:, 0] - found.w[:, 0], np.ones(len(found.z))]
    )
    digits = found.last_digits(ends) / (SHARED_DIGITS * EPSILON)
    assert np.all(digits <= np.array([3.5, 1.0, 0.0]) * (1 + 1e-4))
    assert np.all(digits >= np.array([3.5, 1.0, 0.0]) / 2)
    assert np.array_equal(without_companions(found.z, found.w).last_digits(ends), np.zeros(3))


def test_last_digits_of_values_that_are_not_finite_are_none() -> None:
    found = with_companions(np.full((40, 1), 0.7), np.full((40, 1), 0.3))
    ends = 5 * found.z
    whole = found.last_digits(ends)
    ends[-1], ends[40] = np.nan, np.inf
    assert 0 < found.last_digits(ends)[0] <= whole[0]


RATE, REST, SWING, LENGTH = 10.0, 1.0, 1e-3, 0.03


def hanging(digits: float) -> Observable:
    """A weight on a spring near its rest, by a method of order 4; the stiffness is digits off.

    All else is exact, so that no two runs are rounded differently but in their own last digit.
    """
    phase = np.linspace(0.0, 6.0, 60)
    z = REST + SWING * np.cos(phase)[:, None]
    starts = with_companions(z, RATE * SWING * np.sin(phase)[:, None])

    def at(rung: int) -> Array:
        share = np.longdouble(1) + digits * np.longdouble(EPSILON)
        rate, rest = RATE * np.sqrt(share), REST / share
        c, s = np.cos(rate * LENGTH), np.sin(rate * LENGTH)
        away, w = starts.z[:, 0] - rest, starts.w[:, 0]
        x, v = rest + away * c + w / rate * s, w * c - away * rate * s
        short = np.longdouble(1e-6 * SWING) / np.longdouble(rung) ** 4
        return np.column_stack([x + short, v + RATE * short]).astype(float)

    scale = np.array([SWING, RATE * SWING]) / 3
    return Observable(
        values=at,
        starts=starts,
        exponents=(4, 1),
        rounding_scale=np.array([REST, RATE * SWING]),
        scale=scale,
        where=lambda row, rung: "",
    )


def off(digits: float) -> Array:
    """Errors by uncertainty, (60, 2): the limit is compared with that of the right stiffness."""
    right = hanging(0.0).values(10**9)[:60]
    limit = climb(hanging(digits), RUNGS[:6]).limit
    error: Array = np.abs(limit.value - right) / limit.uncertainty
    return error


def test_what_is_rounded_alike_in_every_run_is_in_the_uncertainty(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert np.max(off(4.0)) < 1
    assert np.max(off(1e4)) > 1  # and a fault of a few digits more than that is none of it
    monkeypatch.setattr(Starts, "last_digits", lambda self, values: np.zeros(values.shape[1]))
    assert np.max(off(4.0)) > 10
    assert np.max(off(0.0)) < 1


def test_without_companions_no_rounding_is_observed() -> None:
    found = without_companions(np.ones((5, 2)), np.ones((5, 2)))
    assert found.count == len(found.rows) == 5
    assert np.array_equal(found.observed_rounding(np.ones((5, 3))), np.zeros(3))


class Held(SymplecticEuler):
    """Like a position held by a spring as stiff as the step allows: its digit over h is a speed."""

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        z, w = super().rollout(q, v, h, n, force, every)
        return z, w + (np.round(z / LAST_DIGIT) * LAST_DIGIT - z) / h


def test_a_position_s_last_digit_that_makes_a_velocity_is_in_the_uncertainty(
    bench: MakeBench,
) -> None:
    made = bench(Held(), duration=12.0)
    found = extrapolate(made.model, made.coordinates, made.motion, resolution=1e-6)
    error = np.abs(found.limit.value - made.motion.end)
    # The weights' own worst case, from the finest rung alone; most of the error is this.
    kick = LAST_DIGIT / 2 * max(found.rungs) / np.max(made.motion.lengths)
    assert np.max(error[:, 1]) > kick
    assert np.max(error / found.limit.uncertainty) < 0.7
    assert np.max(found.limit.uncertainty[:, 1]) < 1e3 * kick
