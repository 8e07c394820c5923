"""Accelerations and linearizations in a case, also of robots and of built-in systems."""

import itertools
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pybullet_data
import pytest

from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.compiled_terms import run_linearizations
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.checks.verdict import CaseJudgement, with_dynamics
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.model_files import model_files
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.numerics.forward_dynamics import FORCE_KINDS, AccelerationComparison
from physics_crosscheck.harness.numerics.judgement import judge
from physics_crosscheck.harness.records.case import CheckedStep
from physics_crosscheck.harness.render.terminal.table import dynamics_lines
from physics_crosscheck.records import Case, EngineLinearization, Outcome
from tests.cases.test_robot import SERVO
from tests.models import written
from tests.records.made import case, full_run, verdict
from tests.robots.files import ADRIFT

MOTION = CaseJudgement(
    outcome=Outcome.UNRESOLVED,
    discrepancy=1e-9,
    uncertainty=3e-8,
    largest_discrepancy=1e-9,
    largest_uncertainty=3e-8,
    component="x",
    time=0.0,
    order=1.0,
    map_residual=float("nan"),
    map_uncertainty=float("nan"),
    reason="the limit of x is known to 3.0e-08 at best",
    resolution=1e-9,
)
UNKNOWN = replace(MOTION, uncertainty=float("inf"), largest_uncertainty=float("inf"))
AGREES = replace(MOTION, outcome=Outcome.AGREES, largest_uncertainty=1e-12, reason="")
DIFFERS = replace(MOTION, outcome=Outcome.DIFFERS, reason="x ends the segment 1e-3 off")


def comparison(off: float, *, complete: bool = True) -> AccelerationComparison:
    """Return accelerations of two coordinates at three states, with one error."""
    defect = np.zeros((3, 2))
    defect[1, 1] = off
    return AccelerationComparison(
        judgement=judge(defect, np.full((3, 2), 1e-14), 1e-9, None),
        states=3,
        complete=complete,
        force_errors=dict.fromkeys(FORCE_KINDS, 0.0) | {"mass matrix": off},
    )


def combined(motion: CaseJudgement, dynamics: AccelerationComparison | None) -> CaseJudgement:
    return with_dynamics(motion, dynamics, ("x", "phi"), 1e-9)


def test_accelerations_decide_a_stiff_motion() -> None:
    verdict = combined(MOTION, comparison(0.0))
    assert verdict.outcome is Outcome.AGREES
    assert verdict.largest_uncertainty == 1e-14
    assert verdict.reason == (
        "its accelerations, at 3 states, match the equations to 1.0e-14 of the largest; its"
        " motions: the limit of x is known to 3.0e-08 at best"
    )


@pytest.mark.parametrize(("motion", "dynamics"), [
    (MOTION, None), (MOTION, comparison(0.0, complete=False)), (UNKNOWN, comparison(0.0)),
    (AGREES, comparison(0.0)), (AGREES, comparison(1e-12)),
    (DIFFERS, comparison(0.0)), (DIFFERS, comparison(1.0)),
])  # fmt: skip
def test_motions_decide_when_accelerations_cannot(
    motion: CaseJudgement, dynamics: AccelerationComparison | None
) -> None:
    """Cover roughness at states without accelerations, and within a step."""
    assert combined(motion, dynamics) is motion


@pytest.mark.parametrize("motion", [MOTION, UNKNOWN, AGREES])
def test_differing_accelerations_make_the_case_differ(motion: CaseJudgement) -> None:
    verdict = combined(motion, comparison(1e-6))
    assert verdict.outcome is Outcome.DIFFERS
    assert verdict.component == "phi_ddot"
    assert verdict.discrepancy == 1e-6
    assert verdict.reason.startswith(
        "phi_ddot is off by 1.0e-06 of its largest value; the uncertainty is 1.0e-14;"
        " these of its forces differ: mass matrix; "
    )
    other = "all segments agree within 1.0e-12" if motion is AGREES else motion.reason
    assert verdict.reason.endswith(other)


def test_accelerations_resolve_a_servo_that_no_step_resolves(tmp_path: Path) -> None:
    file = tmp_path / "servo.xml"
    file.write_text(SERVO.format(20))
    case = run_case(model_task(prepare_tree(file), "mujoco"))
    assert case.outcome is Outcome.AGREES
    assert case.reason.startswith("its accelerations, at 200 states, match the equations to ")
    assert "its motions: the limit of stiff has an uncertainty of" in case.reason
    assert case.forward_dynamics is not None
    (line,) = dynamics_lines([case])
    assert line.startswith("accelerations of 1 case at 200 states agree to ")


DATA = Path(pybullet_data.getDataPath())
ARM = """<robot name="arm"><link name="base"/>
<link name="boom"><inertial><origin xyz="0.02 0 -0.3"/><mass value="1.3"/>
<inertia ixx="0.02" iyy="0.018" izz="0.006" ixy="0.001" ixz="0" iyz="0"/></inertial></link>
<joint name="lift" type="revolute"><parent link="base"/><child link="boom"/><axis xyz="0 1 0"/>
<limit lower="0.2" upper="1.4" effort="9" velocity="9"/><dynamics damping="0.7"/></joint></robot>
"""


