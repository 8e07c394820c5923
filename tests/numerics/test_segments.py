"""Extrapolated segments, defects and verdicts, with an engine of a few lines."""

from dataclasses import replace

import numpy as np
import pytest
from sympy import Expr, Heaviside, Rational, sin

from physics_crosscheck import t
from physics_crosscheck.harness.checks.verdict import CaseJudgement, component_scale, judge
from physics_crosscheck.harness.engines.protocol import Array, Force
from physics_crosscheck.harness.numerics.ladder import RUNGS
from physics_crosscheck.harness.numerics.segments import (
    BlownUpError,
    Extrapolated,
    extrapolate,
    limits_only,
)
from physics_crosscheck.harness.records.outcome import Outcome
from tests.numerics.conftest import MASS, STIFFNESS, Bench, MakeBench, SymplecticEuler

NAMES = ("x", "x_dot")


def verdict(bench: Bench, resolution: float = 1e-9) -> tuple[CaseJudgement, Extrapolated]:
    batch = bench.motion
    found = extrapolate(bench.model, bench.coordinates, batch, resolution=resolution)
    claimed = bench.model.exponents(False)[0]
    return judge(found.limit, batch, NAMES, claimed, resolution), found


@pytest.mark.parametrize("drive", [0, 6 * Heaviside(t - Rational(13, 10)), sin(5 * t) + t / 3])
def test_a_right_engine_agrees_to_a_digit_more_than_is_asked(
    bench: MakeBench, drive: Expr | int
) -> None:
    usual, quick = verdict(bench(drive=drive))
    found, whole = verdict(bench(drive=drive), resolution=1e-11)
    for one, most in ((usual, 1e-10), (found, 1e-11)):
        assert one.outcome is Outcome.AGREES
        assert one.discrepancy <= one.uncertainty < most
        assert one.order == pytest.approx(1, abs=0.1)
    assert quick.steps < whole.steps


@pytest.mark.parametrize("fault", [1e-6, 1e-8, 1e-10])
@pytest.mark.parametrize("literal", ["mass", "damping", "stiffness"])
def test_a_wrong_literal_differs_by_its_fault(bench: MakeBench, literal: str, fault: float) -> None:
    model = SymplecticEuler()
    setattr(model, literal, getattr(model, literal) * (1 + fault))
    found, _ = verdict(bench(model), resolution=min(1e-9, fault / 100))
    assert found.outcome is Outcome.DIFFERS
    # The damper makes a twentieth of the force, so its fault reads smaller.
    assert 0.02 * fault < found.discrepancy < 2 * fault
    assert "off" in found.reason


def test_a_fault_below_the_floor_agrees(bench: MakeBench) -> None:
    found, _ = verdict(bench(SymplecticEuler(stiffness=STIFFNESS * (1 + 1e-14))))
    assert found.outcome is Outcome.AGREES


class TwoStages(SymplecticEuler):
    """The midpoint method: order 2, though it inherits the claim of order 1."""

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        q, v = q.copy(), v.copy()
        for _ in range(n):
            a = (-self.stiffness * q - self.damping * v) / self.mass
            middle_q, middle_v = q + h / 2 * v, v + h / 2 * a
            q = q + h * middle_v
            v = v + h * (-self.stiffness * middle_q - self.damping * middle_v) / self.mass
        return q[:, None], v[:, None]


def test_an_order_that_is_not_the_claimed_one_leaves_no_digit(bench: MakeBench) -> None:
    found, _ = verdict(bench(TwoStages()))
    assert found.outcome is Outcome.UNRESOLVED
    assert "the engine claims 1" in found.reason
    assert "order is 2" in found.reason


class Frozen(SymplecticEuler):
    """Returns its start: what an engine that resets itself does to every rung."""

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        return 0 * q[:, None], 0 * v[:, None]


def test_rungs_that_are_all_the_same_are_no_answer(bench: MakeBench) -> None:
    found, _ = verdict(bench(Frozen()))
    assert found.outcome is Outcome.UNRESOLVED
    assert "did not step" in found.reason


class Noisy(SymplecticEuler):
    """Single precision: the limit can't be known to nine digits."""

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        z, w = super().rollout(q, v, h, n, force, every)
        return z.astype(np.float32).astype(float), w.astype(np.float32).astype(float)


def test_single_precision_is_unresolved_at_nine_digits_but_not_at_four(bench: MakeBench) -> None:
    assert verdict(bench(Noisy()))[0].outcome is Outcome.UNRESOLVED
    assert verdict(bench(Noisy()), resolution=1e-3)[0].outcome is Outcome.AGREES


def test_a_coarse_fault_is_seen_through_single_precision(bench: MakeBench) -> None:
    found, _ = verdict(bench(Noisy(stiffness=STIFFNESS * 1.05)))
    assert found.outcome is Outcome.DIFFERS


