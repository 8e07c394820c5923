"""Engines' accelerations against the equations, and which of their terms are wrong."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import gymnasium
import numpy as np
import pybullet_data
import pytest

from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import load, model_task
from physics_crosscheck.harness.engines.protocol import Array
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
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.reference.solving.next_state import SteppedBodies, SteppedEquations
from tests.engines.extras import need
from tests.numerics.conftest import MakeBench, SymplecticEuler
from tests.physics import physics

ASSETS = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"
DATA = Path(pybullet_data.getDataPath())
KUKA, A1 = DATA / "kuka_iiwa" / "model.urdf", DATA / "a1" / "a1.urdf"


prepared = cache(prepare_tree)


def of_robot(
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
def test_a_robots_accelerations_are_the_equations(file: Path, engine: str, floating: bool) -> None:
    """DART's too where a root floats: it is in its steps that it turns such a root otherwise."""
    need(engine)
    found = of_robot(file, engine, floating=floating)
    assert found is not None
    assert found.complete
    assert found.states == 8 * STATE_COMBINATIONS
    assert found.judgement.outcome is Outcome.AGREES
    assert found.judgement.largest_discrepancy < 1e-12
    assert max(found.force_errors.values()) < 1e-12


@pytest.mark.parametrize(("engine", "settings"), [
    ("pinocchio", {"hold_mimics": True}),
    ("drake", {"stepping": "continuous", "hold_mimics": True}),
    ("drake", {}), ("mujoco", {}), ("pybullet", {}),
])  # fmt: skip
def test_joints_that_follow_are_compared_where_they_are_held_exactly(
    engine: str, settings: Mapping[str, object]
) -> None:
    """What holds them softly, or by a solver in a step, tells no accelerations."""
    need(engine)
    own = physics("drum_pendulum")
    known = (one for one in model_files(builtin() / "drum_pendulum") if isinstance(one, Sidecar))
    sidecar = next(one for one in known if one.model.name == "robot.urdf")
    sidecar = replace(sidecar, engine_settings={engine: settings})
    motion = next(iter(own.motions.values()))
    model, coordinates = load(own.system, sidecar, engine)
    assert own.stepped is not None
    found = forward_dynamics(
        model, coordinates, own.stepped, motion.start, motion.inputs(motion.t), 1e-9
    )
    if "hold_mimics" not in settings:
        assert found is None
        return
    assert found is not None
    assert found.judgement.largest_discrepancy < 1e-12
    assert max(found.force_errors.values()) < 1e-12


@dataclass
class Telling(SymplecticEuler):
    """The oscillator, which tells its accelerations too; of states beyond a stop it tells none."""

    stop: float = np.inf

    def accelerations(self, z: Array, w: Array, force: Array) -> Array:
        found = (force - self.stiffness * z - self.damping * w) / self.mass
        told: Array = np.where(np.abs(z) > self.stop, np.nan, found)
        return told


def of_oscillator(bench: MakeBench, model: Telling) -> AccelerationComparison:
    made = bench(model)
    states = made.motion.start[:40]
    stepped = SteppedEquations(made.equations)
    inputs = np.linspace(-3, 3, 40)[:, None]
    found = forward_dynamics(model, made.coordinates, stepped, states, inputs, 1e-12)
    assert found is not None
    return found


def test_what_is_right_agrees_to_the_last_digits(bench: MakeBench) -> None:
    found = of_oscillator(bench, Telling())
    assert found.judgement.outcome is Outcome.AGREES
    assert found.judgement.largest_discrepancy < 1e-14
    assert tuple(found.force_errors) == FORCE_KINDS
    assert max(found.force_errors.values()) < 1e-13


@pytest.mark.parametrize(("fault", "term"), [
    (Telling(mass=1.3 * (1 + 1e-10)), "mass matrix"),
    (Telling(stiffness=47.0 * (1 + 1e-10)), "forces by position"),
    (Telling(damping=0.9 * (1 + 1e-9)), "forces odd in velocity"),
])  # fmt: skip
def test_a_wrong_number_shows_in_its_own_term(bench: MakeBench, fault: Telling, term: str) -> None:
    found = of_oscillator(bench, fault)
    assert found.judgement.outcome is Outcome.DIFFERS
    assert [name for name, size in found.force_errors.items() if size > 1e-12] == [term]


def test_states_that_it_does_not_tell_of_are_left_out(bench: MakeBench) -> None:
    made = bench(Telling())
    far = np.abs(made.motion.start[:40, 0])
    found = of_oscillator(bench, Telling(stop=float(np.median(far))))
    assert found.judgement.outcome is Outcome.AGREES
    assert found.states == 20
    assert not found.complete


def test_one_that_tells_nothing_is_no_evidence(bench: MakeBench) -> None:
    made = bench(SymplecticEuler())
    stepped, states = SteppedEquations(made.equations), made.motion.start[:5]
    none = np.zeros((5, 1))
    assert forward_dynamics(made.model, made.coordinates, stepped, states, none, 1e-9) is None
    stopped = Telling(stop=0.0)
    assert forward_dynamics(stopped, made.coordinates, stepped, states, none, 1e-9) is None


def test_a_contact_is_told_of_no_state_where_it_acts(tmp_path: Path) -> None:
    """MuJoCo's are soft: what they do is no matter of the equations."""
    file = tmp_path / "ball.xml"
    file.write_text(
        '<mujoco><worldbody><geom type="plane" size="1 1 1"/><body pos="0 0 0.1"><joint name="z"'
        ' type="slide" axis="0 0 1"/><geom size="0.1" mass="1"/></body></worldbody></mujoco>'
    )
    task = model_task(prepare_tree(file, states=8), "mujoco")
    model, _ = replace(task, spec=replace(task.spec, settings={"smooth": False})).load()
    z = np.array([[0.05], [-0.01]])
    found = model.accelerations(z, 0 * z, 0 * z)
    assert found is not None
    assert found[0, 0] == -9.81
    assert np.isnan(found[1, 0])


def test_others_velocities_and_inputs_go_round_among_the_positions() -> None:
    states, inputs = np.arange(40.0).reshape(10, 4), np.arange(10.0)[:, None]
    found, given = mixed(states, inputs)
    assert found.shape == (10 * STATE_COMBINATIONS, 4)
    assert given.shape == (10 * STATE_COMBINATIONS, 1)
    assert np.array_equal(found[:10], states)
    assert np.array_equal(np.unique(found[:, :2], axis=0), states[:, :2])
    assert len(np.unique(found, axis=0)) == 10 * STATE_COMBINATIONS
