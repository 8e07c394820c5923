"""Engines' accelerations and next states compared with the equations and their step rules."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pybullet_data
import pytest

from physics_crosscheck.engine import Array
from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.prepare import PreparedSystem, PreparedTree, prepare_tree
from physics_crosscheck.harness.checks.task import SystemTask, load, model_task
from physics_crosscheck.harness.engines.protocol import StepRule
from physics_crosscheck.harness.modelfiles.bindings import bindings, with_literals
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
from physics_crosscheck.harness.numerics.stepping import StepComparison, step_engine
from physics_crosscheck.records import Case, Outcome
from physics_crosscheck.reference.mechanism.laws import Substeps
from physics_crosscheck.reference.solving.next_state import SteppedBodies, SteppedEquations
from tests.engines.extras import need
from tests.models import robot_task
from tests.numerics.conftest import MakeBench, SymplecticEuler
from tests.physics import physics
from tests.physics import physics as prepared

ASSETS = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"
DATA = Path(pybullet_data.getDataPath())
INTEGRATORS = ("Euler", "implicit", "implicitfast", "RK4")
SYSTEMS = (
    "anchored_pair", "drum_pendulum", "free_pair", "mass_spring_damper", "simple_pendulum",
    "torsional_disc",
)  # fmt: skip
FIVE = 5.0
"""Last digits of a component's largest value after one step; most errors are within one."""


@cache
def robot_of(file: Path) -> PreparedTree:
    return prepare_tree(file, states=8)


def sidecar(folder: str, model: str) -> Sidecar:
    sidecars = (one for one in model_files(builtin() / folder) if isinstance(one, Sidecar))
    return next(one for one in sidecars if one.model.name == model)


def stepped(
    folder: str, model: Sidecar, engine: str, resolution: float = 1e-12
) -> StepComparison | None:
    """Compare one step from every segment of the first scenario."""
    physics = prepared(folder)
    motion = next(iter(physics.motions.values()))
    loaded, coordinates = load(physics.system, model, engine)
    assert physics.stepped is not None
    inputs = motion.inputs(motion.t)
    return step_engine(loaded, coordinates, physics.stepped, motion.start, inputs, resolution)


@pytest.mark.parametrize(("folder", "model", "engine"), [
    ("mass_spring_damper", "mujoco.xml", "mujoco"),
    ("mass_spring_damper", "robot.urdf", "pybullet"),
    ("drum_pendulum", "mujoco.xml", "mujoco"),
    ("drum_pendulum", "robot.urdf", "pybullet"),
    ("drum_pendulum", "robot_folded.urdf", "mujoco"),
])  # fmt: skip
def test_next_state_matches_the_engines_step_rule(folder: str, model: str, engine: str) -> None:
    """PyBullet's gear constraint keeps the drum rolling at dt = 2 ms."""
    result = stepped(folder, sidecar(folder, model), engine)
    assert result is not None
    assert result.judgement.outcome is Outcome.AGREES
    assert result.judgement.largest_discrepancy < 1e-13
    assert result.digits <= FIVE


@pytest.mark.parametrize(("folder", "engine", "settings"), [
    ("mass_spring_damper", "pinocchio", {}), ("mass_spring_damper", "dart", {}),
    ("mass_spring_damper", "drake", {}), ("mass_spring_damper", "drake", {"stepping": "tamsi"}),
    ("mass_spring_damper", "drake", {"stepping": "continuous"}),
    ("drum_pendulum", "pinocchio", {"hold_mimics": True}),
    ("drum_pendulum", "drake", {"stepping": "continuous", "hold_mimics": True}),
])  # fmt: skip
def test_optional_engines_match_their_step_rules(
    folder: str, engine: str, settings: dict[str, object]
) -> None:
    """Check dampers at the end of a step in DART and SAP, at its start in TAMSI, per RK4 stage."""
    need(engine)
    base = sidecar(folder, "robot.urdf")
    result = stepped(folder, replace(base, engine_settings={engine: settings}), engine)
    assert result is not None
    assert result.judgement.outcome is Outcome.AGREES
    assert result.judgement.largest_discrepancy < 1e-13
    assert result.digits <= FIVE


@pytest.mark.parametrize("folder", ["anchored_pair", "mass_spring_damper", "torsional_disc"])
def test_dart_evaluates_springs_at_the_end_of_a_step(folder: str) -> None:
    need("dart")
    result = stepped(folder, sidecar(folder, "robot.sdf"), "dart")
    assert result is not None
    assert "springs" in result.rule.name
    assert result.judgement.outcome is Outcome.AGREES
    assert result.digits <= FIVE


