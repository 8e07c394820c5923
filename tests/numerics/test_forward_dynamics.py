"""Engines' accelerations compared with the equations, and which of their terms are wrong."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import gymnasium
import numpy as np
import pybullet_data
import pytest

from physics_crosscheck.engine import Array
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import load, model_task
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.model_files import model_files
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.numerics.forward_dynamics import (
    FORCE_KINDS,
    STATE_COMBINATIONS,
    AccelerationComparison,
    forward_dynamics,
    mixed,
)
from physics_crosscheck.records import Outcome
from physics_crosscheck.reference.solving.next_state import SteppedBodies, SteppedEquations
from tests.engines.extras import need
from tests.numerics.conftest import MakeBench, SymplecticEuler
from tests.physics import physics

ASSETS = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"
DATA = Path(pybullet_data.getDataPath())
KUKA, A1 = DATA / "kuka_iiwa" / "model.urdf", DATA / "a1" / "a1.urdf"


prepared = cache(prepare_tree)


def compare_robot(
    file: Path, engine: str, *, floating: bool = False, resolution: float = 1e-9
) -> AccelerationComparison | None:
    task = model_task(prepared(file, floating=floating, states=8), engine, resolution=resolution)
    model, coordinates = task.load()
    stepped, drawn = SteppedBodies(task.target.tree), task.target.samples
    states, forces = mixed(drawn.start, drawn.start_inputs)
    return forward_dynamics(model, coordinates, stepped, states, forces, resolution)


@pytest.mark.parametrize(("file", "engine", "floating"), [
    (KUKA, "mujoco", False), (KUKA, "pinocchio", False), (KUKA, "drake", False),
    (KUKA, "dart", False), (A1, "mujoco", True), (A1, "pinocchio", True), (A1, "drake", True),
    (A1, "dart", True),
])  # fmt: skip
def test_robot_accelerations_match_the_equations(file: Path, engine: str, floating: bool) -> None:
    """DART rotates a floating root differently only in its steps, not in its accelerations."""
    need(engine)
    result = compare_robot(file, engine, floating=floating)
    assert result is not None
    assert result.complete
    assert result.states == 8 * STATE_COMBINATIONS
    assert result.judgement.outcome is Outcome.AGREES
    assert result.judgement.largest_discrepancy < 1e-12
    assert max(result.force_errors.values()) < 1e-12


@pytest.mark.parametrize(("engine", "settings"), [
    ("pinocchio", {"hold_mimics": True}),
    ("drake", {"stepping": "continuous", "hold_mimics": True}),
    ("drake", {}), ("mujoco", {}), ("pybullet", {}),
])  # fmt: skip
def test_mimic_joints_are_compared_only_if_held_exactly(
    engine: str, settings: Mapping[str, object]
) -> None:
    """Soft constraints give none; Drake's come from a continuous plant that holds them."""
    need(engine)
    system = physics("drum_pendulum")
    sidecars = (one for one in model_files(builtin() / "drum_pendulum") if isinstance(one, Sidecar))
    sidecar = next(one for one in sidecars if one.model.name == "robot.urdf")
    sidecar = replace(sidecar, engine_settings={engine: settings})
    motion = next(iter(system.motions.values()))
    model, coordinates = load(system.system, sidecar, engine)
    assert system.stepped is not None
    result = forward_dynamics(
        model, coordinates, system.stepped, motion.start, motion.inputs(motion.t), 1e-9
    )
    if "hold_mimics" not in settings and engine != "drake":
        assert result is None
        return
    assert result is not None
    assert result.judgement.largest_discrepancy < 1e-12
    assert max(result.force_errors.values()) < 1e-12


@dataclass
class Accelerating(SymplecticEuler):
    """The oscillator with accelerations, which are NaN beyond a stop."""

    stop: float = np.inf

    def accelerations(self, z: Array, w: Array, force: Array) -> Array:
        free = (force - self.stiffness * z - self.damping * w) / self.mass
        values: Array = np.where(np.abs(z) > self.stop, np.nan, free)
        return values


