"""Extrapolated segments, and full runs: global error, order, recommended steps, energy, drift."""

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from sympy import Expr, Heaviside, Rational, sin

from physics_crosscheck import t
from physics_crosscheck.engine import Array, Force
from physics_crosscheck.harness.checks.verdict import CaseJudgement, component_scale, judge
from physics_crosscheck.harness.numerics import step_study
from physics_crosscheck.harness.numerics.convergence import Sensitivity, check_full_runs
from physics_crosscheck.harness.numerics.full_run import SampledRun, full_run
from physics_crosscheck.harness.numerics.ladder import RUNGS
from physics_crosscheck.harness.numerics.segments import (
    BlownUpError,
    Extrapolated,
    extrapolate,
    limits_only,
)
from physics_crosscheck.harness.numerics.step_study import StepStudy, decompose, study_step
from physics_crosscheck.harness.records.case import ErrorDecomposition
from physics_crosscheck.records import Outcome
from physics_crosscheck.reference.solving.segments import Motion
from tests.numerics.conftest import (
    DAMPING,
    MASS,
    STIFFNESS,
    Bench,
    MakeBench,
    SymplecticEuler,
    finite,
)


def study(bench: Bench, claimed: int = 1) -> StepStudy:
    return study_step(
        bench.model,
        bench.coordinates,
        bench.motion,
        power=bench.equations.numeric_power,
        amplitude=bench.motion.amplitude,
        claimed=claimed,
    )


def decomposed(bench: Bench) -> ErrorDecomposition:
    result = study(bench).decomposition
    assert result is not None
    return result


def discrete_root(h: float, damping: float) -> complex:
    """Return ln z / h of one step of symplectic Euler: its frequency and decay in closed form."""
    matrix = np.array(
        [
            [1 - h * h * STIFFNESS / MASS, h - h * h * damping / MASS],
            [-h * STIFFNESS / MASS, 1 - h * damping / MASS],
        ]
    )
    return max((cmath.log(z) / h for z in np.linalg.eigvals(matrix)), key=lambda s: s.imag)


@pytest.mark.parametrize("damping", [DAMPING, 0.2])
def test_frequency_and_damping_errors_match_the_difference_equation(
    bench: MakeBench, damping: float
) -> None:
    rig = bench(damping=damping, duration=12.0)
    result = decomposed(rig)
    s = discrete_root(rig.model.step, damping)
    exact = complex(-damping / 2 / MASS, math.sqrt(STIFFNESS / MASS - (damping / 2 / MASS) ** 2))
    # The least squares ignore terms of second order in the error: about 1 %.
    assert result.frequency == pytest.approx(s.imag / exact.imag - 1, rel=0.03)
    assert result.damping == pytest.approx(exact.real / abs(exact) - s.real / abs(s), rel=0.03)
    assert finite(result.explained) > 0.999


@pytest.mark.slow
def test_wrong_frequency_is_reported_as_frequency_error(bench: MakeBench) -> None:
    model = SymplecticEuler(stiffness=STIFFNESS * 1.002, step=1e-4)
    result = decomposed(bench(model, duration=8.0))
    assert result.frequency == pytest.approx(1e-3, rel=0.05)
    # Half a percent of damping ratio would be 2.9e-4; the stiffness alone changes it by 6e-5.
    assert abs(finite(result.damping)) < 1e-4


def test_global_error_falls_with_the_claimed_order(bench: MakeBench) -> None:
    result = study(bench())
    assert result.full_run_check.converges
    assert result.full_run_check.order == pytest.approx(1, abs=0.1)
    assert 1e-3 < result.global_error < 1e-1


def test_recommended_step_gives_its_target_error(bench: MakeBench) -> None:
    result = study(bench())
    assert result.checked is not None
    target, h, measured = result.checked
    assert 0.5 * target < measured <= 1.05 * target
    assert h in result.steps_for
    steps = [step for step in result.steps_for if step is not None]
    assert list(result.steps_for) == sorted(steps, reverse=True)


class WrongVelocity(SymplecticEuler):
    """Correct positions, but velocities that are off by several times the position error."""

    def altered(self, z: Array, w: Array, q: Array, h: float) -> tuple[Array, Array]:
        return z, w + 15 * h


def test_recommended_step_gives_its_target_error_in_velocity(bench: MakeBench) -> None:
    rig, plain = bench(WrongVelocity(step=0.002)), bench(SymplecticEuler(step=0.002))
    result = study(rig)
    assert result.global_error == study(plain).global_error
    assert result.velocity_error > 3 * result.global_error
    rates = rig.motion.amplitude[1:]
    for target, h in zip(step_study.TARGETS, result.steps_for, strict=True):
        assert h is not None
        run = full_run(rig.model, rig.coordinates, rig.motion, rig.equations.numeric_power, h)
        error = np.max(np.abs(run.error[:, 1:]) / rates)
        assert 0.5 * target < error <= 1.05 * target
    assert result.checked is not None
    target, _, measured = result.checked
    assert 0.5 * target < measured <= 1.05 * target


