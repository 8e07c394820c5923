"""An engine that rounds coarsely: its rounding is in the uncertainty wherever a limit is taken."""

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
"""Of limits, each relative to its uncertainty."""


def verdict(made: Bench) -> Array:
    batch = made.motion
    found = extrapolate(made.model, made.coordinates, batch, resolution=1e-6).limit
    return np.abs(found.value - made.motion.end) / found.uncertainty


def diagnosis(made: Bench) -> Array:
    motions = {"only": made.motion}
    samples = sample_segments(motions)
    ends, uncertainty = engine_ends(made.model, made.coordinates, samples)
    return np.abs(ends - reference_ends(samples)) / uncertainty


def snapshot(made: Bench) -> Array:
    one = segments_of(snapshot_of(made.motion, "only", ("x", "x_dot"), ("F",)))
    end, uncertainty = snapshot_ends(made.model, made.coordinates, one)
    return np.abs(end - one.end) / uncertainty


def compare(made: Bench) -> Array:
    start = made.motion.start[::5]
    runs = Segments.unsolved(start, float(made.motion.lengths[0]), np.zeros((len(start), 1)))
    found = compared_ends(made.model, runs, None, 1e-6).limit
    return np.abs(found.value - made.motion.end[::5]) / found.uncertainty


def linearization(made: Bench) -> Array:
    taylor = linearize(made.equations, made.system.equilibria[0])
    point = OperatingPoint(
        name="rest",
        position=taylor.position,
        hold=np.zeros(1),
        matrices=taylor.arrays,
        amplitude=made.motion.amplitude,
        push=np.array([5.0]),
    )
    found = linearize_engine(made.model, made.coordinates, point, 1e-9)
    a = np.abs(found.a - taylor.arrays["A"]) / found.a_uncertainty
    b = np.abs(found.b - taylor.arrays["B"]) / found.b_uncertainty
    return np.hstack([a, b])


def accelerations(made: Bench) -> Array:
    states = made.motion.start[::5]
    speed = made.motion.amplitude[1:]
    measured = Accelerations(
        model=made.model, coordinates=made.coordinates, speed=speed, fastest=made.motion.fastest
    )
    forces = np.linspace(-3.0, 3.0, len(states))[:, None]
    found = measured.measure(states, np.zeros((len(states), 1)), forces)
    wanted = (forces - STIFFNESS * states[:, :1] - DAMPING * states[:, 1:]) / MASS
    return np.abs(found.value - wanted) / found.uncertainty


EVERYWHERE = [
    (verdict, 35),
    (diagnosis, 35),
    (snapshot, 35),
    (compare, 35),
    (linearization, 35),
    # Changes over a step as short as these are known to fewer digits, of a double too.
    (accelerations, 33),
]


@pytest.mark.parametrize(("errors", "bits"), EVERYWHERE)
def test_coarse_rounding_is_in_the_uncertainty(bench: MakeBench, errors: Errors, bits: int) -> None:
    assert np.max(errors(bench(Coarse(bits=bits)))) < 0.5


@pytest.mark.parametrize(("errors", "bits"), EVERYWHERE)
def test_it_is_the_companions_that_show_it(
    bench: MakeBench, errors: Errors, bits: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def nothing(starts: Starts, values: Array) -> Array:
        return np.zeros(values.shape[1])

    monkeypatch.setattr(Starts, "observed_rounding", nothing)
    assert np.max(errors(bench(Coarse(bits=bits)))) > 2


@pytest.mark.parametrize("errors", [each for each, _ in EVERYWHERE])
def test_an_engine_that_does_not_has_no_larger_uncertainty_for_it(
    bench: MakeBench, errors: Errors
) -> None:
    found = errors(bench())
    assert np.max(found) < 0.5
    # An uncertainty that is honest by being huge would say nothing.
    assert np.median(found) > 5e-4
