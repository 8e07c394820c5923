"""Whole steps of Drake's discrete plants: joint limits by the law of SAP, and planted faults."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.harness.checks.findings import STANDALONE_SETTINGS
from physics_crosscheck.harness.checks.law_comparison import LawComparison
from physics_crosscheck.harness.checks.law_engine import LawEngine
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.checks.whole_step import WholeStepCheck, check_whole_step
from physics_crosscheck.harness.diagnosis.law_problem import (
    LawProblem,
    diagnose_laws,
    law_problem,
)
from physics_crosscheck.harness.engines.protocol import ModelSpec
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.engines.urdf import SETTINGS
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.reference.laws.near_rigid import NearRigidModel, near_rigid_softness
from physics_crosscheck.reference.laws.step import LawModel, LawSolution
from tests.engines.extras import need
from tests.laws.scenes import URDF_ARM

FAULTS = {
    "upper limit": ('upper=".7"', 'upper=".7000007"'),
    "lower limit": ('lower="-1"', 'lower="-1.000001"'),
    "lost limit": ('lower="-1" upper=".7"', 'lower="-9" upper="9"'),
    "limit of a continuous joint": ('upper=".4"', 'upper=".4000004"'),
    "damping": ('damping=".2"', 'damping=".2000002"'),
}


def checked(tmp_path: Path, loaded: str = URDF_ARM) -> WholeStepCheck:
    """Compare the law of an arm with Drake on another text."""
    need("drake")
    file, copy = tmp_path / "arm.urdf", tmp_path / "copy.urdf"
    file.write_text(URDF_ARM)
    copy.write_text(loaded)
    settings = {**SETTINGS, **STANDALONE_SETTINGS, "floating": False}
    check = check_whole_step(file, ModelSpec(copy, settings=settings), "drake", 1e-9)
    assert check is not None
    return check


def test_joint_limits_follow_the_law_of_sap(tmp_path: Path) -> None:
    """Catch a wrong regularization, dissipation or damper."""
    check = checked(tmp_path)
    assert check.judgement is not None
    assert check.record.outcome is Outcome.AGREES
    assert check.judgement.largest_discrepancy < 1e-12
    assert check.record.next_state
    assert check.record.uncovered == ("contacts",)
    assert {term.name for term in check.record.acted} == {"limits"}


@pytest.mark.parametrize("fault", FAULTS)
def test_planted_faults_of_limits_are_detected(tmp_path: Path, fault: str) -> None:
    """Catch a number of a limit that whole steps do not depend on."""
    right, wrong = FAULTS[fault]
    assert URDF_ARM.count(right) == 1
    check = checked(tmp_path, URDF_ARM.replace(right, wrong))
    assert check.record.outcome is Outcome.DIFFERS


@pytest.mark.parametrize(
    ("smooth", "words"),
    [(False, "elbow is continuous, but Drake applies its limits: [-0.4, 0.4]"),
     (True, "the limits [-0.4, 0.4] of elbow have no effect: it is continuous")],
)  # fmt: skip
def test_limits_of_a_continuous_joint_are_stated(tmp_path: Path, smooth: bool, words: str) -> None:
    """Catch a remark that Drake ignores limits which stop its joint, or the reverse."""
    need("drake")
    file = tmp_path / "arm.urdf"
    file.write_text(URDF_ARM)
    settings = {**SETTINGS, "floating": False, "step": 0.002, "smooth": smooth}
    model = engines()["drake"].load(ModelSpec(file, settings=settings))
    start = np.zeros((1, len(model.coordinates)))
    assert words in [one.message for one in model.remarks(start, start)]
    bounds = model.limits[model.coordinates.index("elbow")].tolist()
    assert bounds == ([-np.inf, np.inf] if smooth else [-0.4, 0.4])


def problem_of(tmp_path: Path) -> LawProblem[LawModel, LawSolution]:
    """Return whole steps of the arm in Drake, with its law."""
    need("drake")
    file = tmp_path / "arm.urdf"
    file.write_text(URDF_ARM)
    task = model_task(prepare_tree(file, states=2), "drake")
    problem = law_problem(task.with_settings(**SETTINGS, **STANDALONE_SETTINGS))
    assert problem is not None
    assert isinstance(problem.comparison, LawComparison)
    return problem


@pytest.mark.parametrize(
    ("name", "value"), [("share", 0.01), ("dissipation", 0.003), ("stiffness", 1e4)]
)
def test_other_rules_of_limits_are_detected(tmp_path: Path, name: str, value: float) -> None:
    """Catch a setting of SAP that the law does not depend on."""
    problem = problem_of(tmp_path)
    laws = problem.comparison.laws
    assert isinstance(laws, NearRigidModel)
    rules = replace(laws.rules, **{name: value})
    softness = near_rigid_softness(rules)
    limits = tuple(replace(limit, softness=softness) for limit in laws.laws.limits)
    other = replace(laws, rules=rules, laws=replace(laws.laws, limits=limits))
    assert problem.of_model(problem.comparison.model).judge(1e-9).outcome is Outcome.AGREES
    engine = LawEngine(problem.comparison.under(other))
    assert problem.of_model(engine).judge(1e-9).outcome is Outcome.DIFFERS


def test_wrong_limit_is_named_with_its_line(tmp_path: Path) -> None:
    """Catch a diagnosis that does not try the numbers of near-rigid limits."""
    problem = problem_of(tmp_path)
    wrong = tmp_path / "wrong.urdf"
    wrong.write_text(URDF_ARM.replace('upper=".7"', 'upper=".7000007"'))
    ranking = diagnose_laws(problem.in_engine(replace(problem.spec, path=wrong)))
    assert ranking.explained
    (cause,) = ranking.fits[0].causes
    assert "limit@upper" in str(cause)


def test_lost_limit_is_named(tmp_path: Path) -> None:
    """Catch a diagnosis without the mistakes of near-rigid limits."""
    problem = problem_of(tmp_path)
    name = "the limit of joint shoulder is ignored"
    ranking = diagnose_laws(problem.mistaken(name))
    assert ranking.explained
    assert name in [cause.subject[0] for fit in ranking.fits[:1] for cause in fit.causes]
