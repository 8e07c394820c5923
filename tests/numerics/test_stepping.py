"""Engines' next states against their own rules on the equations, at the step that models ship."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import gymnasium
import numpy as np
import pybullet_data
import pytest

from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.prepare import PreparedSystem, PreparedTree, prepare_tree
from physics_crosscheck.harness.checks.task import SystemTask, load, model_task
from physics_crosscheck.harness.engines.protocol import Array, Force, StateForce, StepRule
from physics_crosscheck.harness.modelfiles.bindings import bindings, with_literals
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.model_files import model_files
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.numerics.stepping import StepComparison, step_engine
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.reference.solving.next_state import SteppedBodies, SteppedEquations
from tests.engines.extras import need
from tests.numerics.conftest import MakeBench, SymplecticEuler
from tests.physics import physics as prepared

ASSETS = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"
DATA = Path(pybullet_data.getDataPath())
INTEGRATORS = ("Euler", "implicit", "implicitfast", "RK4")
SYSTEMS = (
    "anchored_pair", "drum_pendulum", "free_pair", "mass_spring_damper", "simple_pendulum",
    "torsional_disc",
)  # fmt: skip
FIVE = 5.0
"""Last digits of the largest of a component, after one step: most are within one."""


@cache
def robot_of(file: Path) -> PreparedTree:
    return prepare_tree(file, states=8)


def sidecar(folder: str, model: str) -> Sidecar:
    known = (one for one in model_files(builtin() / folder) if isinstance(one, Sidecar))
    return next(one for one in known if one.model.name == model)


def stepped(
    folder: str, model: Sidecar, engine: str, resolution: float = 1e-12
) -> StepComparison | None:
    """One step from every segment of the first scenario."""
    own = prepared(folder)
    motion = next(iter(own.motions.values()))
    loaded, coordinates = load(own.system, model, engine)
    assert own.stepped is not None
    inputs = motion.inputs(motion.t)
    return step_engine(loaded, coordinates, own.stepped, motion.start, inputs, resolution)


@pytest.mark.parametrize(("folder", "model", "engine"), [
    ("mass_spring_damper", "mujoco.xml", "mujoco"),
    ("mass_spring_damper", "robot.urdf", "pybullet"),
    ("drum_pendulum", "mujoco.xml", "mujoco"),
    ("drum_pendulum", "robot.urdf", "pybullet"),
    ("drum_pendulum", "robot_folded.urdf", "mujoco"),
])  # fmt: skip
def test_the_next_state_is_the_equations_by_the_engines_own_rule(
    folder: str, model: str, engine: str
) -> None:
    """PyBullet's gear among them: at 2 ms it holds the drum as a rolling one."""
    found = stepped(folder, sidecar(folder, model), engine)
    assert found is not None
    assert found.judgement.outcome is Outcome.AGREES
    assert found.judgement.largest_discrepancy < 1e-13
    assert found.digits <= FIVE


@pytest.mark.parametrize(("folder", "engine", "settings"), [
    ("mass_spring_damper", "pinocchio", {}), ("mass_spring_damper", "dart", {}),
    ("mass_spring_damper", "drake", {}), ("mass_spring_damper", "drake", {"stepping": "tamsi"}),
    ("mass_spring_damper", "drake", {"stepping": "continuous"}),
    ("drum_pendulum", "pinocchio", {"hold_mimics": True}),
    ("drum_pendulum", "drake", {"stepping": "continuous", "hold_mimics": True}),
])  # fmt: skip
def test_engines_of_extras_step_by_their_own_rules(
    folder: str, engine: str, settings: dict[str, object]
) -> None:
    """Dampers at the step's end in DART and by SAP, at its start by TAMSI, at each stage of RK4."""
    need(engine)
    own = sidecar(folder, "robot.urdf")
    found = stepped(folder, replace(own, engine_settings={engine: settings}), engine)
    assert found is not None
    assert found.judgement.outcome is Outcome.AGREES
    assert found.judgement.largest_discrepancy < 1e-13
    assert found.digits <= FIVE