class Stop(SymplecticEuler):
    """An inelastic stop at x = -0.1."""

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        q, v = q.copy(), v.copy()
        for _ in range(n):
            v = v + h * (-self.stiffness * q - self.damping * v) / MASS
            q = q + h * v
            hit = q < -0.1
            q, v = np.where(hit, -0.1, q), np.where(hit, 0.0, v)
        return q[:, None], v[:, None]


def test_a_stop_on_the_way_never_agrees(bench: MakeBench) -> None:
    found, _ = verdict(bench(Stop()))
    assert found.outcome in (Outcome.DIFFERS, Outcome.UNRESOLVED)
    assert found.discrepancy > 1e-2


class Exploding(SymplecticEuler):
    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        z, w = super().rollout(q, v, h, n, force, every)
        z[3] = np.nan
        return z, w


def test_values_that_are_not_finite_are_told_with_their_time(bench: MakeBench) -> None:
    with pytest.raises(BlownUpError, match=r"not finite, from the segment at t = 0\.0"):
        verdict(bench(Exploding()))


def test_every_rung_takes_a_whole_number_of_steps_to_each_break_of_the_input(
    bench: MakeBench,
) -> None:
    made = bench(drive=6 * Heaviside(t - Rational(13, 10)))
    _, found = verdict(made)
    before, after = made.motion.spans
    assert before.start + before.length * before.count == pytest.approx(1.3, abs=1e-15)
    assert {(h, n) for h, n, _ in made.model.calls} == {
        (span.length / rung, rung) for span in (before, after) for rung in found.rungs
    }


def test_steps_are_counted(bench: MakeBench) -> None:
    made = bench()
    _, found = verdict(made)
    assert found.steps == sum(n * batch for _, n, batch in made.model.calls)


def test_the_scale_of_a_still_component_is_floored_by_the_other_scenarios(bench: MakeBench) -> None:
    moving, still = bench().motion, bench(duration=1.0).motion
    quiet = replace(still, start=0 * still.start, end=0 * still.end, nodes=0 * still.nodes)
    assert component_scale(quiet, [moving]) == pytest.approx(0.01 * moving.movement)
    assert np.all(component_scale(quiet, [quiet]) > 0)


def test_all_rungs_are_run_where_no_resolution_is_given(bench: MakeBench) -> None:
    made = bench()
    batch = made.motion
    found = extrapolate(made.model, made.coordinates, batch, rungs=RUNGS[:8])
    assert found.rungs == RUNGS[:8]
    assert np.all(np.abs(found.limit.value - made.motion.end) <= found.limit.uncertainty)


def test_limits_alone_are_those_of_all_rungs_without_a_companion_s_step(bench: MakeBench) -> None:
    made = bench(drive=sin(5 * t))
    batch = made.motion
    alone = limits_only(made.model, made.coordinates, batch, RUNGS[:6])
    assert sum(n * count for _, n, count in made.model.calls) == sum(RUNGS[:6]) * len(made.motion.t)
    whole = extrapolate(made.model, made.coordinates, batch, rungs=RUNGS[:6])
    assert np.array_equal(alone, whole.limit.value)


class Bursting(SymplecticEuler):
    """Not finite from starts to the right of a place."""

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        z, w = super().rollout(q, v, h, n, force, every)
        return np.where(q[:, None] > 0.1, np.nan, z), w


def test_of_a_partial_batch_what_is_not_finite_has_no_limit_and_the_rest_has(
    bench: MakeBench,
) -> None:
    made = bench(Bursting())
    batch = made.motion
    found = extrapolate(made.model, made.coordinates, batch, resolution=1e-9, partial=True).limit
    lost = made.motion.start[:, 0] > 0.1
    assert 0 < np.sum(lost) < len(lost)
    assert np.all(np.isinf(found.uncertainty[lost]))
    error = np.abs(found.value - made.motion.end)[~lost]
    assert np.all(error <= found.uncertainty[~lost])
    assert np.max(found.uncertainty[~lost]) < 1e-9


def test_a_partial_batch_of_which_nothing_is_finite_is_blown_up(bench: MakeBench) -> None:
    made = bench(Bursting())
    whole = made.motion
    still = replace(whole, start=np.abs(whole.start) + 1)
    with pytest.raises(BlownUpError, match="no motion is finite"):
        extrapolate(made.model, made.coordinates, still, resolution=1e-9, partial=True)


def test_without_a_scale_a_batch_is_measured_by_how_far_it_moves(bench: MakeBench) -> None:
    made = bench()
    batch = replace(made.motion, scale=None)
    own = extrapolate(made.model, made.coordinates, batch, rungs=RUNGS, partial=True).limit
    given = replace(batch, scale=made.motion.movement)
    same = extrapolate(made.model, made.coordinates, given, rungs=RUNGS).limit
    assert own.increments == pytest.approx(same.increments, rel=0.1)
