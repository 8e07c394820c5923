"""Physical quantities computed from a file's numbers match the engine's motion."""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.mjcf.read import law_model
from physics_crosscheck.reference.laws.acting import Servo, pressed, rest_on
from physics_crosscheck.reference.laws.constraints import mix_surfaces
from physics_crosscheck.reference.laws.step import LawModel

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
    rest = rest_on(contact, laws.laws, float(laws.weights.bodies[1, 0]), 2 * G)
    mujoco.mj_step(model, data, 4000)
    assert 0.1 + data.qpos[2] == pytest.approx(0.1 - rest.depth, abs=1e-13)
    if contact.dimension == 1:
        return
    slope = SLIDE.format(option=option, geom=geom, x=G * np.sin(SLOPE), z=-G * np.cos(SLOPE))
    laws, model, data = loaded(tmp_path, slope)
    across = rest_on(contact, laws.laws, float(laws.weights.bodies[1, 0]), 2 * G * np.cos(SLOPE))
    mujoco.mj_step(model, data, 4000)
    assert data.qvel[0] == pytest.approx(across.creep / np.cos(SLOPE), rel=1e-9)


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