@pytest.mark.parametrize("folder", SYSTEMS)
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_each_mujoco_integrator_matches_its_rule(integrator: str, folder: str) -> None:
    base = sidecar(folder, "mujoco.xml")
    settings = {**base.settings, "integrator": integrator}
    result = stepped(folder, replace(base, settings=settings), "mujoco")
    assert result is not None
    assert result.judgement.outcome is Outcome.AGREES
    assert result.digits <= FIVE


def test_soft_equality_shows_in_one_step() -> None:
    result = stepped("drum_pendulum", sidecar("drum_pendulum", "mujoco_rolling.xml"), "mujoco")
    assert result is not None
    assert result.judgement.outcome is Outcome.DIFFERS
    assert 1e-5 < result.judgement.discrepancy < 1e-4
    assert "soft" in result.rule.besides


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
def test_literal_off_by_1e_12_is_detected(
    tmp_path: Path, folder: str, model: str, engine: str, address: str
) -> None:
    """Allow for the 1e-14 kg m² of a point mass in the pendulum's files: 4e-14 of discrepancy."""
    original = sidecar(folder, model)
    (bound,) = (b for b in bindings(prepared(folder).system, original) if b.address == address)
    moved = with_literals(original, {address: bound.value * (1 + 1e-12)}, tmp_path / "moved")
    right, wrong = (stepped(folder, one, engine) for one in (original, moved))
    assert right is not None
    assert wrong is not None
    assert right.judgement.largest_discrepancy < 1e-13
    threshold = max(wrong.judgement.uncertainty, 2 * right.judgement.largest_discrepancy)
    assert threshold < wrong.judgement.discrepancy < 2e-12


@pytest.mark.parametrize(("file", "engine", "integrator"), [
    (DATA / "kuka_iiwa" / "model.urdf", "pybullet", ""),
    (DATA / "kuka_iiwa" / "model.urdf", "mujoco", "implicit"),
    (DATA / "kuka_iiwa" / "model.urdf", "pinocchio", ""),
    (ASSETS / "ant.xml", "mujoco", "Euler"),
    (ASSETS / "ant.xml", "mujoco", "RK4"),
    (ASSETS / "ant.xml", "mujoco", "implicit"),
])  # fmt: skip
def test_robot_next_states_match_the_equations(file: Path, engine: str, integrator: str) -> None:
    """Include a free base, which MuJoCo's RK4 turns by Munthe-Kaas's rule."""
    robot = robot_of(file)
    task = model_task(robot, engine)
    if integrator:
        task = task.with_settings(integrator=integrator)
    model, coordinates = task.load()
    bodies, drawn = SteppedBodies(robot.tree), robot.samples
    result = step_engine(model, coordinates, bodies, drawn.start, drawn.start_inputs, 1e-12)
    assert result is not None
    assert result.judgement.outcome is Outcome.AGREES
    assert result.judgement.largest_discrepancy < 1e-12


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


@pytest.mark.parametrize(("integrator", "step", "stable"), [
    ("RK4", 2e-3, False), ("RK4", 1e-9, True), ("implicit", 2e-3, True),
])  # fmt: skip
def test_unstable_runge_kutta_steps_are_not_compared(
    tmp_path: Path, integrator: str, step: float, stable: bool
) -> None:
    """Skip stages that turn a joint by about 1e6 rad; a rule of one stage has no such numbers."""
    result = run_case(robot_task(tmp_path, "stiff.xml", STIFF.format(step, integrator))).stepping
    assert (result is not None) is stable
    assert result is None or result.outcome is not Outcome.DIFFERS


@dataclass
class OneStepOff(SymplecticEuler):
    """Correct as its step goes to zero, but wrong at its own time step."""

    by: float = 1e-9

    @property
    def step_rule(self) -> StepRule:
        return StepRule(scheme="semi-implicit Euler")

    def altered(self, z: Array, w: Array, q: Array, h: float) -> tuple[Array, Array]:
        return z, w + (self.by if h == self.step else 0.0)


@pytest.mark.parametrize(("by", "outcome"), [(0.0, Outcome.AGREES), (1e-9, Outcome.DIFFERS)])
def test_fault_of_the_files_own_step_is_detected(
    bench: MakeBench, by: float, outcome: Outcome
) -> None:
    rig = bench(OneStepOff(by=by))
    motion, equations = rig.motion, SteppedEquations(rig.equations)
    inputs = motion.inputs(motion.t)
    result = step_engine(rig.model, rig.coordinates, equations, motion.start, inputs, 1e-9)
    assert result is not None
    assert result.judgement.outcome is outcome


