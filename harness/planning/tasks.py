"""Tasks of a run: one function for each kind of `planning.cache.KINDS`, called in a worker.

The kind is the function's name. Functions of a model take the prepared folder or file, and a
`ModelTask`.
"""

from __future__ import annotations

from pathlib import Path

from physics_crosscheck.harness.baseline import measure as measure_motion
from physics_crosscheck.harness.baseline.measure_tree import MeasureTreeTask, measure_tree
from physics_crosscheck.harness.checks.audit import run_audit
from physics_crosscheck.harness.checks.audit_task import AuditTask, audit_task
from physics_crosscheck.harness.checks.case import (
    CaseTask,
    case_task,
    linearization_task,
    run_case,
    run_linearizations,
)
from physics_crosscheck.harness.checks.multibody import PreparedTree, prepare_folder, survey_file
from physics_crosscheck.harness.checks.prepare import Prepared
from physics_crosscheck.harness.checks.robot_case import (
    PreparedRobot,
    prepare_robot,
    run_robot,
)
from physics_crosscheck.harness.checks.robot_task import RobotTask
from physics_crosscheck.harness.diagnosis.coverage import count_numbers
from physics_crosscheck.harness.diagnosis.robot_coverage import count_robot
from physics_crosscheck.harness.diagnosis.robot_task import RobotDiagnosisTask, diagnose_robot
from physics_crosscheck.harness.diagnosis.task import diagnose_model, diagnosis_task
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.planning.prepared import (
    FolderFacts,
    ModelTask,
    Preparation,
    RobotFacts,
)
from physics_crosscheck.harness.records.baseline import Measurement
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.coverage import Coverage
from physics_crosscheck.harness.records.finding import Diagnosis
from physics_crosscheck.harness.records.model import EngineLinearization
from physics_crosscheck.harness.records.survey import Audit, FileSurvey

Solved = Prepared | PreparedTree | PreparedRobot


def folder(place: Path, *, described: bool, motion: float = 0.0) -> Preparation:
    """Derive and solve the equations of a system folder.

    Raises:
        DeclarationError, ReferenceError: naming the error and its place.
    """
    solved = prepare_folder(place, described=described, motion=motion)
    facts = FolderFacts(
        record=solved.record,
        bodies=isinstance(solved, PreparedTree),
        reads=dict(solved.reads),
    )
    return Preparation(facts, solved)


def robot(place: Path, *, floating: bool, model: str, motion: float = 0.0) -> Preparation:
    """Read a robot file, and solve its equations.

    Raises:
        FileError, ReferenceError: naming the error and its place.
    """
    solved = prepare_robot(place, floating=floating, model=model, motion=motion)
    facts = RobotFacts(record=solved.record, left_out=solved.left_out, findings=solved.findings)
    return Preparation(facts, solved)


def case(solved: Solved, task: ModelTask) -> Case:
    """Run one case, and judge it."""
    if isinstance(solved, Prepared):
        return run_case(_case_task(solved, task))
    return run_robot(_robot_task(solved, task))


def measurement(solved: Solved, task: ModelTask) -> Measurement:
    """Measure the model's states, for a baseline."""
    if isinstance(solved, Prepared):
        measuring = measure_motion.measure_task(_case_task(solved, task), solved, task.snapshot)
        return measure_motion.measure(measuring)
    measured = MeasureTreeTask(
        task=_robot_task(solved, task),
        system=solved.system if isinstance(solved, PreparedRobot) else solved.system.tree_system,
        accepted=task.snapshot,
        reads={} if isinstance(solved, PreparedRobot) else solved.reads,
    )
    return measure_tree(measured)


def diagnosis(solved: Solved, task: ModelTask) -> Diagnosis:
    """Find the numbers that explain a discrepancy."""
    if isinstance(solved, Prepared):
        return diagnose_model(diagnosis_task(solved, _sidecar(task), task.engine))
    is_standalone = isinstance(solved, PreparedRobot)
    return diagnose_robot(
        RobotDiagnosisTask(task=_robot_task(solved, task), is_reference=is_standalone)
    )


def coverage(solved: Solved, task: ModelTask) -> Coverage:
    """Count the numbers of the file that affect motions.

    This is separate from the audit, so that an engine that fails on a changed number does not lose
    the audit's findings.
    """
    if isinstance(solved, Prepared):
        return count_numbers(_audit_task(solved, task))
    return count_robot(_robot_task(solved, task))


def linearizations(solved: Prepared, task: ModelTask) -> tuple[EngineLinearization, ...]:
    """Linearize the engine's model at every equilibrium."""
    return run_linearizations(
        linearization_task(solved, _sidecar(task), task.engine, task.resolution)
    )


def audit(solved: Prepared, task: ModelTask) -> Audit:
    """Compare the compiled model with the declared constants."""
    return run_audit(_audit_task(solved, task))


def survey(solved: PreparedTree, task: ModelTask) -> FileSurvey:
    """Read the model file without its declaration, and list non-physical inertias."""
    return survey_file(_sidecar(task))


def _sidecar(task: ModelTask) -> Sidecar:
    assert task.sidecar is not None  # models of a folder have a sidecar
    return task.sidecar


def _case_task(solved: Prepared, task: ModelTask) -> CaseTask:
    return case_task(solved, _sidecar(task), task.engine, task.scenario, task.resolution)


def _audit_task(solved: Prepared, task: ModelTask) -> AuditTask:
    return audit_task(solved, _sidecar(task), task.engine, task.resolution)


def _robot_task(solved: PreparedTree | PreparedRobot, task: ModelTask) -> RobotTask:
    if isinstance(solved, PreparedTree):
        return solved.task(_sidecar(task), task.engine, task.resolution)
    return solved.task(task.engine, task.resolution)
