"""An engine that computes in 32 bits: its precision is reported and not attributed to the model."""

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from physics_crosscheck.engine import Array
from physics_crosscheck.harness.checks.verdict import judge
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
from physics_crosscheck.records import Outcome
from tests.numerics.conftest import Bench, MakeBench, SymplecticEuler
from tests.numerics.test_coarse_rounding import EVERYWHERE, Errors

SINGLE = float(np.finfo(np.float32).eps)
NAMES = ("x", "x_dot")


@dataclass
class Single(SymplecticEuler):
    """The oscillator with every operation in 24 binary digits."""

    epsilon: float = SINGLE

    def stepped(self, q: Any, v: Any, push: Any, h: float) -> Any:
        m, c, k, step = (np.float32(x) for x in (self.mass, self.damping, self.stiffness, h))
        q, v, push = (np.float32(x) for x in (q, v, push))
        v = v + step * (push - k * q - c * v) / m
        return q + step * v, v

    def altered(self, z: Array, w: Array, q: Array, h: float) -> tuple[Array, Array]:
        return z.astype(float), w.astype(float)


def run(bench: Bench) -> tuple[Extrapolated, Array]:
    batch = bench.motion
    return extrapolate(bench.model, bench.coordinates, batch, resolution=1e-9), batch.unit


@pytest.mark.parametrize("removed", range(6))
def test_weights_of_least_variance_cancel_their_powers(removed: int) -> None:
    least = least_weights(RUNGS, (1, 1), removed)
    for power in range(removed + 1):
        power_sum = np.sum(least / np.array(RUNGS, dtype=float) ** power)
        assert power_sum == pytest.approx(float(power == 0), abs=1e-9)


def test_least_weights_amplify_rounding_least() -> None:
    least = least_weights(RUNGS, (1, 1), 3)
    n = np.array(RUNGS, dtype=float)
    rows = np.stack([n**-e for e in range(4)])
    free = np.linalg.svd(rows)[2][4:]  # the null space: it cancels every power
    assert np.max(np.abs(free @ (n * least))) < 1e-10 * np.max(np.abs(n * least))
    assert np.sum(np.abs(least)) == pytest.approx(3.2, abs=0.05)
    assert sum(map(abs, exact_weights(RUNGS, 1, 1))) > Fraction(59)


def test_correct_model_agrees_to_single_precision(bench: MakeBench) -> None:
    rig = bench(Single())
    result, scale = run(rig)
    judgement = judge(result.limit, rig.motion, NAMES, 1, 1e-9)
    assert judgement.outcome is Outcome.AGREES
    assert judgement.largest_discrepancy < judgement.largest_uncertainty < 1e-4
    assert "24 binary digits" in judgement.reason
    assert f"known to {judgement.largest_uncertainty:.1e}" in judgement.reason
    assert judgement.largest_uncertainty <= resolvable(result.limit, scale, 1e-9) < 2e-4


def test_stiffness_off_by_a_thousandth_differs(bench: MakeBench) -> None:
    rig = bench(Single(stiffness=47.0 * 1.001))
    judgement = judge(run(rig)[0].limit, rig.motion, NAMES, 1, 1e-9)
    assert judgement.outcome is Outcome.DIFFERS
    assert judgement.discrepancy == pytest.approx(1e-3, rel=0.1)


def test_doubles_resolve_the_requested_resolution(bench: MakeBench) -> None:
    result, scale = run(bench())
    assert resolvable(result.limit, scale, 1e-13) == 1e-13


def test_exact_weights_would_lose_most_of_the_digits(bench: MakeBench) -> None:
    rig = bench(Single())
    result, scale = run(rig)
    raw = list(result.raw)
    least, exact = (
        limits(raw, RUNGS, (1, 1), scale, scale, epsilon=epsilon) for epsilon in (SINGLE, EPSILON)
    )
    errors = [np.max(np.abs(one.value - rig.motion.end) / scale) for one in (least, exact)]
    assert errors[0] < errors[1] / 3


def test_full_runs_of_a_correct_model_converge(bench: MakeBench) -> None:
    rig = bench(Single(step=0.0005))
    study = study_step(
        rig.model,
        rig.coordinates,
        rig.motion,
        power=rig.equations.numeric_power,
        amplitude=rig.motion.amplitude,
        claimed=1,
    )
    assert study.full_run_check.converges
    assert study.full_run_check.predicted


@pytest.mark.parametrize("errors", [each for each, _ in EVERYWHERE])
def test_rounding_is_in_the_uncertainty_wherever_a_limit_is_taken(
    bench: MakeBench, errors: Errors
) -> None:
    assert np.max(errors(bench(Single()))) < 1


def test_quantization_error_is_the_rounding_to_single_precision() -> None:
    values = np.random.default_rng(3).normal(size=(50, 2)) * 10.0 ** np.arange(-9, 16, 0.5)[:, None]
    held = values.astype(np.float32).astype(float)
    assert np.array_equal(quantization_error(values, SINGLE), values - held)
    assert not quantization_error(values, EPSILON).any()
