"""An engine that computes in 32 bits: what it knows is told, and no model is blamed for it."""

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import pytest

from physics_crosscheck.harness.checks.verdict import judge
from physics_crosscheck.harness.engines.protocol import Array, Force, StateForce
from physics_crosscheck.harness.numerics.judgement import resolvable
from physics_crosscheck.harness.numerics.ladder import (
    EPSILON,
    RUNGS,
    exact_weights,
    least_weights,
    limits,
)
from physics_crosscheck.harness.numerics.rounding import quantization_error
from physics_crosscheck.harness.numerics.segments import Extrapolated, extrapolate
from physics_crosscheck.harness.numerics.step_study import study_step
from physics_crosscheck.harness.records.outcome import Outcome
from tests.numerics.conftest import Bench, MakeBench, SymplecticEuler
from tests.numerics.test_coarse_rounding import EVERYWHERE, Errors

SINGLE = float(np.finfo(np.float32).eps)
NAMES = ("x", "x_dot")


@dataclass
class Single(SymplecticEuler):
    """The oscillator in numbers of 24 binary digits, every operation."""

    epsilon: float = SINGLE

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        assert not isinstance(force, StateForce)
        m, c, k, step = (np.float32(x) for x in (self.mass, self.damping, self.stiffness, h))
        x, speed = q.astype(np.float32), v.astype(np.float32)
        push = None if force is None else force.astype(np.float32)
        at, fast = [], []
        for i in range(n):
            pushed = np.float32(0) if push is None else push[:, i]
            speed = speed + step * (pushed - k * x - c * speed) / m
            x = x + step * speed
            if (i + 1) % every == 0:
                at.append(x)
                fast.append(speed)
        return np.stack(at, axis=1).astype(float), np.stack(fast, axis=1).astype(float)


def run(made: Bench) -> tuple[Extrapolated, Array]:
    batch = made.motion
    return extrapolate(made.model, made.coordinates, batch, resolution=1e-9), batch.unit


@pytest.mark.parametrize("removed", range(6))
def test_weights_of_least_variance_cancel_the_powers_that_they_are_to(removed: int) -> None:
    found = least_weights(RUNGS, (1, 1), removed)
    for power in range(removed + 1):
        left = np.sum(found / np.array(RUNGS, dtype=float) ** power)
        assert left == pytest.approx(float(power == 0), abs=1e-9)


def test_no_other_weights_that_cancel_as_much_amplify_rounding_less() -> None:
    found = least_weights(RUNGS, (1, 1), 3)
    n = np.array(RUNGS, dtype=float)
    rows = np.stack([n**-e for e in range(4)])
    free = np.linalg.svd(rows)[2][4:]  # what may be added: it cancels everything
    assert np.max(np.abs(free @ (n * found))) < 1e-10 * np.max(np.abs(n * found))
    assert np.sum(np.abs(found)) == pytest.approx(3.2, abs=0.05)
    assert sum(map(abs, exact_weights(RUNGS, 1, 1))) > Fraction(59)


def test_a_sound_model_agrees_to_the_digits_that_its_engine_has(bench: MakeBench) -> None:
    made = bench(Single())
    found, scale = run(made)
    told = judge(found.limit, made.motion, NAMES, 1, 1e-9)
    assert told.outcome is Outcome.AGREES
    assert told.largest_discrepancy < told.largest_uncertainty < 1e-4
    assert "24 binary digits" in told.reason
    assert f"known to {told.largest_uncertainty:.1e}" in told.reason
    assert told.largest_uncertainty <= resolvable(found.limit, scale, 1e-9) < 2e-4


def test_a_stiffness_off_by_a_thousandth_differs_all_the_same(bench: MakeBench) -> None:
    made = bench(Single(stiffness=47.0 * 1.001))
    told = judge(run(made)[0].limit, made.motion, NAMES, 1, 1e-9)
    assert told.outcome is Outcome.DIFFERS
    assert told.discrepancy == pytest.approx(1e-3, rel=0.1)


def test_doubles_are_asked_for_what_is_asked(bench: MakeBench) -> None:
    found, scale = run(bench())
    assert resolvable(found.limit, scale, 1e-13) == 1e-13


def test_exact_weights_would_lose_most_of_the_digits(bench: MakeBench) -> None:
    made = bench(Single())
    found, scale = run(made)
    raw = list(found.raw)
    least, exact = (
        limits(raw, RUNGS, (1, 1), scale, scale, epsilon=epsilon) for epsilon in (SINGLE, EPSILON)
    )
    errors = [np.max(np.abs(one.value - made.motion.end) / scale) for one in (least, exact)]
    assert errors[0] < errors[1] / 3


def test_the_runs_from_start_to_end_of_a_sound_model_bear_it_out(bench: MakeBench) -> None:
    made = bench(Single(step=0.0005))
    study = study_step(
        made.model,
        made.coordinates,
        made.motion,
        power=made.equations.numeric_power,
        amplitude=made.motion.amplitude,
        claimed=1,
    )
    assert study.full_run_check.converges
    assert study.full_run_check.predicted


@pytest.mark.parametrize("errors", [each for each, _ in EVERYWHERE])
def test_rounding_is_in_the_uncertainty_wherever_a_limit_is_taken(
    bench: MakeBench, errors: Errors
) -> None:
    assert np.max(errors(bench(Single()))) < 1


def test_what_is_not_held_is_what_single_numbers_round_away() -> None:
    values = np.random.default_rng(3).normal(size=(50, 2)) * 10.0 ** np.arange(-9, 16, 0.5)[:, None]
    held = values.astype(np.float32).astype(float)
    assert np.array_equal(quantization_error(values, SINGLE), values - held)
    assert not quantization_error(values, EPSILON).any()
