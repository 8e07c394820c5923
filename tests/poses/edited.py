"""An edited file in an engine, and the equations of the original."""

from pathlib import Path

from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.records import Case


def case_of_edited(path: Path, text: str, old: str, new: str, engine: str) -> Case:
    """Write a file, replace a part that it has once, and compare it with the file as it was."""
    path.write_text(text)
    target = prepare_tree(path, states=4)
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))
    return run_case(model_task(target, engine))