def compare_oscillator(bench: MakeBench, model: Accelerating) -> AccelerationComparison:
    rig = bench(model)
    states = rig.motion.start[:40]
    stepped = SteppedEquations(rig.equations)
    inputs = np.linspace(-3, 3, 40)[:, None]
    result = forward_dynamics(model, rig.coordinates, stepped, states, inputs, 1e-12)
    assert result is not None
    return result


def test_correct_model_agrees_to_the_last_digits(bench: MakeBench) -> None:
    result = compare_oscillator(bench, Accelerating())
    assert result.judgement.outcome is Outcome.AGREES
    assert result.judgement.largest_discrepancy < 1e-14
    assert tuple(result.force_errors) == FORCE_KINDS
    assert max(result.force_errors.values()) < 1e-13


@pytest.mark.parametrize(("fault", "term"), [
    (Accelerating(mass=1.3 * (1 + 1e-10)), "mass matrix"),
    (Accelerating(stiffness=47.0 * (1 + 1e-10)), "forces by position"),
    (Accelerating(damping=0.9 * (1 + 1e-9)), "forces odd in velocity"),
])  # fmt: skip
def test_wrong_number_shows_in_its_term(bench: MakeBench, fault: Accelerating, term: str) -> None:
    result = compare_oscillator(bench, fault)
    assert result.judgement.outcome is Outcome.DIFFERS
    assert [name for name, size in result.force_errors.items() if size > 1e-12] == [term]


def test_states_without_accelerations_are_skipped(bench: MakeBench) -> None:
    rig = bench(Accelerating())
    far = np.abs(rig.motion.start[:40, 0])
    result = compare_oscillator(bench, Accelerating(stop=float(np.median(far))))
    assert result.judgement.outcome is Outcome.AGREES
    assert result.states == 20
    assert not result.complete


def test_engine_without_accelerations_gives_no_result(bench: MakeBench) -> None:
    rig = bench(SymplecticEuler())
    stepped, states = SteppedEquations(rig.equations), rig.motion.start[:5]
    none = np.zeros((5, 1))
    assert forward_dynamics(rig.model, rig.coordinates, stepped, states, none, 1e-9) is None
    stopped = Accelerating(stop=0.0)
    assert forward_dynamics(stopped, rig.coordinates, stepped, states, none, 1e-9) is None


def test_states_in_contact_have_no_acceleration(tmp_path: Path) -> None:
    """MuJoCo's contacts are soft, so the equations cannot describe them."""
    file = tmp_path / "ball.xml"
    file.write_text(
        '<mujoco><worldbody><geom type="plane" size="1 1 1"/><body pos="0 0 0.1"><joint name="z"'
        ' type="slide" axis="0 0 1"/><geom size="0.1" mass="1"/></body></worldbody></mujoco>'
    )
    task = model_task(prepare_tree(file, states=8), "mujoco")
    model, _ = replace(task, spec=replace(task.spec, settings={"smooth": False})).load()
    z = np.array([[0.05], [-0.01]])
    accelerations = model.accelerations(z, 0 * z, 0 * z)
    assert accelerations is not None
    assert accelerations[0, 0] == -9.81
    assert np.isnan(accelerations[1, 0])


def test_velocities_and_inputs_are_combined_with_all_positions() -> None:
    states, inputs = np.arange(40.0).reshape(10, 4), np.arange(10.0)[:, None]
    combined, forces = mixed(states, inputs)
    assert combined.shape == (10 * STATE_COMBINATIONS, 4)
    assert forces.shape == (10 * STATE_COMBINATIONS, 1)
    assert np.array_equal(combined[:10], states)
    assert np.array_equal(np.unique(combined[:, :2], axis=0), states[:, :2])
    assert len(np.unique(combined, axis=0)) == 10 * STATE_COMBINATIONS
