"""Numbers that whole steps depend on, and quantities that a file's numbers act as."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from physics_crosscheck.harness.checks.acting import acting_quantities
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.diagnosis.law_problem import law_problem
from physics_crosscheck.harness.diagnosis.robot_task import diagnose_robot
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.mjcf.read import law_model
from physics_crosscheck.records import Diagnosis
from physics_crosscheck.reference.laws.acting import Servo, pressed, rest_on
from physics_crosscheck.reference.laws.constraints import mix_surfaces
from physics_crosscheck.reference.laws.step import LawModel
from tests.coverage.test_robot import STOP
from tests.laws.scenes import LIMITS, URDF_ARM, URDF_BOX

BOX = """<mujoco><option {}/><worldbody>
<geom name="floor" type="plane" size="3 3 .1" friction=".7 .02 .003"/>
<body pos="0 0 .05"><freejoint/>
<geom type="box" size=".1 .07 .05" mass="1" friction=".5 .05 .001"/></body></worldbody></mujoco>"""
OPTIONS = 'integrator="implicitfast" cone="elliptic"'
OTHER_ROWS = "range, where other rows act"
FAULTS = {
    "range": (STOP, "-60 40", "-60 40.00004", "joint[a]@range[1]", 40.00004),
    OTHER_ROWS: (STOP, "-60 40", "-60.6 40", "joint[a]@range[0]", -60.6),
    "frictionloss": (STOP, 'loss="0.3"', 'loss="0.303"', "joint[a]@frictionloss", 0.303),
    "solimp": (LIMITS, ".97 .05", ".9700097 .05", "joint[a]@solimplimit[1]", 0.9700097),
    "friction": (BOX, 'friction=".7', 'friction=".7000007', "geom[floor]@friction[0]", 0.7000007),
    "solref": (LIMITS, '"-800', '"-808', "joint[a]@solreflimit[0]", -808),
}  # fmt: skip


def diagnosed(tmp_path: Path, text: str, loaded: str) -> Diagnosis:
    """Diagnose an engine that acts by another text."""
    file, copy = tmp_path / "scene.xml", tmp_path / "copy.xml"
    file.write_text(text)
    copy.write_text(loaded)
    task = model_task(prepare_tree(file, states=4), "mujoco")
    return diagnose_robot(task.with_file(copy), is_reference=True)


@pytest.mark.parametrize("fault", FAULTS)
def test_wrong_number_and_its_value_are_named(
    tmp_path: Path, request: pytest.FixtureRequest, fault: str
) -> None:
    """Catch a cause without a line, another number, or another value."""
    if fault != OTHER_ROWS:
        request.getfixturevalue("few_states")
    scene, right, wrong, address, value = FAULTS[fault]
    scene = scene.format(OPTIONS)
    assert right in scene
    diagnosis = diagnosed(tmp_path, scene, scene.replace(right, wrong, 1))
    assert diagnosis.explained
    (cause,) = diagnosis.explanations[0].causes
    assert cause.subject[0].endswith(address)
    assert cause.estimate == pytest.approx(value, rel=1e-7)
    (place,) = cause.locations
    assert place.line == scene[: scene.index(right)].count("\n") + 1 + ("\n" in right)
    assert place.span is not None


def test_steps_that_agree_have_no_cause(tmp_path: Path) -> None:
    """Catch a diagnosis that names a number although nothing differs."""
    assert diagnosed(tmp_path, STOP, STOP).explanations == ()


HARD_FAULTS = {
    "limit": (URDF_ARM, 'upper=".7"', 'upper=".71"', "joint[shoulder]/limit@upper", 0.71),
    "effort": (URDF_ARM, 'effort="7"', 'effort="7.00001"', "joint[shoulder]/limit@effort", 7.00001),
    "restitution": (URDF_BOX, 'restitution value=".6"', 'restitution value=".6000006"',
                    "link[body]/contact/restitution@value", 0.6000006),
}  # fmt: skip


@pytest.mark.parametrize(
    "fault", ["limit", "effort", pytest.param("restitution", marks=pytest.mark.slow)]
)
def test_number_of_impulses_and_its_value_are_named(tmp_path: Path, fault: str) -> None:
    """Catch a cause without a line, another number, or another value."""
    pytest.importorskip("pybullet")
    text, right, wrong, address, value = HARD_FAULTS[fault]
    file, copy = tmp_path / "robot.urdf", tmp_path / "copy.urdf"
    file.write_text(text)
    copy.write_text(text.replace(right, wrong, 1))
    floating = text == URDF_BOX
    task = model_task(prepare_tree(file, states=4, floating=floating), "pybullet")
    diagnosis = diagnose_robot(task.with_file(copy), is_reference=True)
    assert diagnosis.explained
    (cause,) = diagnosis.explanations[0].causes
    assert cause.subject == (address,)
    assert cause.estimate == pytest.approx(value, rel=1e-7)
    (place,) = cause.locations
    assert place.line == text[: text.index(right)].count("\n") + 1


@pytest.mark.parametrize(
    ("text", "floating"), [(URDF_ARM, False), pytest.param(URDF_BOX, True, marks=pytest.mark.slow)]
)
def test_cached_effect_equals_a_new_solution(tmp_path: Path, text: str, floating: bool) -> None:
    """Catch a known solution that is kept although a number changes it."""
    pytest.importorskip("pybullet")
    file = tmp_path / "robot.urdf"
    file.write_text(text)
    task = model_task(prepare_tree(file, states=4, floating=floating), "pybullet")
    problem: Any = law_problem(task)
    acted = 0
    evaluated = problem.evaluated[::2]
    before = problem.comparison.expected_by(problem.comparison.laws, evaluated)
    for i in problem.numbers.law_numbers:
        laws = problem.numbers.laws({i: (0.5, 1.01)[i % 2] * problem.numbers.numerals[i].value})
        assert laws is not None
        kept = problem.comparison.expected_by(laws, evaluated)
        # A new tree is solved from the start.
        solved = problem.comparison.expected_by(replace(laws, tree=replace(laws.tree)), evaluated)
        assert kept == pytest.approx(solved, rel=1e-11, abs=1e-11)
        acted += not np.allclose(kept, before, rtol=1e-9, atol=1e-9)
    assert acted >= 4


SLOPE = np.deg2rad(10)

G = 9.81
SLIDE = """<mujoco><option {option} gravity="{x} 0 {z}" tolerance="0" iterations="200"/>
<worldbody><geom type="plane" size="5 5 1" friction="0.6"/>
<body pos="0 0 0.1"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>
<joint type="slide" axis="0 0 1"/><geom type="sphere" size="0.1" mass="2" {geom}/>
</body></worldbody></mujoco>"""


def loaded(folder: Path, text: str) -> tuple[LawModel, Any, Any]:
    """Return the laws of a file, and the file in MuJoCo."""
    path = folder / "r.xml"
    path.write_text(text)
    laws = law_model(engines()["mujoco"].compiled(path))
    assert laws is not None
    model = mujoco.MjModel.from_xml_string(text)
    return laws, model, mujoco.MjData(model)


ELLIPTIC, PYRAMIDAL = 'cone="elliptic" impratio="10"', 'cone="pyramidal" impratio="3"'


@pytest.mark.parametrize(("option", "geom"), [
    ('cone="elliptic"', ""), ('cone="pyramidal"', 'solref="0.01 0.7"'), (PYRAMIDAL, 'condim="1"'),
    *((option, geom) for option in (ELLIPTIC, PYRAMIDAL)
      for geom in ('solimp="0.5 0.99 0.0002 0.3 3"', 'solref="-2000 -50" friction="0.9"')),
])  # fmt: skip
def test_depth_at_rest_and_the_creep_on_a_slope_are_those_of_the_engine(
    option: str, geom: str, tmp_path: Path
) -> None:
    """Catch the loss of a pyramid's edges that share the weight, an impedance that depends on the
    depth, the direct format, or the ratio of friction to normal forces.
    """
    flat = SLIDE.format(option=option, geom=geom, x=0, z=-G)
    laws, model, data = loaded(tmp_path, flat)
    contact = mix_surfaces(*laws.laws.surfaces)
    depth, _ = rest_on(contact, laws.laws, float(laws.weights.bodies[1, 0]), 2 * G)
    mujoco.mj_step(model, data, 4000)
    assert 0.1 + data.qpos[2] == pytest.approx(0.1 - depth, abs=1e-13)
    if contact.dimension == 1:
        return
    slope = SLIDE.format(option=option, geom=geom, x=G * np.sin(SLOPE), z=-G * np.cos(SLOPE))
    laws, model, data = loaded(tmp_path, slope)
    _, creep = rest_on(contact, laws.laws, float(laws.weights.bodies[1, 0]), 2 * G * np.cos(SLOPE))
    mujoco.mj_step(model, data, 4000)
    assert data.qvel[0] == pytest.approx(creep / np.cos(SLOPE), rel=1e-9)


CART = """<mujoco><worldbody><geom type="plane" size="5 5 .1"/><body pos="0 0 .1"><freejoint/>
<geom type="box" size=".2 .1 .04" mass="5"/><geom size=".03" pos=".15 .08 -.07" mass=".1"/>
<geom size=".03" pos=".15 -.08 -.07" mass=".1"/><geom size=".03" pos="-.15 0 -.07" mass=".1"/>
</body></worldbody></mujoco>"""


def test_creep_is_that_of_a_body_on_all_its_feet(tmp_path: Path) -> None:
    (file := tmp_path / "cart.xml").write_text(CART, encoding="utf-8")
    quantities = acting_quantities(engines()["mujoco"].compiled(file))
    (creep,) = (one for one in quantities if one.quantity == "creep")
    assert "the weight on 3 contacts" in creep.rule
    model = mujoco.MjModel.from_xml_path(str(file))
    model.opt.gravity[:] = 9.81 * np.sin(SLOPE), 0, -9.81 * np.cos(SLOPE)
    mujoco.mj_step(model, data := mujoco.MjData(model), 2000)
    assert data.qvel[0] == pytest.approx(creep.value, rel=1e-2)


LIMIT = """<mujoco><option timestep="{step}" gravity="0 0 0"/><compiler angle="radian"/>
<worldbody><body><joint name="a" range="-3 0.5" limited="true" solreflimit="{reference}"
 solimplimit="0.9 0.9 0.001"/><geom size="0.1" pos="0.3 0 0" mass="2"/></body></worldbody>
