"""Functions that planning names and workers call."""

from __future__ import annotations

from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from physics_crosscheck.harness.checks.prepare import PreparedSystem, prepare
from physics_crosscheck.harness.checks.task import model_task
from .prepared import PackedEquations, Preparation, TargetFacts


def target(place: Path, **reading: Any) -> Preparation:
    """Read a system folder or a robot file, derive its equations, and solve them.

    Args:
        place: the folder or the file.
        reading: options of `prepare`; without one, nothing is described.

    Raises:
        DeclarationError, FileError, ReferenceError: naming the error and its place.
    """
    solved = prepare(place, **{"described": False, **reading})
    if isinstance(solved, PreparedSystem):
        facts = TargetFacts(record=solved.record, declares="energies", reads=dict(solved.reads))
    else:
        facts = TargetFacts(
            record=solved.record,
            declares="robot file" if place.is_file() else "bodies",
            reads=dict(solved.reads),
            left_out=solved.left_out,
            findings=solved.findings,
        )
    return Preparation(facts, PackedEquations.pack(solved))


def check(equations: PackedEquations, *, path: str, **given: Any) -> Any:
    """Call the function of a check with the task of one model in one engine.

    Args:
        equations: the solved equations of the target.
        path: path of the function below `harness`.
        given: the model, the engine and the options, as for `model_task`.
    """
    task = model_task(equations.unpack(), **given)
    return resolve_name(f"physics_crosscheck.harness.{path}")(task)
