"""Verdicts that combine accelerations with motions."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.checks.verdict import CaseJudgement, with_dynamics
from physics_crosscheck.harness.numerics.forward_dynamics import FORCE_KINDS, AccelerationComparison
from physics_crosscheck.harness.numerics.judgement import judge
from physics_crosscheck.harness.render.terminal.table import dynamics_lines
from physics_crosscheck.records import Outcome
from tests.cases.test_robot import SERVO

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
