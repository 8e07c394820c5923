"""Extrapolated segments, defects and verdicts, with an engine of a few lines."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from sympy import Expr, Heaviside, Rational, sin

from physics_crosscheck import t
from physics_crosscheck.engine import Array
from physics_crosscheck.harness.checks.verdict import CaseJudgement, component_scale, judge
from physics_crosscheck.harness.numerics.ladder import RUNGS
from physics_crosscheck.harness.numerics.segments import (
    BlownUpError,
    Extrapolated,
    extrapolate,
    limits_only,
)
from physics_crosscheck.records import Outcome
from tests.numerics.conftest import STIFFNESS, Bench, MakeBench, SymplecticEuler

NAMES = ("x", "x_dot")


def verdict(bench: Bench, resolution: float = 1e-9) -> tuple[CaseJudgement, Extrapolated]:
    batch = bench.motion
    result = extrapolate(bench.model, bench.coordinates, batch, resolution=resolution)
    claimed = bench.model.exponents(False)[0]
    return judge(result.limit, batch, NAMES, claimed, resolution), result


@pytest.mark.parametrize("drive", [0, 6 * Heaviside(t - Rational(13, 10)), sin(5 * t) + t / 3])
def test_correct_engine_agrees_one_digit_below_the_resolution(
    bench: MakeBench, drive: Expr | int
) -> None:
    usual, quick = verdict(bench(drive=drive))
    result, whole = verdict(bench(drive=drive), resolution=1e-11)
    for judgement, bound in ((usual, 1e-10), (result, 1e-11)):
        assert judgement.outcome is Outcome.AGREES
        assert judgement.discrepancy <= judgement.uncertainty < bound
        assert judgement.order == pytest.approx(1, abs=0.1)
    assert quick.steps < whole.steps


@pytest.mark.parametrize("fault", [1e-6, 1e-8, 1e-10])
@pytest.mark.parametrize("literal", ["mass", "damping", "stiffness"])
def test_wrong_literal_differs_by_its_fault(bench: MakeBench, literal: str, fault: float) -> None:
    model = SymplecticEuler()
    setattr(model, literal, getattr(model, literal) * (1 + fault))
    result, _ = verdict(bench(model), resolution=min(1e-9, fault / 100))
    assert result.outcome is Outcome.DIFFERS
    # The damper makes a twentieth of the force, so its fault reads smaller.
    assert 0.02 * fault < result.discrepancy < 2 * fault
    assert "off" in result.reason


def test_fault_below_the_floor_agrees(bench: MakeBench) -> None:
    result, _ = verdict(bench(SymplecticEuler(stiffness=STIFFNESS * (1 + 1e-14))))
    assert result.outcome is Outcome.AGREES


class TwoStages(SymplecticEuler):
    """The midpoint method: order 2, though it inherits the claim of order 1."""

    def stepped(self, q: Any, v: Any, push: Any, h: float) -> Any:
        a = (-self.stiffness * q - self.damping * v) / self.mass
        middle_q, middle_v = q + h / 2 * v, v + h / 2 * a
        a = (-self.stiffness * middle_q - self.damping * middle_v) / self.mass
        return q + h * middle_v, v + h * a


def test_wrong_claimed_order_is_unresolved(bench: MakeBench) -> None:
    result, _ = verdict(bench(TwoStages()))
    assert result.outcome is Outcome.UNRESOLVED
    assert "the engine claims 1" in result.reason
    assert "order is 2" in result.reason


class Frozen(SymplecticEuler):
    """Ends at zero on every rung, like an engine that resets itself."""

    def altered(self, z: Array, w: Array, q: Array, h: float) -> tuple[Array, Array]:
        return 0 * z, 0 * w


def test_equal_rungs_are_unresolved(bench: MakeBench) -> None:
    result, _ = verdict(bench(Frozen()))
    assert result.outcome is Outcome.UNRESOLVED
    assert "did not step" in result.reason


class Noisy(SymplecticEuler):
    """Single precision, which cannot resolve nine digits."""

    def altered(self, z: Array, w: Array, q: Array, h: float) -> tuple[Array, Array]:
        return z.astype(np.float32).astype(float), w.astype(np.float32).astype(float)


def test_single_precision_is_unresolved_at_nine_digits_but_not_at_four(bench: MakeBench) -> None:
    assert verdict(bench(Noisy()))[0].outcome is Outcome.UNRESOLVED
    assert verdict(bench(Noisy()), resolution=1e-3)[0].outcome is Outcome.AGREES


def test_coarse_fault_is_seen_through_single_precision(bench: MakeBench) -> None:
    result, _ = verdict(bench(Noisy(stiffness=STIFFNESS * 1.05)))
    assert result.outcome is Outcome.DIFFERS


class Stop(SymplecticEuler):
    """An inelastic stop at x = -0.1."""

    def stepped(self, q: Any, v: Any, push: Any, h: float) -> Any:
        q, v = super().stepped(q, v, push, h)
        return np.where(q < -0.1, -0.1, q), np.where(q < -0.1, 0.0, v)


def test_undeclared_stop_never_agrees(bench: MakeBench) -> None:
    result, _ = verdict(bench(Stop()))
    assert result.outcome in (Outcome.DIFFERS, Outcome.UNRESOLVED)
    assert result.discrepancy > 1e-2


class Exploding(SymplecticEuler):
    def altered(self, z: Array, w: Array, q: Array, h: float) -> tuple[Array, Array]:
        z[3] = np.nan
        return z, w


def test_values_that_are_not_finite_are_reported_with_their_time(bench: MakeBench) -> None:
    with pytest.raises(BlownUpError, match=r"not finite, from the segment at t = 0\.0"):
        verdict(bench(Exploding()))


def test_every_rung_takes_a_whole_number_of_steps_to_each_break_of_the_input(
    bench: MakeBench,
) -> None:
    rig = bench(drive=6 * Heaviside(t - Rational(13, 10)))
    _, result = verdict(rig)
    before, after = rig.motion.spans
    assert before.start + before.length * before.count == pytest.approx(1.3, abs=1e-15)
    assert {(h, n) for h, n, _ in rig.model.calls} == {
        (span.length / rung, rung) for span in (before, after) for rung in result.rungs
    }


def test_steps_are_counted(bench: MakeBench) -> None:
    rig = bench()
    _, result = verdict(rig)
    assert result.steps == sum(n * batch for _, n, batch in rig.model.calls)


def test_other_scenarios_bound_the_scale_of_a_fixed_component(bench: MakeBench) -> None:
    moving, still = bench().motion, bench(duration=1.0).motion
    quiet = replace(still, start=0 * still.start, end=0 * still.end, nodes=0 * still.nodes)
    assert component_scale(quiet, [moving]) == pytest.approx(0.01 * moving.movement)
    assert np.all(component_scale(quiet, [quiet]) > 0)


def test_all_rungs_are_run_where_no_resolution_is_given(bench: MakeBench) -> None:
    rig = bench()
    batch = rig.motion
    result = extrapolate(rig.model, rig.coordinates, batch, rungs=RUNGS[:8])
    assert result.rungs == RUNGS[:8]
    assert np.all(np.abs(result.limit.value - rig.motion.end) <= result.limit.uncertainty)


def test_limits_only_matches_all_rungs_without_companion_steps(bench: MakeBench) -> None:
    rig = bench(drive=sin(5 * t))
    batch = rig.motion
    values = limits_only(rig.model, rig.coordinates, batch, RUNGS[:6])
    assert sum(n * count for _, n, count in rig.model.calls) == sum(RUNGS[:6]) * len(rig.motion.t)
    whole = extrapolate(rig.model, rig.coordinates, batch, rungs=RUNGS[:6])
    assert np.array_equal(values, whole.limit.value)


class Bursting(SymplecticEuler):
    """Not finite from starts with x > 0.1."""

    def altered(self, z: Array, w: Array, q: Array, h: float) -> tuple[Array, Array]:
        return np.where(q[:, None] > 0.1, np.nan, z), w


def test_partial_batch_has_limits_only_of_finite_motions(bench: MakeBench) -> None:
    rig = bench(Bursting())
    batch = rig.motion
    limit = extrapolate(rig.model, rig.coordinates, batch, resolution=1e-9, partial=True).limit
    lost = rig.motion.start[:, 0] > 0.1
    assert 0 < np.sum(lost) < len(lost)
    assert np.all(np.isinf(limit.uncertainty[lost]))
    error = np.abs(limit.value - rig.motion.end)[~lost]
    assert np.all(error <= limit.uncertainty[~lost])
    assert np.max(limit.uncertainty[~lost]) < 1e-9


def test_partial_batch_without_finite_motions_is_an_error(bench: MakeBench) -> None:
    rig = bench(Bursting())
    whole = rig.motion
    still = replace(whole, start=np.abs(whole.start) + 1)
    with pytest.raises(BlownUpError, match="no motion is finite"):
        extrapolate(rig.model, rig.coordinates, still, resolution=1e-9, partial=True)


def test_batch_without_a_scale_uses_its_range_of_motion(bench: MakeBench) -> None:
    rig = bench()
    batch = replace(rig.motion, scale=None)
    unscaled = extrapolate(rig.model, rig.coordinates, batch, rungs=RUNGS, partial=True).limit
    given = replace(batch, scale=rig.motion.movement)
    scaled = extrapolate(rig.model, rig.coordinates, given, rungs=RUNGS).limit
    assert unscaled.increments == pytest.approx(scaled.increments, rel=0.1)