def test_recommended_steps_reach_the_breaks_of_the_input(bench: MakeBench) -> None:
    result = study(bench(drive=6 * Heaviside(t - Rational(13, 10))))
    for h in result.steps_for:
        assert h is not None
        assert 1.3 / h == pytest.approx(round(1.3 / h), abs=1e-9)
    assert result.checked is not None
    target, _, measured = result.checked
    assert measured <= 1.05 * target


class Precise(SymplecticEuler):
    """The classical rule of order four, with a tiny error at usual steps."""

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        return 4, 1

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        rate = np.array([[0, 1], [-self.stiffness / self.mass, -self.damping / self.mass]])
        power = np.eye(2) + h * rate @ (
            np.eye(2) + h * rate / 2 @ (np.eye(2) + h * rate / 3 @ (np.eye(2) + h * rate / 4))
        )
        state, out = np.stack([q, v], axis=-1), []
        for _ in range(n // every):
            state = state @ np.linalg.matrix_power(power, every).T
            out.append(state)
        states = np.stack(out, axis=1)
        return self.altered(states[..., 0], states[..., 1], q, h)


def test_tiny_error_is_checked_by_coarser_runs(bench: MakeBench) -> None:
    result = study(bench(Precise(step=2e-3)), claimed=4)
    assert result.global_error < step_study.TINY_ERROR
    assert min(run.h for run in result.others) == 4e-3
    assert sum(run.steps for run in result.others) < result.base_run.steps
    assert result.full_run_check.order == pytest.approx(4, abs=0.1)
    assert result.full_run_check.converges
    assert result.full_run_check.predicted


class Rough(Precise):
    """Wrong only at the file's own time step."""

    def altered(self, z: Array, w: Array, q: Array, h: float) -> tuple[Array, Array]:
        return (z * (1 + 5e-6), w) if h == self.step else (z, w)


def test_fault_of_the_files_own_step_shows_in_coarser_runs(bench: MakeBench) -> None:
    result = study(bench(Rough(step=2e-3)), claimed=4)
    assert result.global_error < step_study.TINY_ERROR
    assert not result.full_run_check.predicted
    assert result.full_run_check.deviation == pytest.approx(5e-6, rel=0.5)


class Lazy(Precise):
    """Loses a millionth of its position once, whatever the step."""

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        z, w = super().rollout(q, v, h, n, force, every)
        if n > 40:
            z[:, z.shape[1] // 2 :] *= 1 - 1e-6
        return z, w


def test_tiny_error_independent_of_the_step_does_not_converge(bench: MakeBench) -> None:
    assert not study(bench(Lazy(step=2e-3)), claimed=4).full_run_check.converges


class Tiring(SymplecticEuler):
    """Slightly more damping after 100 steps of a run, below the error of the time step."""

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        awake = min(n, 100)
        z, w = super().rollout(q, v, h, awake, None, 1)
        if n > awake:
            tired = SymplecticEuler(damping=self.damping * (1 + 1e-3))
            more_z, more_w = tired.rollout(z[:, -1], w[:, -1], h, n - awake, None, 1)
            z, w = np.concatenate([z, more_z], axis=1), np.concatenate([w, more_w], axis=1)
        return z[:, every - 1 :: every], w[:, every - 1 :: every]


def test_memory_below_the_step_error_does_not_converge(bench: MakeBench) -> None:
    result = study(bench(Tiring()))
    assert result.full_run_check.order > 0.9  # the global error alone looks correct
    assert result.full_run_check.residual > 1e-4
    assert not result.full_run_check.converges


def test_correct_engine_has_no_residual_as_the_step_falls(bench: MakeBench) -> None:
    result = study(bench(drive=6 * Heaviside(t - Rational(13, 10))))
    assert result.full_run_check.converges
    assert result.full_run_check.residual < 1e-6


def test_run_that_blows_up_is_not_finite(bench: MakeBench) -> None:
    result = study(bench(SymplecticEuler(step=2.0)))
    assert not result.full_run_check.converges
    assert result.steps_for == (None, None, None) or result.global_error > 1


def test_energy_balances_to_the_order_of_the_step_with_input_and_damper(bench: MakeBench) -> None:
    rig = bench(drive=6 * Heaviside(t - Rational(13, 10)))
    power = rig.equations.numeric_power

    def imbalance(model: SymplecticEuler, h: float) -> float:
        return full_run(model, rig.coordinates, rig.motion, power, h).energy

    coarse, fine = imbalance(rig.model, 2e-3), imbalance(rig.model, 2e-4)
    assert fine < 2e-3
    assert coarse / fine == pytest.approx(10, rel=0.2)
    # A damper that is 10 % too weak dissipates 10 % too little.
    assert imbalance(SymplecticEuler(damping=0.9 * DAMPING), 2e-4) > 10 * fine


@dataclass
class Draining(SymplecticEuler):
    """Loses a share of the velocity in each step of one size."""

    drain: float = 1e-3
    wrong_step: float = 0.002

    def stepped(self, q: Any, v: Any, push: Any, h: float) -> Any:
        q, v = super().stepped(q, v, push, h)
        return q, v * (1 - self.drain) if h == self.wrong_step else v


@pytest.mark.parametrize("drain", [1e-3, 1e-5, -1e-4])
def test_fault_of_the_files_own_step_is_not_predicted_by_finer_steps(
    bench: MakeBench, drain: float
) -> None:
    check = study(bench(Draining(drain=drain))).full_run_check
    assert check.converges  # the two finest runs do not show it
    assert not check.predicted


@pytest.mark.parametrize("max_steps", [60_000, 2_000])
def test_fault_of_the_files_own_step_shows_in_two_runs(
    bench: MakeBench, monkeypatch: pytest.MonkeyPatch, max_steps: int
) -> None:
    monkeypatch.setattr(step_study, "MOST_STEPS", max_steps)
    assert not study(bench(Draining())).full_run_check.predicted
    assert study(bench()).full_run_check.predicted


@pytest.mark.parametrize("share", [0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99])
@pytest.mark.parametrize("damping", [0.0, DAMPING])
def test_finer_steps_predict_a_correct_engine_up_to_the_stability_limit(
    bench: MakeBench, share: float, damping: float
) -> None:
    limit = 2 / math.sqrt(STIFFNESS / MASS)
    if damping:  # the damper is explicit in v, so its limit is lower
        limit *= 0.9
    model = SymplecticEuler(damping=damping, step=share * limit)
    check = study(bench(model, damping=damping, duration=12.0)).full_run_check
    assert check.converges
    assert check.predicted


def oscillation(times: Array, a: complex, s: complex) -> Array:
    values: Array = (a * np.exp(s * times)).real
    return values


@pytest.mark.parametrize("damping", [0.9, 3.0, 8.0])
def test_amplitude_and_phase_match_an_exact_oscillation(bench: MakeBench, damping: float) -> None:
    rig = bench(damping=damping, duration=4.0)
    pole = complex(-damping / 2 / MASS, math.sqrt(STIFFNESS / MASS - (damping / 2 / MASS) ** 2))
    # q(0) = 0.25 and v(0) = -0.4.
    a = complex(0.25, -(-0.4 - pole.real * 0.25) / pole.imag)
    other, moved = a * (1 + 2e-4) * cmath.exp(-3e-4j), pole + complex(-2e-4, 3e-4)
    times = np.linspace(0, 4.0, 801)
    assert rig.motion.states_at(times)[:, 0] == pytest.approx(
        oscillation(times, a, pole), abs=1e-12
    )
    result = decompose(times, oscillation(times, other, moved), rig.motion, 0)
    change = other / a * cmath.exp((moved - pole) * 4.0)
    assert result.amplitude == pytest.approx(abs(change) - 1, rel=0.01)
    assert finite(result.explained) > 0.99999


def runs_of(error: Callable[[float, Array], Array], motion: Motion) -> list[SampledRun]:
    """Return six runs, each of half the step, with errors (S,) as a function of step and time."""
    times = np.linspace(0, motion.duration, 301)
    runs = []
    for i in range(6):
        h = 0.01 / 2**i
        off = np.stack([error(h, times), np.zeros_like(times)], axis=1)
        states = motion.states_at(times) + off
        runs.append(
            SampledRun(h=h, steps=300 * 2**i, every=2**i, t=times, states=states, error=off)
        )
    return runs


def multiplied(motion: Motion, rate: float) -> Sensitivity:
    times = np.linspace(0, motion.duration, 301)
    return Sensitivity(
        t=times, growth=np.exp(rate * times), started=np.ones(301), local=1e-3, step=0.01, order=1,
    )  # fmt: skip


def test_chaotic_run_converges_until_it_is_unresolved(bench: MakeBench) -> None:
    motion = bench().motion
    size = np.array([0.25])

    def chaos(h: float, times: Array) -> Array:
        grown = 0.002 * h * np.exp(8 * times)
        # Large errors saturate at every step size.
        folded: Array = np.where(grown < 0.002, grown, 0.008)
        return folded

    runs = runs_of(chaos, motion)
    assert not check_full_runs(runs, 1, size, motion).converges
    result = check_full_runs(runs, 1, size, motion, multiplied(motion, 8.0))
    assert result.converges
    assert result.partly_chaotic
    assert 0 < result.until < 1.0


def test_error_carried_between_steps_is_not_chaos(bench: MakeBench) -> None:
    motion = bench().motion
    size = np.array([0.25])
    runs = runs_of(lambda h, times: (h + 0.003) * 0.25 * times, motion)
    assert not check_full_runs(runs, 1, size, motion).converges
    assert not check_full_runs(runs, 1, size, motion, multiplied(motion, 0.0)).converges


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