@pytest.mark.parametrize("folder", ["anchored_pair", "mass_spring_damper", "torsional_disc"])
def test_the_files_springs_are_taken_at_the_end_of_a_step_of_darts(folder: str) -> None:
    need("dart")
    found = stepped(folder, sidecar(folder, "robot.sdf"), "dart")
    assert found is not None
    assert "springs" in found.rule.name
    assert found.judgement.outcome is Outcome.AGREES
    assert found.digits <= FIVE


@pytest.mark.parametrize("folder", SYSTEMS)
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_each_integrator_of_mujoco_has_its_rule(integrator: str, folder: str) -> None:
    own = sidecar(folder, "mujoco.xml")
    settings = {**own.settings, "integrator": integrator}
    found = stepped(folder, replace(own, settings=settings), "mujoco")
    assert found is not None
    assert found.judgement.outcome is Outcome.AGREES
    assert found.digits <= FIVE


def test_a_soft_equality_shows_at_the_step_that_its_limit_hides() -> None:
    found = stepped("drum_pendulum", sidecar("drum_pendulum", "mujoco_rolling.xml"), "mujoco")
    assert found is not None
    assert found.judgement.outcome is Outcome.DIFFERS
    assert 1e-5 < found.judgement.discrepancy < 1e-4
    assert "soft" in found.rule.besides


@pytest.mark.parametrize(("folder", "model", "engine", "address"), [
    ("anchored_pair", "mujoco.xml", "mujoco", "body[first]/inertial@mass"),
    ("anchored_pair", "robot.urdf", "mujoco", "link[second]/inertial/mass@value"),
    ("anchored_pair", "robot.urdf", "pybullet", "gazebo[x1]/springStiffness"),
    ("drum_pendulum", "mujoco.xml", "mujoco", "joint[x]@stiffness"),
    ("drum_pendulum", "robot_folded.urdf", "mujoco", "sidecar:settings.gravity[2]"),
    ("drum_pendulum", "robot.urdf", "pybullet", "sidecar:settings.gravity[2]"),
    ("free_pair", "mujoco.xml", "mujoco", "fixed[coupling]@stiffness"),
    ("free_pair", "robot.urdf", "mujoco", "sidecar:spring[0].stiffness"),
    ("free_pair", "robot.urdf", "pybullet", "link[first]/inertial/mass@value"),
    ("mass_spring_damper", "mujoco.xml", "mujoco", "joint[x]@stiffness"),
    ("mass_spring_damper", "mujoco.xml", "mujoco", "joint[x]@damping"),
    ("mass_spring_damper", "mujoco.xml", "mujoco", "body[mass]/inertial@mass"),
    ("mass_spring_damper", "robot.urdf", "pybullet", "link[mass]/inertial/mass@value"),
    ("simple_pendulum", "mujoco.xml", "mujoco", "body[pendulum]/inertial@pos[2]"),
    ("simple_pendulum", "robot.urdf", "pybullet", "link[pendulum]/inertial/origin@xyz[2]"),
    ("torsional_disc", "mujoco.xml", "mujoco", "body[disc]/inertial@diaginertia[2]"),
    ("torsional_disc", "robot.urdf", "pybullet", "gazebo[theta]/springStiffness"),
])  # fmt: skip
def test_a_literal_off_by_a_part_in_ten_to_the_twelve_is_seen(
    tmp_path: Path, folder: str, model: str, engine: str, address: str
) -> None:
    """Of the pendulum's discrepancy 4e-14 are the 1e-14 kg m² that its files give a point mass."""
    own = sidecar(folder, model)
    (bound,) = (b for b in bindings(prepared(folder).system, own) if b.address == address)
    moved = with_literals(own, {address: bound.value * (1 + 1e-12)}, tmp_path / "moved")
    right, wrong = (stepped(folder, one, engine) for one in (own, moved))
    assert right is not None
    assert wrong is not None
    assert right.judgement.largest_discrepancy < 1e-13
    seen = max(wrong.judgement.uncertainty, 2 * right.judgement.largest_discrepancy)
    assert seen < wrong.judgement.discrepancy < 2e-12


