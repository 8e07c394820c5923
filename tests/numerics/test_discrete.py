"""Linearizations of an engine: of one step and of its limit, compared with rule and equations."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from physics_crosscheck.engine import Array
from physics_crosscheck.harness.checks.compiled_terms import run_linearizations
from physics_crosscheck.harness.checks.task import load, model_task
from physics_crosscheck.harness.engines.protocol import StepRule
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.numerics.accelerations import Estimate
from physics_crosscheck.harness.numerics.differences import OperatingPoint
from physics_crosscheck.harness.numerics.discrete import linearize_step
from physics_crosscheck.harness.numerics.linearization import linearize_engine
from physics_crosscheck.harness.records.model import DiscreteLinearization
from physics_crosscheck.harness.render.terminal.table import _single_steps
from physics_crosscheck.records import EngineLinearization, Model
from physics_crosscheck.reference.dynamics.linearize import linearize
from physics_crosscheck.reference.solving.next_state import SteppedEquations
from tests.numerics.conftest import STIFFNESS, Bench, MakeBench, SymplecticEuler, finite
from tests.numerics.test_stepping import sidecar
from tests.physics import physics as prepared

INTEGRATORS = ("Euler", "implicit", "implicitfast", "RK4")
"""Integrators of MuJoCo."""


def one_step(
    folder: str, model: Sidecar, engine: str, resolution: float = 1e-9
) -> DiscreteLinearization:
    physics = prepared(folder)
    loaded, coordinates = load(physics.system, model, engine)
    result = linearize_step(loaded, coordinates, physics.stepped, physics.equilibria[0], resolution)
    assert result is not None
    return result


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_each_integrator_matches_its_step_rule(integrator: str) -> None:
    base = sidecar("mass_spring_damper", "mujoco.xml")
    model = replace(base, settings={**base.settings, "integrator": integrator})
    result = one_step("mass_spring_damper", model, "mujoco")
    assert not result.differs
    assert finite(result.error) < 1e-11
    assert finite(result.bound) < 1e-9
    assert finite(result.radius) < 1


@pytest.mark.parametrize(("folder", "model", "engine"), [
    ("drum_pendulum", "robot.urdf", "pybullet"), ("anchored_pair", "robot.urdf", "pybullet"),
    ("anchored_pair", "robot.urdf", "pinocchio"), ("simple_pendulum", "mujoco.xml", "mujoco"),
])  # fmt: skip
def test_other_engines_match_their_step_rule(folder: str, model: str, engine: str) -> None:
    result = one_step(folder, sidecar(folder, model), engine)
    assert not result.differs
    assert finite(result.error) < 1e-10


def test_matrices_match_mujocos_finite_differences() -> None:
    """`mjd_transitionFD` takes one difference of 1e-6, so it has seven digits."""
    base = sidecar("mass_spring_damper", "mujoco.xml")
    result = one_step("mass_spring_damper", base, "mujoco")
    model = mujoco.MjModel.from_xml_path(str(base.model))
    data = mujoco.MjData(model)
    a = np.zeros((2, 2))
    mujoco.mjd_transitionFD(model, data, 1e-6, True, a, None, None, None)
    assert np.max(np.abs(np.array(result.a, float) - a)) < 1e-7 * np.max(np.abs(a - np.eye(2)))
    (force,) = result.b[1]
    assert force == pytest.approx(model.opt.timestep / (1.3 + 0.9 * model.opt.timestep))


def test_soft_equality_shows_in_its_step() -> None:
    result = one_step("drum_pendulum", sidecar("drum_pendulum", "mujoco_rolling.xml"), "mujoco")
    assert result.differs
    assert 1e-6 < finite(result.error) < 1e-4


def test_wrong_stiffness_shows(tmp_path: Path) -> None:
    base = sidecar("mass_spring_damper", "mujoco.xml")
    text = base.model.read_text()
    (tmp_path / "mujoco.xml").write_text(text.replace('="47.0"', '="47.00001"'))
    result = one_step("mass_spring_damper", replace(base, model=tmp_path / "mujoco.xml"), "mujoco")
    assert result.differs
    assert result.error == pytest.approx(1e-5 / 47, rel=1e-3)


class WithStepRule(SymplecticEuler):
    @property
    def step_rule(self) -> StepRule:
        return StepRule(scheme="semi-implicit Euler")


def oscillator_step(bench: MakeBench, model: SymplecticEuler) -> DiscreteLinearization:
    rig = bench(model)
    point = OperatingPoint(
        name="rest",
        position=np.zeros(1),
        hold=np.zeros(1),
        matrices={"A": _a(model)},
        amplitude=np.array([0.25, 1.5]),
        push=np.ones(1),
    )
    stepped = SteppedEquations(rig.equations)
    result = linearize_step(model, rig.coordinates, stepped, point, 1e-9)
    assert result is not None
    return result


def _a(model: SymplecticEuler) -> Array:
    return np.array([[0.0, 1.0], [-model.stiffness / model.mass, -model.damping / model.mass]])


def test_matrices_match_the_closed_form(bench: MakeBench) -> None:
    """v' = v + h (u - k x - c v)/m, x' = x + h v'."""
    model = WithStepRule()
    h, m, c, k = model.step, model.mass, model.damping, model.stiffness
    result = oscillator_step(bench, model)
    row = np.array([-h * k / m, 1 - h * c / m])
    assert np.allclose(
        np.array(result.a, float), [np.array([1.0, 0.0]) + h * row, row], rtol=0, atol=1e-13
    )
    assert np.allclose(np.array(result.b, float), [[h * h / m], [h / m]], rtol=0, atol=1e-14)
    assert result.radius == pytest.approx(np.sqrt(1 - h * c / m), abs=1e-12)
    assert result.exact_radius == pytest.approx(np.exp(-c / m * h / 2), abs=1e-12)


def test_without_a_rule_the_step_has_no_error(bench: MakeBench) -> None:
    result = oscillator_step(bench, SymplecticEuler())
    assert result.error is None
    assert not result.differs


def test_unstable_step_is_reported(tmp_path: Path) -> None:
    """Semi-implicit Euler on a spring of 6 rad/s is unstable above dt = 0.33 s."""
    physics = prepared("mass_spring_damper")
    model = sidecar("mass_spring_damper", "mujoco.xml")
    text = model.model.read_text().replace('timestep="0.002"', 'timestep="0.4"')
    assert text != model.model.read_text()
    (tmp_path / "mujoco.xml").write_text(text)
    task = model_task(physics, "mujoco", replace(model, model=tmp_path / "mujoco.xml"))
    results = run_linearizations(task)
    assert results[0].one_step is not None
    assert (results[0].one_step.radius or 0) > 1 > (results[0].one_step.exact_radius or 2)
    record = Model(
        system="s", model="m.xml", engine="mujoco", folder="s", text="", sidecar="",
        linearizations=results,
    )  # fmt: skip
    (line,) = [one for one in _single_steps([record]) if "grows" in one]
    assert "in each step of 0.4 s about rest, where the equations decay" in line


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
