"""Functions that planning names and workers call."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from physics_crosscheck.harness.checks.prepare import PreparedSystem, PreparedTree, prepare
from physics_crosscheck.harness.checks.task import model_task
from .prepared import Arguments, PackedEquations, Preparation, TargetFacts


def target(
    place: Path,
    *,
    described: bool = False,
    floating: bool | None = None,
    model: str = "",
    motion: float = 0.0,
    smooth: bool = False,
    ideal: bool = False,
    no_motion: str = "",
) -> Preparation:
    """Read a system folder or a robot file, derive its equations, and solve them.

    With `no_motion`, the motion from rest is left out for this reason.

    Raises:
        DeclarationError, FileError, ReferenceError: naming the error and its place.
    """
    solved = prepare(
        place,
        described=described,
        floating=floating,
        model=model,
        motion=0.0 if no_motion else motion,
        smooth=smooth,
        ideal=ideal,
    )
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
    return Preparation(facts, PackedEquations.pack(solved))


def _without_motion(
    solved: PreparedSystem | PreparedTree, why: str
) -> PreparedSystem | PreparedTree:
    return replace(solved, rest=why) if why and isinstance(solved, PreparedTree) else solved


def check(equations: PackedEquations, *, path: str, given: Arguments) -> Any:
    """Call the function of a check with the task of one model in one engine.

    Args:
        equations: the solved equations of the target.
        path: path of the function below `harness`.
        given: the model, the engine and the options.
    """
    task = model_task(
        _without_motion(equations.unpack(), given.no_motion),
        given.engine,
        given.sidecar,
        scenario=given.scenario,
        resolution=given.resolution,
        thorough=given.thorough,
        snapshot=given.snapshot,
    )
    return resolve_name(f"physics_crosscheck.harness.{path}")(task)
