"""One step of an engine, linearized: against its rule on the equations, and its own answer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from physics_crosscheck.harness.checks.linearizations import run_linearizations
from physics_crosscheck.harness.checks.task import load, model_task
from physics_crosscheck.harness.engines.protocol import Array, StepRule
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.numerics.differences import OperatingPoint
from physics_crosscheck.harness.numerics.discrete import StepLinearization, linearize_step
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.render.terminal.table import _single_steps
from physics_crosscheck.reference.solving.next_state import SteppedEquations
from tests.numerics.conftest import MakeBench, SymplecticEuler
from tests.numerics.test_stepping import sidecar
from tests.physics import physics as prepared

INTEGRATORS = ("Euler", "implicit", "implicitfast", "RK4")
"""MuJoCo's."""


def one_step(
    folder: str, model: Sidecar, engine: str, resolution: float = 1e-9
) -> StepLinearization:
    own = prepared(folder)
    loaded, coordinates = load(own.system, model, engine)
    found = linearize_step(loaded, coordinates, own.stepped, own.equilibria[0], resolution)
    assert found is not None
    return found


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_each_integrators_step_is_its_rules(integrator: str) -> None:
    own = sidecar("mass_spring_damper", "mujoco.xml")
    model = replace(own, settings={**own.settings, "integrator": integrator})
    found = one_step("mass_spring_damper", model, "mujoco")
    assert not found.differs
    assert found.error < 1e-11
    assert found.bound < 1e-9
    assert found.radius < 1


@pytest.mark.parametrize(("folder", "model", "engine"), [
    ("drum_pendulum", "robot.urdf", "pybullet"), ("anchored_pair", "robot.urdf", "pybullet"),
    ("anchored_pair", "robot.urdf", "pinocchio"), ("simple_pendulum", "mujoco.xml", "mujoco"),
])  # fmt: skip
def test_other_engines_are_too(folder: str, model: str, engine: str) -> None:
    found = one_step(folder, sidecar(folder, model), engine)
    assert not found.differs
    assert found.error < 1e-10


def test_it_is_what_mujoco_itself_tells() -> None:
    """`mjd_transitionFD` differences once, by 1e-6: it is good to seven digits."""
    own = sidecar("mass_spring_damper", "mujoco.xml")
    found = one_step("mass_spring_damper", own, "mujoco")
    model = mujoco.MjModel.from_xml_path(str(own.model))
    data = mujoco.MjData(model)
    a = np.zeros((2, 2))
    mujoco.mjd_transitionFD(model, data, 1e-6, True, a, None, None, None)
    assert np.max(np.abs(found.a - a)) < 1e-7 * np.max(np.abs(a - np.eye(2)))
    assert found.b.shape == (2, 1)
    assert found.b[1, 0] == pytest.approx(model.opt.timestep / (1.3 + 0.9 * model.opt.timestep))


def test_a_soft_equality_shows_in_its_step() -> None:
    found = one_step("drum_pendulum", sidecar("drum_pendulum", "mujoco_rolling.xml"), "mujoco")
    assert found.differs
    assert 1e-6 < found.error < 1e-4


def test_a_wrong_stiffness_shows(tmp_path: Path) -> None:
    own = sidecar("mass_spring_damper", "mujoco.xml")
    text = own.model.read_text()
    (tmp_path / "mujoco.xml").write_text(text.replace('="47.0"', '="47.00001"'))
    found = one_step("mass_spring_damper", replace(own, model=tmp_path / "mujoco.xml"), "mujoco")
    assert found.differs
    assert found.error == pytest.approx(1e-5 / 47, rel=1e-3)


class Ruled(SymplecticEuler):
    @property
    def step_rule(self) -> StepRule:
        return StepRule(scheme="semi-implicit Euler")


def of_oscillator(bench: MakeBench, model: SymplecticEuler) -> StepLinearization:
    made = bench(model)
    point = OperatingPoint(
        name="rest",
        position=np.zeros(1),
        hold=np.zeros(1),
        matrices={"A": _a(model)},
        amplitude=np.array([0.25, 1.5]),
        push=np.ones(1),
    )
    stepped = SteppedEquations(made.equations)
    found = linearize_step(model, made.coordinates, stepped, point, 1e-9)
    assert found is not None
    return found


def _a(model: SymplecticEuler) -> Array:
    return np.array([[0.0, 1.0], [-model.stiffness / model.mass, -model.damping / model.mass]])


def test_its_matrices_are_those_of_the_rule_on_paper(bench: MakeBench) -> None:
    """v' = v + h (u - k x - c v)/m, x' = x + h v'."""
    model = Ruled()
    h, m, c, k = model.step, model.mass, model.damping, model.stiffness
    found = of_oscillator(bench, model)
    row = np.array([-h * k / m, 1 - h * c / m])
    assert np.allclose(found.a, [np.array([1.0, 0.0]) + h * row, row], rtol=0, atol=1e-13)
    assert np.allclose(found.b, [[h * h / m], [h / m]], rtol=0, atol=1e-14)
    assert found.radius == pytest.approx(np.sqrt(1 - h * c / m), abs=1e-12)
    assert found.exact_radius == pytest.approx(np.exp(-c / m * h / 2), abs=1e-12)


def test_without_a_rule_the_step_is_told_alone(bench: MakeBench) -> None:
    found = of_oscillator(bench, SymplecticEuler())
    assert np.isnan(found.error)
    assert not found.differs


def test_a_step_at_which_it_grows_is_told(tmp_path: Path) -> None:
    """A spring of 6 rad/s, semi-implicit, is unstable from 0.33 s on."""
    own = prepared("mass_spring_damper")
    model = sidecar("mass_spring_damper", "mujoco.xml")
    text = model.model.read_text().replace('timestep="0.002"', 'timestep="0.4"')
    assert text != model.model.read_text()
    (tmp_path / "mujoco.xml").write_text(text)
    task = model_task(own, "mujoco", replace(model, model=tmp_path / "mujoco.xml"))
    found = run_linearizations(task)
    assert found[0].one_step is not None
    assert (found[0].one_step.radius or 0) > 1 > (found[0].one_step.exact_radius or 2)
    record = Model(
        system="s", model="m.xml", engine="mujoco", folder="s", text="", sidecar="",
        linearizations=found,
    )  # fmt: skip
    (line,) = [one for one in _single_steps([record]) if "grows" in one]
    assert "in each step of 0.4 s about rest, where the equations decay" in line
