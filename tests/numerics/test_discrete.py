"""One linearized step of an engine, compared with its rule and with its own linearization."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from physics_crosscheck.engine import Array
from physics_crosscheck.harness.checks.linearizations import run_linearizations
from physics_crosscheck.harness.checks.task import load, model_task
from physics_crosscheck.harness.engines.protocol import StepRule
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.numerics.differences import OperatingPoint
from physics_crosscheck.harness.numerics.discrete import linearize_step
from physics_crosscheck.harness.records.model import DiscreteLinearization
from physics_crosscheck.harness.render.terminal.table import _single_steps
from physics_crosscheck.records import Model
from physics_crosscheck.reference.solving.next_state import SteppedEquations
from tests.numerics.conftest import MakeBench, SymplecticEuler, finite
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