@pytest.mark.parametrize(("file", "engine", "integrator"), [
    (DATA / "kuka_iiwa" / "model.urdf", "pybullet", ""),
    (DATA / "kuka_iiwa" / "model.urdf", "mujoco", "implicit"),
    (DATA / "kuka_iiwa" / "model.urdf", "pinocchio", ""),
    (ASSETS / "ant.xml", "mujoco", "Euler"),
    (ASSETS / "ant.xml", "mujoco", "RK4"),
    (ASSETS / "ant.xml", "mujoco", "implicit"),
])  # fmt: skip
def test_a_robots_next_state_is_the_equations(file: Path, engine: str, integrator: str) -> None:
    """With a free base: MuJoCo's RK4 turns it by Munthe-Kaas's rule."""
    robot = robot_of(file)
    task = model_task(robot, engine)
    if integrator:
        task = task.with_settings(integrator=integrator)
    model, coordinates = task.load()
    bodies, drawn = SteppedBodies(robot.tree), robot.samples
    found = step_engine(model, coordinates, bodies, drawn.start, drawn.start_inputs, 1e-12)
    assert found is not None
    assert found.judgement.outcome is Outcome.AGREES
    assert found.judgement.largest_discrepancy < 1e-12


STIFF = """<mujoco><option timestep="{}" integrator="{}"/><worldbody>
<body pos="-0.3 0 0" euler="-34 8 -36"><joint name="j0" type="slide" axis="1 0.2 -0.3" damping="4"/>
<inertial pos="0.1 -0.1 0" mass="4e-4" diaginertia="1.4e-6 1.6e-6 2e-6"/>
<body pos="0 0.2 -0.2" euler="40 -25 32"><joint name="j1" axis="0.3 1.5 -1" damping="100"/>
<inertial pos="0.06 0 -0.06" mass="0.009" diaginertia="4.7e-6 5.7e-6 7.1e-6"/></body>
<body pos="0.4 0 0" euler="15 -11 -26"><joint name="j2" type="slide" axis="0.2 0.6 0.8"/>
<inertial pos="-0.1 0.2 0" mass="4e-4" diaginertia="2e-6 2e-6 2e-6"/></body></body></worldbody>
<actuator><position joint="j0" kp="960" kv="230"/><position joint="j1" kp="2300" kv="150"/>
<position joint="j2" kp="1900" kv="800"/></actuator></mujoco>"""
"""Servos that settle within nanoseconds."""


@pytest.mark.parametrize(("integrator", "step", "known"), [
    ("RK4", 2e-3, False), ("RK4", 1e-9, True), ("implicit", 2e-3, True),
])  # fmt: skip
def test_of_runge_kutta_steps_that_are_not_stable_nothing_is_claimed(
    tmp_path: Path, integrator: str, step: float, known: bool
) -> None:
    """Its stages turn a joint by some 1e6 rad; a rule of one stage has no such numbers."""
    file = tmp_path / "stiff.xml"
    file.write_text(STIFF.format(step, integrator))
    found = run_case(model_task(prepare_tree(file, states=8), "mujoco")).stepping
    assert (found is not None) is known
    assert found is None or found.outcome is not Outcome.DIFFERS


@dataclass
class OneStepOff(SymplecticEuler):
    """Sound as its step goes to zero, and another at the very step that it ships with."""

    by: float = 1e-9

    @property
    def step_rule(self) -> StepRule:
        return StepRule(scheme="semi-implicit Euler")

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        ends_q, ends_v = super().rollout(q, v, h, n, force, every)
        return ends_q, ends_v + (self.by if h == self.step else 0.0)


