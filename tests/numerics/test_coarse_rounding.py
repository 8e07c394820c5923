"""An engine with coarse rounding: the uncertainty of every limit includes it."""

from collections.abc import Callable

import numpy as np
import pytest

from physics_crosscheck.harness.baseline.measure import ends as snapshot_ends
from physics_crosscheck.harness.baseline.measure import segments_of, snapshot_of
from physics_crosscheck.harness.commands.compare.segments import ends as compared_ends
from physics_crosscheck.harness.diagnosis.samples import (
    engine_ends,
    reference_ends,
    sample_segments,
)
from physics_crosscheck.harness.numerics.accelerations import Accelerations
from physics_crosscheck.harness.numerics.differences import OperatingPoint
from physics_crosscheck.harness.numerics.linearization import linearize_engine
from physics_crosscheck.harness.numerics.rounding import Starts
from physics_crosscheck.harness.numerics.segments import extrapolate
from physics_crosscheck.reference.dynamics.linearize import linearize
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.segments import Segments
from tests.numerics.conftest import DAMPING, MASS, STIFFNESS, Bench, Coarse, MakeBench

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
    point = OperatingPoint(
        name="rest",
        position=taylor.position,
        hold=np.zeros(1),
        matrices=taylor.arrays,
        amplitude=bench.motion.amplitude,
        push=np.array([5.0]),
    )
    _, matrix = linearize_engine(bench.model, bench.coordinates, point, 1e-9)
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
