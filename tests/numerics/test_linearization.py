"""The engine's own linearization, from limits of small perturbations."""

from typing import Any

import numpy as np
import pytest

from physics_crosscheck.engine import Array
from physics_crosscheck.harness.numerics.accelerations import Estimate
from physics_crosscheck.harness.numerics.differences import OperatingPoint
from physics_crosscheck.harness.numerics.linearization import linearize_engine
from physics_crosscheck.records import EngineLinearization
from physics_crosscheck.reference.dynamics.linearize import linearize
from tests.numerics.conftest import STIFFNESS, Bench, MakeBench, SymplecticEuler, finite


def linear_matrix(
    bench: Bench, resolution: float = 1e-9, thorough: bool = True
) -> tuple[EngineLinearization, Estimate]:
    taylor = linearize(bench.equations, bench.system.equilibria[0])
    point = OperatingPoint(
        name="rest",
        position=taylor.position,
        hold=np.zeros(1),
        matrices=taylor.arrays,
        amplitude=bench.motion.amplitude,
        push=np.array([5.0]),
    )
    return linearize_engine(bench.model, bench.coordinates, point, resolution, thorough)


def linear(bench: Bench, resolution: float = 1e-9, thorough: bool = True) -> EngineLinearization:
    return linear_matrix(bench, resolution, thorough)[0]


def test_correct_engine_matches_taylor_matrices_to_ten_digits(bench: MakeBench) -> None:
    result = linear(bench())
    assert finite(result.a_error) < 1e-10
    assert finite(result.b_error) < 1e-10
    assert finite(result.transfer_error) < 1e-8
    assert finite(result.mode_similarity) > 1 - 1e-12
    for ours, theirs in zip(result.poles, result.taylor_poles, strict=True):
        assert ours.real == pytest.approx(theirs.real, rel=1e-10)
        assert ours.imaginary == pytest.approx(theirs.imaginary, rel=1e-10)


@pytest.mark.parametrize("fault", [1e-3, 1e-7])
def test_wrong_stiffness_is_seen_in_a_and_not_in_b(bench: MakeBench, fault: float) -> None:
    result = linear(bench(SymplecticEuler(stiffness=STIFFNESS * (1 + fault))))
    assert result.a_error == pytest.approx(fault, rel=1e-2)
    assert finite(result.b_error) < 1e-10


class Hardening(SymplecticEuler):
    """A spring whose cubic term the perturbations' extrapolation must remove."""

    def stepped(self, q: Any, v: Any, push: Any, h: float) -> Any:
        resistance = self.stiffness * q * (1 + 3 * q**2) + self.damping * v
        v = v + h * (push - resistance) / self.mass
        return q + h * v, v


def test_nonlinear_terms_are_extrapolated_away(bench: MakeBench) -> None:
    result = linear(bench(Hardening()))
    assert finite(result.a_error) < 1e-9


@pytest.mark.parametrize("kind", [SymplecticEuler, Hardening])
def test_every_entry_is_within_its_uncertainty(bench: MakeBench, kind: type) -> None:
    rig = bench(kind())
    _, matrix = linear_matrix(rig)
    taylor = linearize(rig.equations, rig.system.equilibria[0]).arrays
    for part, expected in ((slice(0, 2), taylor["A"]), (slice(2, 3), taylor["B"])):
        error = matrix.uncertainty[:2, part]
        assert np.all(np.abs(matrix.value[:2, part] - expected) <= error)
        assert np.max(error) < 1e-8 * np.max(np.abs(expected))


@pytest.mark.parametrize(("fault", "resolution", "differs"), [
    (0.0, 1e-13, False),
    (1e-6, 1e-9, True),
    (13.0, 1e-9, True),
    (1e-7, 1e-6, False),  # below the resolution
])  # fmt: skip
def test_errors_above_uncertainty_and_resolution_differ(
    bench: MakeBench, fault: float, resolution: float, differs: bool
) -> None:
    result = linear(bench(SymplecticEuler(stiffness=STIFFNESS * (1 + fault))), resolution)
    assert result.differs is differs


class Forward(SymplecticEuler):
    """An engine that returns accelerations, of a spring with a cubic term, and takes no step."""

    def accelerations(self, z: Array, w: Array, force: Array) -> Array:
        return (force - self.stiffness * z * (1 + 3 * z**2) - self.damping * w) / self.mass

    def stepped(self, q: Any, v: Any, push: Any, h: float) -> Any:
        raise AssertionError("accelerations need no step")


@pytest.mark.parametrize("fault", [0.0, 1e-7])
def test_accelerations_give_every_entry_within_its_uncertainty(
    bench: MakeBench, fault: float
) -> None:
    rig = bench(Forward(stiffness=STIFFNESS * (1 + fault)))
    result, matrix = linear_matrix(rig, thorough=False)
    taylor = linearize(rig.equations, rig.system.equilibria[0]).arrays
    assert result.differs == bool(fault)
    assert result.a_error == pytest.approx(fault, rel=1e-2, abs=1e-12)
    entries = matrix.value[:2, 0 if not fault else 2 :]
    wanted = np.hstack([taylor["A"], taylor["B"]])[:, 0 if not fault else 2 :]
    assert np.all(np.abs(entries - wanted) <= matrix.uncertainty[:2, -entries.shape[1] :])
    assert max(finite(result.a_bound), finite(result.b_bound)) < 1e-10


class Contact(SymplecticEuler):
    """An engine that returns no accelerations where a contact acts."""

    def accelerations(self, z: Array, w: Array, force: Array) -> Array:
        return np.where(z > 0, np.nan, (force - self.stiffness * z) / self.mass)


def test_segments_replace_missing_accelerations(bench: MakeBench) -> None:
    result, whole = (linear(bench(Contact()), thorough=thorough) for thorough in (False, True))
    assert result.a == whole.a
    assert finite(result.a_error) < 1e-10