@pytest.mark.parametrize(("by", "outcome"), [(0.0, Outcome.AGREES), (1e-9, Outcome.DIFFERS)])
def test_what_acts_at_the_shipped_step_alone_is_seen(
    bench: MakeBench, by: float, outcome: Outcome
) -> None:
    own = bench(OneStepOff(by=by))
    motion, equations = own.motion, SteppedEquations(own.equations)
    inputs = motion.inputs(motion.t)
    found = step_engine(own.model, own.coordinates, equations, motion.start, inputs, 1e-9)
    assert found is not None
    assert found.judgement.outcome is outcome


def test_another_integrator_than_it_says_is_seen(bench: MakeBench) -> None:
    class Explicit(OneStepOff):
        @property
        def step_rule(self) -> StepRule:
            return StepRule(scheme="Runge-Kutta 4")

    own = bench(Explicit(by=0.0))
    motion, equations = own.motion, SteppedEquations(own.equations)
    inputs = motion.inputs(motion.t)
    found = step_engine(own.model, own.coordinates, equations, motion.start, inputs, 1e-9)
    assert found is not None
    assert found.judgement.outcome is Outcome.DIFFERS


@dataclass
class Coarse(SymplecticEuler):
    """In 24 binary digits, of which its accelerations lose most, as where a matrix is solved."""

    epsilon: float = float(np.finfo(np.float32).eps)

    @property
    def step_rule(self) -> StepRule:
        return StepRule(scheme="semi-implicit Euler")

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        assert n == every
        assert not isinstance(force, StateForce)
        q, v, large = q.astype(np.float32), v.astype(np.float32), np.float32(3e4)
        for i in range(n):
            held = 0.0 if force is None else force[:, i]
            pull = held - self.stiffness * q - self.damping * v
            a = (pull / self.mass).astype(np.float32) + large - large
            v = v + np.float32(h) * a
            q = q + np.float32(h) * v
        return q[:, None].astype(float), v[:, None].astype(float)


def test_what_short_numbers_lose_on_the_way_is_no_other_integrator(bench: MakeBench) -> None:
    own = bench(Coarse())
    motion, equations = own.motion, SteppedEquations(own.equations)
    inputs = motion.inputs(motion.t)
    found = step_engine(own.model, own.coordinates, equations, motion.start, inputs, 1e-9)
    assert found is not None
    assert found.judgement.outcome is not Outcome.DIFFERS
    assert found.judgement.largest_discrepancy > 1e-5


def test_no_rule_says_nothing(bench: MakeBench) -> None:
    own = bench()
    none = np.zeros((1, 1))
    start = own.motion.start[:1]
    stepped_equations = SteppedEquations(own.equations)
    assert step_engine(own.model, own.coordinates, stepped_equations, start, none, 1e-9) is None


def test_a_case_tells_its_next_state_beside_its_limit() -> None:
    own = prepared("drum_pendulum")
    model = sidecar("drum_pendulum", "mujoco_rolling.xml")
    case: Case = run_case(_task(own, model))
    assert case.outcome is Outcome.AGREES
    assert case.stepping is not None
    assert case.stepping.outcome is Outcome.DIFFERS


def _task(own: PreparedSystem, model: Sidecar) -> SystemTask:
    return model_task(own, "mujoco", model, scenario=next(iter(own.motions)))


def test_a_thousand_steps_stay_within_their_own_roundings() -> None:
    """Of a linear oscillator, whose differences don't grow: a last digit a step at most."""
    own = prepared("mass_spring_damper")
    model, coordinates = load(own.system, sidecar("mass_spring_damper", "mujoco.xml"), "mujoco")
    motion = own.motions["free"]
    inputs = motion.inputs(motion.t)
    assert own.stepped is not None
    found = step_engine(model, coordinates, own.stepped, motion.start, inputs, 1e-12, long=True)
    assert found is not None
    assert 0 < found.long < 10_000
    once = step_engine(model, coordinates, own.stepped, motion.start, inputs, 1e-12)
    assert once is not None
    assert np.isnan(once.long)
