"""Functions that planning names and workers call."""

import pickle
from dataclasses import replace
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from physics_crosscheck.harness.checks.prepare import PreparedSystem, PreparedTree, prepare
from physics_crosscheck.harness.checks.task import model_task
from .prepared import Preparation, TargetFacts, unpacked


def target(place: Path, *, no_motion: str = "", **reading: Any) -> Preparation:
    """Read a system folder or a robot file, derive its equations, and solve them.

    Args:
        place: the folder or the file.
        no_motion: why the motion from rest is left out; empty if it is not.
        reading: options of `prepare`; without one, nothing is described.

    Raises:
        DeclarationError, FileError, ReferenceError: naming the error and its place.
    """
    still = {"motion": 0.0} if no_motion else {}
    solved = prepare(place, **{"described": False, **reading, **still})
    solved = _without_motion(solved, no_motion)
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
    return Preparation(facts, pickle.dumps(solved, protocol=pickle.HIGHEST_PROTOCOL))


def _without_motion(
    solved: PreparedSystem | PreparedTree, why: str
) -> PreparedSystem | PreparedTree:
    return replace(solved, rest=why) if why and isinstance(solved, PreparedTree) else solved


def check(equations: bytes, *, path: str, no_motion: str = "", **given: Any) -> Any:
    """Call the function of a check with the task of one model in one engine.

    Args:
        equations: the solved equations of the target.
        path: path of the function below `harness`.
        no_motion: as in `target`.
        given: the model, the engine and the options, as for `model_task`.
    """
    task = model_task(_without_motion(unpacked(equations), no_motion), **given)
    return resolve_name(f"physics_crosscheck.harness.{path}")(task)