def test_wrong_step_rule_is_detected(bench: MakeBench) -> None:
    class Explicit(OneStepOff):
        @property
        def step_rule(self) -> StepRule:
            return StepRule(scheme="Runge-Kutta 4")

    rig = bench(Explicit(by=0.0))
    motion, equations = rig.motion, SteppedEquations(rig.equations)
    inputs = motion.inputs(motion.t)
    result = step_engine(rig.model, rig.coordinates, equations, motion.start, inputs, 1e-9)
    assert result is not None
    assert result.judgement.outcome is Outcome.DIFFERS


@dataclass
class SinglePrecision(SymplecticEuler):
    """Single precision with accelerations that lose most digits, as in a matrix solve."""

    epsilon: float = float(np.finfo(np.float32).eps)

    @property
    def step_rule(self) -> StepRule:
        return StepRule(scheme="semi-implicit Euler")

    def stepped(self, q: Any, v: Any, push: Any, h: float) -> Any:
        q, v, large = np.float32(q), np.float32(v), np.float32(3e4)
        resultant = push - self.stiffness * q - self.damping * v
        v = v + np.float32(h) * (np.float32(resultant / self.mass) + large - large)
        return q + np.float32(h) * v, v

    def altered(self, z: Array, w: Array, q: Array, h: float) -> tuple[Array, Array]:
        return z.astype(float), w.astype(float)


@dataclass
class ManySubsteps(SinglePrecision):
    """Single precision in 255 substeps of 0.4 us, each of which adds a few last digits."""

    step: float = 1e-4

    @property
    def step_rule(self) -> StepRule:
        names = "stiffness", "damping", "target", "speed", "passive"
        none, free = dict.fromkeys(names, np.zeros(1)), np.array([np.inf])
        law = Substeps(count=255, repeats=0, order=(0,), effort=free, **none)
        return StepRule(scheme="semi-implicit Euler", substeps=law)

    def stepped(self, q: Any, v: Any, push: Any, h: float) -> Any:
        q, v, dt = np.float32(q), np.float32(v), np.float32(h / 255)
        gained = dt * np.float32((push - self.stiffness * q) / self.mass)
        for _ in range(255):
            v = v + gained
            q = q + dt * v
        return q, v


@pytest.mark.parametrize("single", [SinglePrecision(), ManySubsteps(damping=0.0)])
def test_single_precision_is_not_a_wrong_step_rule(
    bench: MakeBench, single: SinglePrecision
) -> None:
    rig = bench(single, damping=single.damping)
    motion, equations = rig.motion, SteppedEquations(rig.equations)
    inputs = motion.inputs(motion.t)
    result = step_engine(rig.model, rig.coordinates, equations, motion.start, inputs, 1e-9)
    assert result is not None
    assert result.judgement.outcome is not Outcome.DIFFERS
    assert result.judgement.largest_discrepancy > 1e-5


def test_engine_without_a_rule_gives_no_result(bench: MakeBench) -> None:
    rig = bench()
    inputs = np.zeros((1, 1))
    start = rig.motion.start[:1]
    stepped_equations = SteppedEquations(rig.equations)
    assert step_engine(rig.model, rig.coordinates, stepped_equations, start, inputs, 1e-9) is None


def test_case_reports_its_next_state_and_its_limit() -> None:
    physics = prepared("drum_pendulum")
    model = sidecar("drum_pendulum", "mujoco_rolling.xml")
    case: Case = run_case(_task(physics, model))
    assert case.outcome is Outcome.AGREES
    assert case.stepping is not None
    assert case.stepping.outcome is Outcome.DIFFERS


def _task(physics: PreparedSystem, model: Sidecar) -> SystemTask:
    return model_task(physics, "mujoco", model, scenario=next(iter(physics.motions)))


def test_thousand_steps_stay_within_rounding() -> None:
    """Use a linear oscillator, whose differences grow by at most one last digit per step."""
    physics = prepared("mass_spring_damper")
    model, coordinates = load(physics.system, sidecar("mass_spring_damper", "mujoco.xml"), "mujoco")
    motion = physics.motions["free"]
    inputs = motion.inputs(motion.t)
    assert physics.stepped is not None
    check = step_engine(model, coordinates, physics.stepped, motion.start, inputs, 1e-12, long=True)
    assert check is not None
    assert 0 < check.long < 10_000
    single = step_engine(model, coordinates, physics.stepped, motion.start, inputs, 1e-12)
    assert single is not None
    assert np.isnan(single.long)


KUKA, A1 = DATA / "kuka_iiwa" / "model.urdf", DATA / "a1" / "a1.urdf"


prepared_tree = cache(prepare_tree)


def compare_robot(
    file: Path, engine: str, *, floating: bool = False, resolution: float = 1e-9
) -> AccelerationComparison | None:
    task = model_task(
        prepared_tree(file, floating=floating, states=8), engine, resolution=resolution
    )
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
