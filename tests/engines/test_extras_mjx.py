"""MJX is MuJoCo in JAX: the same file gives the same model to the last digits."""

from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.engine import EngineError, LoadedModel, ModelSpec, StateForce
from physics_crosscheck.harness.checks.whole_step import WholeStepCheck, check_whole_step
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.records import Outcome
from tests.engines.extras import need
from tests.laws.scenes import CONNECT

MODELS = Path(__file__).parents[2] / "models"


def load(path: Path, engine: str = "mjx", **settings: object) -> LoadedModel:
    need("mjx")
    return engines()[engine].load(ModelSpec(path, settings=settings))


@pytest.mark.parametrize(("bits", "apart"), [(64, 1e-13), (32, 1e-4)])
def test_motions_match_mujoco_to_its_precision(bits: int, apart: float) -> None:
    path = MODELS / "free_pair" / "mujoco.xml"
    model, other = load(path, bits=bits), load(path, "mujoco")
    assert model.epsilon == np.finfo(f"float{bits}").eps
    rng = np.random.default_rng(0)
    q, v = rng.normal(size=(2, 3, 2))
    push = rng.normal(size=(3, 700, 2))
    ends = model.rollout(q, v, 1e-3, 700, push, 350)
    for end, expected in zip(ends, other.rollout(q, v, 1e-3, 700, push, 350), strict=True):
        assert np.max(np.abs(end - expected)) < apart
    assert np.max(np.abs(ends[0][:, 1] - q)) > 0.1
    by_state = model.rollout(q, v, 1e-3, 20, StateForce(push[:, :20], lambda z, u: u), 20)
    numbers = model.rollout(q, v, 1e-3, 20, push[:, :20], 20)
    assert np.array_equal(by_state[0], numbers[0])


def test_features_that_mjx_lacks_or_ignores_are_rejected(tmp_path: Path) -> None:
    path = MODELS / "free_pair" / "mujoco.xml"
    with pytest.raises(EngineError, match="mjINT_IMPLICIT"):
        load(path, integrator="implicit")
    with pytest.raises(EngineError, match="expected 32 or 64"):
        load(path, bits=16)
    copy = tmp_path / "bent.xml"
    text = (MODELS / "mass_spring_damper" / "mujoco.xml").read_text()
    assert 'damping="0.9"' in text
    copy.write_text(text.replace('damping="0.9"', 'damping="0.9 0.2"'))
    with pytest.raises(EngineError, match="a polynomial of dof_damping, which MJX ignores"):
        load(copy)


WHOLE = """<mujoco><option timestep="0.002" {}/><worldbody>
<geom type="plane" size="5 5 .1" friction=".9 .01 .001"/>
<body pos="0 0 .095"><freejoint/><geom size=".1" mass="1" friction=".4" condim="4" solref=".03 .8"/>
</body><body pos="1 0 1"><joint name="a" axis="0 1 0" range="-5 10" frictionloss=".4" damping=".2"/>
<geom type="capsule" fromto="0 0 0 .4 0 0" size=".04" mass="1" contype="0" conaffinity="0"/>
<body pos=".4 0 0"><joint name="b" axis="0 1 0" range="-20 20"/>
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass=".5" contype="0" conaffinity="0"/>
</body></body></worldbody><tendon><fixed name="f" damping=".1"><joint joint="a" coef="1"/>
<joint joint="b" coef="-1"/></fixed></tendon><actuator>
<position joint="a" kp="40" kv="2" forcerange="-3 3"/>
<general tendon="f" gaintype="affine" gainprm="1 0 -.5" ctrlrange="-1 1"/></actuator></mujoco>"""
FAST = 'integrator="implicitfast" cone="elliptic"'
FAULTS = {
    "friction by product": ('friction=".9 .01', 'friction=".36 .01'),
    "solref": ('solref=".03 .8"', 'solref=".03000003 .8"'),
    "dry friction": ('frictionloss=".4"', 'frictionloss=".4000004"'),
    "force range": ('forcerange="-3 3"', 'forcerange="-3 3.000003"'),
    "lost limit": ('range="-5 10"', 'range="-500 1000"'),
}


def whole_step(tmp_path: Path, text: str, loaded: str) -> WholeStepCheck:
    """Compare the law of a text with MJX on another one."""
    need("mjx")
    file, copy = tmp_path / "scene.xml", tmp_path / "copy.xml"
    file.write_text(text)
    copy.write_text(loaded)
    check = check_whole_step(file, ModelSpec(copy), "mjx", 1e-9)
    assert check is not None
    return check


@pytest.mark.parametrize("options", [FAST, 'integrator="Euler"'])
def test_whole_steps_follow_mujocos_law(tmp_path: Path, options: str) -> None:
    """Catch a row, a cone, or dampers of drives and tendons that MJX treats otherwise."""
    check = whole_step(tmp_path, WHOLE.format(options), WHOLE.format(options))
    assert check.judgement is not None
    assert check.record.outcome is Outcome.AGREES
    assert check.judgement.largest_discrepancy < 1e-11
    assert {term.name for term in check.record.acted} == {
        "dry friction", "contacts", "limits", "drives", "drives at a limit"
    }  # fmt: skip


def test_equalities_follow_mujocos_law_without_drift(tmp_path: Path) -> None:
    """Catch the term J-dot v, which MJX leaves out, and rows of joints, tendons and frames."""
    text = CONNECT.format('integrator="Euler"')
    check = whole_step(tmp_path, text, text)
    assert check.judgement is not None
    assert check.record.outcome is Outcome.AGREES
    assert check.judgement.largest_discrepancy < 1e-10


@pytest.mark.parametrize("fault", FAULTS)
def test_planted_faults_of_whole_steps_are_detected(tmp_path: Path, fault: str) -> None:
    """Catch a wrong mixing rule, a lost limit, and numbers that are wrong by a millionth."""
    right, wrong = FAULTS[fault]
    text = WHOLE.format(FAST)
    assert text.count(right) == 1
    check = whole_step(tmp_path, text, text.replace(right, wrong))
    assert check.record.outcome is Outcome.DIFFERS


def test_actearly_that_mjx_ignores_differs(tmp_path: Path) -> None:
    """Catch `actearly`, which MJX ignores, passed as equal."""
    drive = '<general joint="b" dyntype="integrator" actearly="true"/></actuator>'
    text = WHOLE.format(FAST).replace("</actuator>", drive)
    assert whole_step(tmp_path, text, text).record.outcome is Outcome.DIFFERS


def test_contacts_that_mjx_rejects_are_reported(tmp_path: Path) -> None:
    """Catch a refusal of MJX that ends the case."""
    text = WHOLE.format(FAST).replace('condim="4"', 'condim="1"')
    plane = text.replace('size="5 5 .1"', 'size="5 5 .1" condim="1"')
    record = whole_step(tmp_path, plane, plane).record
    assert record.outcome is None
    assert "condim" in record.uncovered[0]
