"""Rounding observed in companions is in the uncertainty of every limit, at any precision."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from physics_crosscheck.engine import Array
from physics_crosscheck.harness.baseline.measure import ends as snapshot_ends
from physics_crosscheck.harness.baseline.measure import segments_of, snapshot_of
from physics_crosscheck.harness.checks.verdict import judge
from physics_crosscheck.harness.commands.compare.segments import ends as compared_ends
from physics_crosscheck.harness.diagnosis.samples import (
    engine_ends,
    reference_ends,
    sample_segments,
)
from physics_crosscheck.harness.numerics.accelerations import Accelerations
from physics_crosscheck.harness.numerics.judgement import resolvable
from physics_crosscheck.harness.numerics.ladder import RUNGS, limits
from physics_crosscheck.harness.numerics.rounding import Starts, with_companions
from physics_crosscheck.harness.numerics.segments import (
    Extrapolated,
    Observable,
    climb,
    extrapolate,
)
from physics_crosscheck.harness.numerics.step_study import study_step
from physics_crosscheck.records import Outcome
from physics_crosscheck.reference.dynamics.linearize import linearize
from physics_crosscheck.reference.solving.segments import Segments
from tests.numerics.conftest import (
    DAMPING,
    MASS,
    STIFFNESS,
    Bench,
    Coarse,
    MakeBench,
    SymplecticEuler,
)
from tests.numerics.test_discrete import linear_matrix

EPSILON = float(np.finfo(float).eps)

LAST_DIGIT = 2.0**-40


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


def test_rounding_common_to_all_runs_is_in_the_uncertainty(monkeypatch: pytest.MonkeyPatch) -> None:
    assert np.max(off(4.0)) < 1
    assert np.max(off(1e4)) > 1  # a fault of a few more digits is not covered
    monkeypatch.setattr(Starts, "last_digits", lambda self, values: np.zeros(values.shape[1]))
    assert np.max(off(4.0)) > 10
    assert np.max(off(0.0)) < 1


class Held(SymplecticEuler):
    """Turns the last digit of a position into a velocity, like a spring at the stability limit."""

    def altered(self, z: Array, w: Array, q: Array, h: float) -> tuple[Array, Array]:
        return z, w + (np.round(z / LAST_DIGIT) * LAST_DIGIT - z) / h


def test_position_rounding_that_changes_velocity_is_in_the_uncertainty(bench: MakeBench) -> None:
    rig = bench(Held(), duration=12.0)
    result = extrapolate(rig.model, rig.coordinates, rig.motion, resolution=1e-6)
    error = np.abs(result.limit.value - rig.motion.end)
    # The worst case of the weights, from the finest rung alone, dominates the error.
    kick = LAST_DIGIT / 2 * max(result.rungs) / np.max(rig.motion.lengths)
    assert np.max(error[:, 1]) > kick
    assert np.max(error / result.limit.uncertainty) < 0.7
    assert np.max(result.limit.uncertainty[:, 1]) < 1e3 * kick


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


def test_correct_model_agrees_to_single_precision(bench: MakeBench) -> None:
    rig = bench(Single())
    result, scale = run(rig)
    judgement = judge(result.limit, rig.motion, NAMES, 1, 1e-9)
    assert judgement.outcome is Outcome.AGREES
    assert judgement.largest_discrepancy < judgement.largest_uncertainty < 1e-4
    assert "24 binary digits" in judgement.reason
    assert f"known to {judgement.largest_uncertainty:.1e}" in judgement.reason
    assert resolvable(result.limit, scale / 1e4, 1e-9) == 1e-2  # half a digit is no agreement


def test_stiffness_off_by_a_thousandth_differs(bench: MakeBench) -> None:
    rig = bench(Single(stiffness=47.0 * 1.001))
    judgement = judge(run(rig)[0].limit, rig.motion, NAMES, 1, 1e-9)
    assert judgement.outcome is Outcome.DIFFERS
    assert judgement.discrepancy == pytest.approx(1e-3, rel=0.1)


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


Errors = Callable[[Bench], Array]
"""Return the errors of limits relative to their uncertainties."""


def verdict(bench: Bench) -> Array:
    batch = bench.motion
    limit = extrapolate(bench.model, bench.coordinates, batch, resolution=1e-6).limit
    return np.abs(limit.value - bench.motion.end) / limit.uncertainty


def diagnosis(bench: Bench) -> Array:
    motions = {"only": bench.motion}
    samples = sample_segments(motions)
    ends, uncertainty = engine_ends(bench.model, bench.coordinates, samples)
    return np.abs(ends - reference_ends(samples)) / uncertainty


def snapshot(bench: Bench) -> Array:
    segments = segments_of(snapshot_of(bench.motion, "only", ("x", "x_dot"), ("F",)))
    end, uncertainty = snapshot_ends(bench.model, bench.coordinates, segments)
    return np.abs(end - segments.end) / uncertainty


def compare(bench: Bench) -> Array:
    start = bench.motion.start[::5]
    runs = Segments.unsolved(start, float(bench.motion.lengths[0]), np.zeros((len(start), 1)))
    limit = compared_ends(bench.model, runs, None, 1e-6).limit
    return np.abs(limit.value - bench.motion.end[::5]) / limit.uncertainty


def linearization(bench: Bench) -> Array:
    taylor = linearize(bench.equations, bench.system.equilibria[0])
    _, matrix = linear_matrix(bench)
    wanted = np.hstack([taylor.arrays["A"], taylor.arrays["B"]])
    return np.abs(matrix.value[:2] - wanted) / matrix.uncertainty[:2]


def accelerations(bench: Bench) -> Array:
    states = bench.motion.start[::5]
    speed = bench.motion.amplitude[1:]
    measured = Accelerations(
        model=bench.model, coordinates=bench.coordinates, speed=speed, fastest=bench.motion.fastest
    )
    forces = np.linspace(-3.0, 3.0, len(states))[:, None]
    result = measured.measure(states, np.zeros((len(states), 1)), forces)
    wanted = (forces - STIFFNESS * states[:, :1] - DAMPING * states[:, 1:]) / MASS
    return np.abs(result.value - wanted) / result.uncertainty


EVERYWHERE = [
    (verdict, 35),
    (diagnosis, 35),
    (snapshot, 35),
    (compare, 35),
    (linearization, 35),
    # Changes over such short steps have fewer digits, even in doubles.
    (accelerations, 33),
]


@pytest.mark.parametrize(("errors", "bits"), EVERYWHERE)
def test_coarse_rounding_is_in_the_uncertainty(bench: MakeBench, errors: Errors, bits: int) -> None:
    assert np.max(errors(bench(Coarse(bits=bits)))) < 0.5


@pytest.mark.parametrize(("errors", "bits"), EVERYWHERE)
def test_only_companions_show_the_rounding(
    bench: MakeBench, errors: Errors, bits: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def nothing(starts: Starts, values: Array) -> Array:
        return np.zeros(values.shape[1])

    monkeypatch.setattr(Starts, "observed_rounding", nothing)
    assert np.max(errors(bench(Coarse(bits=bits)))) > 2


@pytest.mark.parametrize("errors", [each for each, _ in EVERYWHERE])
def test_engine_without_coarse_rounding_keeps_a_small_uncertainty(
    bench: MakeBench, errors: Errors
) -> None:
    ratios = errors(bench())
    assert np.max(ratios) < 0.5
    # A huge uncertainty would pass the bound above without being useful.
    assert np.median(ratios) > 5e-4


@pytest.mark.parametrize("errors", [each for each, _ in EVERYWHERE])
def test_rounding_is_in_the_uncertainty_wherever_a_limit_is_taken(
    bench: MakeBench, errors: Errors
) -> None:
    assert np.max(errors(bench(Single()))) < 1