def linearize(file: Path, engine: str = "mujoco", *, floating: bool = False) -> EngineLinearization:
    prepared = prepare_tree(file, motion=0.1, states=4, floating=floating)
    (result,) = run_linearizations(model_task(prepared, engine))
    return result


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_linearization_of_an_arm_matches_its_formula(tmp_path: Path, engine: str) -> None:
    """J a + c v + m g (sin, cos) . center = u about 0.8 rad, by hand."""
    if engines()[engine].version() is None:
        pytest.skip(f"{engine} is not installed")
    file = written(tmp_path, "arm.urdf", ARM)
    result = linearize(file, engine)
    inertia = 0.018 + 1.3 * (0.3**2 + 0.02**2)
    # The height of the center is -0.02 sin q - 0.3 cos q.
    stiffness = 1.3 * 9.81 * (0.02 * np.sin(0.8) + 0.3 * np.cos(0.8))
    by_hand = np.array([[0, 1], [-stiffness / inertia, -0.7 / inertia]])
    np.testing.assert_allclose(np.array(result.a, dtype=float), by_hand, atol=1e-7)
    np.testing.assert_allclose(np.array(result.b, dtype=float)[1], 1 / inertia, rtol=1e-8)
    assert not result.differs


@pytest.mark.slow
def test_step_of_a_floating_robot_matches_mujoco_differences(tmp_path: Path) -> None:
    file = written(tmp_path, "adrift.urdf", ADRIFT)
    result = linearize(file, floating=True)
    assert (result.a_error or 1) < 1e-9
    assert (result.b_error or 1) < 1e-9
    assert not result.differs
    assert result.one_step is not None
    assert (result.one_step.error or 1) < 1e-11


def test_step_of_a_cartpole_matches_mujoco_transition() -> None:
    file = DATA / "cartpole.urdf"
    result = linearize(file)
    model = mujoco.MjModel.from_xml_path(str(file))
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data = mujoco.MjData(model)
    expected = np.zeros((4, 4))
    mujoco.mjd_transitionFD(model, data, 1e-6, True, expected, None, None, None)
    assert result.one_step is not None
    np.testing.assert_allclose(np.array(result.one_step.a, dtype=float), expected, atol=1e-8)


def test_changed_damping_differs(tmp_path: Path) -> None:
    file, copy = tmp_path / "arm.urdf", tmp_path / "copy.urdf"
    file.write_text(ARM)
    copy.write_text(ARM.replace('damping="0.7"', 'damping="0.70001"'))
    prepared = prepare_tree(file, motion=0.1, states=4)
    (result,) = run_linearizations(model_task(prepared, "mujoco").with_file(copy))
    assert result.differs
    assert (result.a_error or 0.0) > 1e-7


FOLDERS = sorted(path.parent for path in builtin().glob("*/system.py"))

SIX = {
    "anchored_pair", "drum_pendulum", "free_pair", "mass_spring_damper", "simple_pendulum",
    "torsional_disc",
}  # fmt: skip
"""Systems that have a model in every engine and format. Other systems may have fewer."""


def sidecars(folder: Path) -> list[Sidecar]:
    return [one for one in model_files(folder) if isinstance(one, Sidecar)]


def test_all_six_systems_run_in_all_four_pairings() -> None:
    pairings = {("mujoco", ".xml"), ("mujoco", ".urdf"), ("pybullet", ".urdf"), ("pymunk", ".py")}
    seen = {
        (folder.name, engine, sidecar.model.suffix)
        for folder in FOLDERS
        for sidecar in sidecars(folder)
        for engine in sidecar.engines
        if folder.name in SIX and not engines()[engine].extra
    }
    assert seen == {(name, *pairing) for name, pairing in itertools.product(SIX, pairings)}


def test_make_target_runs_builtin_models_with_required_engines() -> None:
    text = (Path(__file__).parents[2] / "Makefile").read_text()
    lines = text.replace("\\\n", "").splitlines()
    assert any("--crosscheck models" in line and "--require-engines" in line for line in lines)


TOO_LARGE = CheckedStep(target=0.001, step=1e-4, measured=0.002)


@pytest.mark.parametrize(("fault", "count"), [
    (case(), 0),
    (case(verdict=verdict(discrepancy=2e-10)), 1),
    (case(verdict=verdict(uncertainty=2e-10)), 1),
    (case(verdict=verdict(order=1.4)), 1),
    (case(verdict=verdict(order=None)), 1),
    (case(full_run=full_run(order=0.6)), 1),
    (case(full_run=full_run(order=None)), 1),
    (case(full_run=full_run(checked_step=None)), 1),
    (case(full_run=full_run(checked_step=TOO_LARGE)), 1),
    (case(full_run=full_run(energy_error=0.3)), 1),
    (case(full_run=full_run(constraint_drift=0.1)), 1),
    (case(system="drum_pendulum", model="mujoco_rolling.xml"), 1),
])  # fmt: skip
def test_builtin_models_have_stricter_demands(
    pytestconfig: pytest.Config, fault: Case, count: int
) -> None:
    (demands,) = pytestconfig.hook.pytest_crosscheck_case(record=fault)
    assert len(demands) == count
