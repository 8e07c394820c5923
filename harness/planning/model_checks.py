"""The checks of a model in an engine, each with a line in `CHECKS`.

A worker calls the function of a check with a `ModelTask`. Functions are named by their paths, so
that planning imports no equations.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from msgspec.structs import replace

from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.records.baseline import Measurement
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.coverage import Coverage
from physics_crosscheck.harness.records.finding import AuditFinding, Diagnosis
from physics_crosscheck.harness.records.model import EngineLinearization, Model
from physics_crosscheck.harness.records.survey import Audit
from .options import Options
from .prepared import TargetFacts, task_function


def faults_here(findings: Sequence[AuditFinding], engine: str) -> tuple[AuditFinding, ...]:
    """Return findings; advice about what an installed engine does not follow is a fault there."""
    adapter = engines().get(engine)
    kinds = adapter.unfollowed if adapter and adapter.version() is not None else ()
    return tuple(replace(one, severity="finding") if one.kind in kinds else one for one in findings)


def add_audit(model: Model, value: Audit) -> Model:
    """Add findings, and poses and omissions if the audit has any."""
    coverage = model.coverage
    if value.left_out:
        coverage = replace(coverage or Coverage(), left_out=value.left_out)
    audit = (*(model.audit or ()), *faults_here(value.findings, model.engine))
    return replace(
        model,
        audit=audit,
        acting=value.acting or model.acting,
        poses=value.poses or model.poses,
        coverage=coverage,
    )


def fail_audit(model: Model, failure: Failure) -> Model:
    """Add the reason of a failed audit."""
    return replace(model, audit_failure=failure.reason)


@dataclass(frozen=True, kw_only=True)
class ModelCheck:
    """A check of a model in an engine, or a step that depends on the results of others.

    Attributes:
        kind: its name among stored results.
        function: path below `harness` of the function that takes a `ModelTask`.
        of_bodies: the function for equations of bodies; the same one if empty.
        result: type of its value.
        plans: commands that run it once for each model; a step that others start has none.
        wanted: whether a target and a run's options need it.
        add: adds its value to the record of a model.
        fail: adds the reason of its failure.
    """

    kind: str
    function: str
    of_bodies: str = ""
    result: Any = Audit
    plans: tuple[Literal["run", "audit"], ...] = ("run", "audit")
    wanted: Callable[[TargetFacts, Options], bool] = lambda facts, options: True
    add: Callable[[Model, Any], Model] = add_audit
    fail: Callable[[Model, Failure], Model] = fail_audit

    def task(self, facts: TargetFacts, **given: Any) -> Callable[[Any], Any]:
        """Return the function of a worker, which takes a prepared target.

        `given` are arguments of `checks.task.model_task`.
        """
        path = self.function if facts.declares == "energies" else self.of_bodies or self.function
        return task_function("check", path=path, **given)

    def enter(self, model: Model, value: Any) -> Model:
        """Add a value, or the reason of a failure, to the record of a model."""
        return self.fail(model, value) if isinstance(value, Failure) else self.add(model, value)


def _add_case(model: Model, case: Case) -> Model:
    """Add an unstable step, and remove from what is left out what whole steps compare."""
    unstable = None if case.time_step is None else case.time_step.finding
    if unstable is not None and unstable not in (model.audit or ()):
        model = replace(model, audit=(*(model.audit or ()), unstable))
    steps, coverage = case.whole_step, model.coverage
    if steps is None or steps.outcome is None or coverage is None:
        return model
    kept = (one for one in coverage.left_out if one not in steps.covered)
    left_out = tuple(dict.fromkeys((*kept, *steps.inactive)))
    return replace(model, coverage=replace(coverage, left_out=left_out))


def _add_coverage(model: Model, value: Coverage) -> Model:
    """Add counts of numbers; what is left out is known from reading the file."""
    left_out = () if model.coverage is None else model.coverage.left_out
    return replace(model, coverage=replace(value, left_out=left_out))


def _note_terms(model: Model, failure: Failure) -> Model:
    """Add a note to a robot file, since what reading finds stands also if an engine refuses it."""
    if Path(model.folder).name != model.model:  # a model of a folder
        return fail_audit(model, failure)
    note = AuditFinding(
        kind="unresolved",
        subject=("engine",),
        message=f"its compiled terms are not compared: {failure.about(Path(model.folder))}",
        location=None,
        expected=None,
        actual=None,
        severity="note",
    )
    return add_audit(model, Audit(findings=(note,)))


CASE = ModelCheck(
    kind="case", function="checks.case.run_case", result=Case, plans=(), add=_add_case
)
MEASUREMENT = ModelCheck(
    kind="measurement", function="baseline.measure.measure", result=Measurement, plans=()
)
DIAGNOSIS = ModelCheck(
    kind="diagnosis",
    function="diagnosis.task.diagnose_model",
    of_bodies="diagnosis.robot_task.diagnose_bodies",
    result=Diagnosis,
    plans=(),
    add=lambda model, value: replace(model, diagnosis=value),
    fail=lambda model, failure: replace(model, diagnosis=Diagnosis(failure=failure.reason)),
)
COVERAGE = ModelCheck(
    kind="coverage",
    function="diagnosis.coverage.count_numbers",
    of_bodies="diagnosis.coverage.count_robot",
    result=Coverage,
    plans=("run",),
    wanted=lambda facts, options: options.selection is None,
    add=_add_coverage,
    fail=lambda model, failure: _add_coverage(model, Coverage(note=failure.reason)),
)
AUDIT = ModelCheck(
    kind="audit",
    function="checks.audit.audit_declared",
    of_bodies="checks.audit.audit_file",
    # A robot file is audited when it is read.
    wanted=lambda facts, options: facts.declares != "robot file",
)

CHECKS = (
    CASE,
    MEASUREMENT,
    ModelCheck(
        kind="linearizations",
        function="checks.compiled_terms.run_linearizations",
        result=tuple[EngineLinearization, ...],
        plans=("run",),
        wanted=lambda facts, options: (
            options.described and (facts.declares == "energies" or options.motion > 0)
        ),
        add=lambda model, value: replace(model, linearizations=value),
        fail=lambda model, failure: replace(model, linearization_failure=failure.reason),
    ),
    COVERAGE,
    AUDIT,
    ModelCheck(
        kind="mechanics",
        function="checks.audit.audit_terms",
        plans=("audit",),  # accelerations show the same in a run
        wanted=lambda facts, options: facts.declares != "energies",
        fail=_note_terms,
    ),
    ModelCheck(
        kind="acting",
        function="checks.audit.audit_acting",
        wanted=lambda facts, options: facts.declares == "robot file",
        fail=lambda model, failure: model,  # other checks report that the file cannot be read
    ),
    DIAGNOSIS,
)
"""Every check of a model, in the order in which its values enter the record."""

RESULTS: Mapping[str, Any] = {
    "target": TargetFacts,
    **{check.kind: check.result for check in CHECKS},
}
"""Type of each stored value, by its kind."""
