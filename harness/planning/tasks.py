"""Tasks of a run: one function for each kind of `planning.cache.KINDS`, called in a worker.

The kind is the function's name. Functions of a model take the prepared target, and `Arguments`.
"""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from physics_crosscheck.harness.baseline import measure as measuring
from physics_crosscheck.harness.checks.audit import audit_declared, audit_file, audit_terms
from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.linearizations import run_linearizations
from physics_crosscheck.harness.checks.prepare import (
    Prepared,
    PreparedSystem,
    PreparedTree,
    prepare,
)
from physics_crosscheck.harness.checks.task import ModelTask, model_task
from physics_crosscheck.harness.diagnosis.coverage import count_numbers, count_robot
from physics_crosscheck.harness.diagnosis.robot_task import diagnose_robot
from physics_crosscheck.harness.diagnosis.task import diagnose_model
from physics_crosscheck.harness.planning.prepared import Arguments, Preparation, TargetFacts
from physics_crosscheck.harness.records.baseline import Measurement
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.coverage import Coverage
from physics_crosscheck.harness.records.finding import Diagnosis
from physics_crosscheck.harness.records.model import EngineLinearization
from physics_crosscheck.harness.records.survey import Audit

Solved = PreparedSystem | PreparedTree


def target(
    place: Path,
    *,
    described: bool = False,
    floating: bool = False,
    model: str = "",
    motion: float = 0.0,
    smooth: bool = False,
) -> Preparation:
    """Read a system folder or a robot file, derive its equations, and solve them.

    Raises:
        DeclarationError, FileError, ReferenceError: naming the error and its place.
    """
    solved = prepare(
        place, described=described, floating=floating, model=model, motion=motion, smooth=smooth
    )
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
    return Preparation(facts, solved)


def case(solved: Solved, given: Arguments) -> Case:
    """Run one case, and judge it."""
    return run_case(_task(solved, given))


def measurement(solved: Solved, given: Arguments) -> Measurement:
    """Measure the model's states, for a baseline."""
    return measuring.measure(_task(solved, given), given.snapshot)


def diagnosis(solved: Solved, given: Arguments) -> Diagnosis:
    """Find the numbers that explain a discrepancy."""
    if isinstance(solved, PreparedSystem):
        return diagnose_model(_task(solved, given))
    return diagnose_robot(_task(solved, given), is_reference=given.sidecar is None)


def coverage(solved: Solved, given: Arguments) -> Coverage:
    """Count the numbers of the file that affect motions.

    This is separate from the audit, so that an engine that fails on a changed number does not lose
    the audit's findings.
    """
    if isinstance(solved, PreparedSystem):
        return count_numbers(_task(solved, given))
    return count_robot(_task(solved, given))


def linearizations(solved: Solved, given: Arguments) -> tuple[EngineLinearization, ...]:
    """Linearize the engine's model at every equilibrium."""
    return run_linearizations(_task(solved, given))


def audit(solved: Solved, given: Arguments) -> Audit:
    """Compare the compiled model with declared constants; of bodies, read the file alone."""
    if isinstance(solved, PreparedSystem):
        return audit_declared(_task(solved, given))
    assert given.sidecar is not None  # the findings of a robot file are among its facts
    return audit_file(given.sidecar)


def mechanics(solved: PreparedTree, given: Arguments) -> Audit:
    """Compare the terms that an engine compiled from a model of bodies with the equations."""
    return audit_terms(_task(solved, given))


_P = TypeVar("_P", bound=Prepared)


def _task(solved: _P, given: Arguments) -> ModelTask[_P]:
    return model_task(
        solved,
        given.engine,
        given.sidecar,
        scenario=given.scenario,
        resolution=given.resolution,
        thorough=given.thorough,
    )