</mujoco>"""


@pytest.mark.parametrize("reference", ["0.02 1", "0.02 0.3", "0.02 2", "-2000 -30", "-2000 0"])
def test_rebound_at_a_limit_is_that_of_the_engine(reference: str, tmp_path: Path) -> None:
    text = LIMIT.format(step=1e-5, reference=reference)
    laws, model, data = loaded(tmp_path, text)
    limit = laws.laws.limits[0]
    data.qpos[0], data.qvel[0] = 0.4999, 1.0
    for _ in range(200):
        mujoco.mj_step(model, data, 100)
        if data.qvel[0] < 0 and data.qpos[0] < 0.4:
            break
    rebound = pressed(limit.softness, laws.laws).rebound
    assert -data.qvel[0] == pytest.approx(rebound, rel=2e-3)


SERVO = """<mujoco><option timestep="{step}" gravity="0 0 -9.81" integrator="{integrator}"/>
<worldbody><body><joint name="a" type="slide" axis="0 0 1" armature="0.3" damping="{damping}"/>
<geom size="0.1" mass="2"/></body></worldbody>
<actuator><position joint="a" kp="{kp}" kv="{kv}"/></actuator></mujoco>"""


def servo(laws: LawModel, kp: float, kv: float, damping: float, implicit: bool) -> Servo:
    posture = next(laws.tree.postures(laws.home[None], np.zeros((1, 1))))
    return Servo(
        inertia=float(posture.mass[0, 0]),
        stiffness=kp,
        damping=0.0 if implicit else kv,
        implicit_damping=damping + (kv if implicit else 0.0),
        load=float(posture.smooth[0]),
        step=laws.laws.step,
    )


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast"])
@pytest.mark.parametrize(("kv", "damping"), [(3.0, 1.0), (0.0, 20.0), (40.0, 0.0)])
def test_gain_at_which_the_step_grows_is_that_of_the_engine(
    kv: float, damping: float, integrator: str, tmp_path: Path
) -> None:
    for share, grows in ((0.99, False), (1.01, True)):
        text = SERVO.format(step=0.005, integrator=integrator, kp=1e4, kv=kv, damping=damping)
        laws, *_ = loaded(tmp_path, text)
        limit = servo(laws, 1e4, kv, damping, integrator == "implicitfast").unstable_stiffness
        text = text.replace('kp="10000.0"', f'kp="{share * limit}"')
        _, model, data = loaded(tmp_path, text)
        model.opt.gravity[:] = 0
        data.qpos[0] = 1e-3
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        far = []
        for _ in range(60):
            mujoco.mj_step(model, data, 20)
            far.append(abs(data.qpos[0]))
        assert bool(max(far) > 1e-2) is grows


def test_frequency_damping_and_sag_of_a_servo_are_those_of_the_engine(tmp_path: Path) -> None:
    text = SERVO.format(step=2e-5, integrator="Euler", kp=500, kv=3, damping=1)
    laws, model, data = loaded(tmp_path, text)
    expected = servo(laws, 500, 3, 1, implicit=False)
    data.qpos[0] = expected.sag
    mujoco.mj_step(model, data, 1000)
    assert data.qpos[0] == pytest.approx(expected.sag, abs=1e-13)  # it stays there
    data.qpos[0] = expected.sag + 0.01
    positions = []
    for _ in range(45_000):
        mujoco.mj_step(model, data)
        positions.append(data.qpos[0] - expected.sag)
    x = np.array(positions)
    peaks = [i for i in range(1, len(x) - 1) if x[i - 1] < x[i] >= x[i + 1]]
    period = 2e-5 * (peaks[1] - peaks[0])
    motion = expected.motion
    damped = motion.rate * np.sqrt(1 - motion.damping**2)
    assert period == pytest.approx(2 * np.pi / damped, rel=1e-3)
    decay = np.log(x[peaks[0]] / x[peaks[1]]) / period
    assert decay == pytest.approx(motion.damping * motion.rate, rel=1e-3)
