"""What accelerations add to a verdict on motions."""

from __future__ import annotations

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
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.render.terminal.table import dynamics_lines
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


def told(off: float, *, complete: bool = True) -> AccelerationComparison:
    """Accelerations of two coordinates at three states, one of which is off."""
    defect = np.zeros((3, 2))
    defect[1, 1] = off
    return AccelerationComparison(
        judgement=judge(defect, np.full((3, 2), 1e-14), 1e-9, None),
        states=3,
        complete=complete,
        force_errors=dict.fromkeys(FORCE_KINDS, 0.0) | {"mass matrix": off},
    )


def both(motion: CaseJudgement, dynamics: AccelerationComparison | None) -> CaseJudgement:
    return with_dynamics(motion, dynamics, ("x", "phi"), 1e-9)


def test_a_stiff_motion_is_decided_by_accelerations_at_every_state() -> None:
    found = both(MOTION, told(0.0))
    assert found.outcome is Outcome.AGREES
    assert found.largest_uncertainty == 1e-14
    assert found.reason == (
        "its accelerations, at 3 states, match the equations to 1.0e-14 of the largest; its"
        " motions: the limit of x is known to 3.0e-08 at best"
    )


@pytest.mark.parametrize(("motion", "dynamics"), [
    (MOTION, None), (MOTION, told(0.0, complete=False)), (UNKNOWN, told(0.0)),
    (AGREES, told(0.0)), (AGREES, told(1e-12)), (DIFFERS, told(0.0)), (DIFFERS, told(1.0)),
])  # fmt: skip
def test_what_they_can_not_decide_is_left_to_the_motions(
    motion: CaseJudgement, dynamics: AccelerationComparison | None
) -> None:
    """States of which nothing is told may hold what makes a motion rough; so may a step."""
    assert both(motion, dynamics) is motion


@pytest.mark.parametrize("motion", [MOTION, UNKNOWN, AGREES])
def test_accelerations_that_differ_differ(motion: CaseJudgement) -> None:
    found = both(motion, told(1e-6))
    assert found.outcome is Outcome.DIFFERS
    assert found.component == "phi_ddot"
    assert found.discrepancy == 1e-6
    assert found.reason.startswith(
        "phi_ddot is off by 1.0e-06 of its largest value; the uncertainty is 1.0e-14;"
        " these of its forces differ: mass matrix; "
    )
    other = "all segments agree within 1.0e-12" if motion is AGREES else motion.reason
    assert found.reason.endswith(other)


def test_a_servo_that_no_step_resolves_is_resolved_without_one(tmp_path: Path) -> None:
    file = tmp_path / "servo.xml"
    file.write_text(SERVO.format(20))
    case = run_case(model_task(prepare_tree(file), "mujoco"))
    assert case.outcome is Outcome.AGREES
    assert case.reason.startswith("its accelerations, at 200 states, match the equations to ")
    assert "its motions: the limit of stiff has an uncertainty of" in case.reason
    assert case.forward_dynamics is not None
    (line,) = dynamics_lines([case])
    assert line.startswith("accelerations of 1 case at 200 states agree to ")
