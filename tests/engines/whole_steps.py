"""Whole steps of URDFs in engines whose laws have settings of their own."""

from pathlib import Path

from physics_crosscheck.engine import ModelSpec
from physics_crosscheck.harness.checks.findings import STANDALONE_SETTINGS
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.checks.whole_step import WholeStepCheck, check_whole_step
from physics_crosscheck.harness.diagnosis.law_problem import LawProblem, law_problem
from physics_crosscheck.harness.engines.urdf import SETTINGS
from tests.engines.extras import need
from tests.laws.scenes import URDF_ARM


def checked(
    engine: str, tmp_path: Path, text: str = URDF_ARM, loaded: str = "", *, floating: bool = False
) -> WholeStepCheck:
    """Compare the law of a text with an engine on another one."""
    need(engine)
    file, copy = tmp_path / "robot.urdf", tmp_path / "copy.urdf"
    file.write_text(text)
    copy.write_text(loaded or text)
    settings = {**SETTINGS, **STANDALONE_SETTINGS, "floating": floating}
    check = check_whole_step(file, ModelSpec(copy, settings=settings), engine, 1e-9)
    assert check is not None
    return check


def problem_of(
    engine: str, tmp_path: Path, text: str = URDF_ARM, *, floating: bool = False
) -> LawProblem:
    """Return whole steps of a robot in an engine, with its law."""
    need(engine)
    file = tmp_path / "robot.urdf"
    file.write_text(text)
    task = model_task(prepare_tree(file, states=2, floating=floating), engine)
    problem = law_problem(task.with_settings(**SETTINGS, **STANDALONE_SETTINGS))
    assert problem is not None
    return problem
