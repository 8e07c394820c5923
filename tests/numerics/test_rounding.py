"""Rounding seen in companions: what is smooth drops out, what is rounded shows, rung by rung."""

import numpy as np

from harness.cases.verdict import component_scale
from harness.numerics.ladder import EPSILON
from harness.numerics.rounding import APART, PAIRS, with_companions
from harness.numerics.segments import extrapolate
from tests.numerics.conftest import SymplecticEuler

LAST_DIGIT = 2.0**-40


def starts(count=200):
    rng = np.random.default_rng(5)
    return with_companions(rng.normal(size=(count, 3)), rng.normal(size=(count, 2)))


def ends(found):
    """Ends as a smooth and curved function of the start, with numbers of size one."""
    return np.column_stack([np.sin(found.z[:, 0]) * np.exp(found.w[:, 1]), found.z[:, 1] ** 2])


def test_what_the_end_depends_on_smoothly_is_not_seen():
    found = starts()
    smooth = ends(found)
    moved = np.abs(smooth[-PAIRS:] - smooth[found.rows[-PAIRS:]])
    assert np.min(np.max(moved, axis=0)) > 0.1 * APART
    assert np.all(found.seen(smooth) < 100 * EPSILON)


def test_rounding_is_seen_at_its_size_and_in_its_component():
    found = starts()
    rounded = ends(found)
    rounded[:, 1] = np.round(rounded[:, 1] / LAST_DIGIT) * LAST_DIGIT
    seen = found.seen(rounded)
    assert seen[0] < 100 * EPSILON
    assert LAST_DIGIT / 2 <= seen[1] <= LAST_DIGIT  # of three ends, each off by half a digit


def test_companions_are_as_far_on_either_side_and_leave_zeros_alone():
    z = np.outer(np.arange(1, 101), [1.0, 0.0, -2.0])
    found = with_companions(z, z)
    assert len(found.rows) == len(found.z) == len(found.w) == 100 + 2 * PAIRS
    middle = z[found.rows[-PAIRS:]]
    one, other = found.z[100 : 100 + PAIRS], found.z[-PAIRS:]
    assert np.array_equal(found.z[:100], z)
    assert np.all(one[:, 1] == 0)
    assert np.all(np.abs(one + other - 2 * middle) <= 2 * EPSILON * np.abs(middle))
    assert 0.5 * APART < np.max(np.abs(one - middle)[:, 0] / middle[:, 0]) < 1.01 * APART


def test_companions_are_spread_over_the_motion_off_its_start():
    rows = with_companions(np.ones((240, 1)), np.ones((240, 1))).rows[240:]
    assert np.array_equal(rows[:PAIRS], rows[PAIRS:])
    assert np.array_equal(rows[:PAIRS], np.arange(5, 240, 10))


def test_few_segments_have_several_companions_each():
    found = with_companions(np.ones((2, 1)), np.ones((2, 1)))
    assert list(np.bincount(found.rows)) == [1 + PAIRS, 1 + PAIRS]
    assert len(np.unique(found.z[2:])) == 2 * PAIRS


class Held(SymplecticEuler):
    """Like a position held by a spring as stiff as the step allows: its digit over h is a speed."""

    def rollout(self, q, v, h, n, force, every):
        z, w = super().rollout(q, v, h, n, force, every)
        return z, w + (np.round(z / LAST_DIGIT) * LAST_DIGIT - z) / h


def test_a_position_s_last_digit_that_makes_a_velocity_is_in_the_uncertainty(bench):
    made = bench(Held(), duration=12.0)
    scale = component_scale(made.motion, [])
    found = extrapolate(made.model, made.coordinates, made.motion, scale, 1e-6)
    error = np.abs(found.limit.value - made.motion.end)
    # The weights' own worst case, from the finest rung alone; most of the error is this.
    kick = LAST_DIGIT / 2 * max(found.rungs) / np.max(made.motion.lengths)
    assert np.max(error[:, 1]) > kick
    assert np.max(error / found.limit.uncertainty) < 0.7
    assert np.max(found.limit.uncertainty[:, 1]) < 1e3 * kick
