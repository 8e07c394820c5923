"""Plan of a model file in an engine: its record, and its jobs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from msgspec import structs

from physics_crosscheck.harness.checks.not_run import failed_case
from physics_crosscheck.harness.documents.reading import read_regular
from physics_crosscheck.harness.jobs.graph import Job
from physics_crosscheck.harness.jobs.workers import Failure
from physics_crosscheck.harness.modelfiles.model_files import model_path
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.planning.result_builder import Jobs
from physics_crosscheck.harness.planning.target_plan import Done, Failed, TargetPlan
from physics_crosscheck.harness.records.case import Case, CaseId, ModelKey
from physics_crosscheck.harness.records.coverage import Coverage
from physics_crosscheck.harness.records.finding import AuditFinding, Diagnosis
from physics_crosscheck.harness.records.journal import TaskKind
from physics_crosscheck.harness.records.model import EngineLinearization, Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.survey import Audit

NO_MOTION = ("pose",)
"""Kinds of differences that no number of a motion or of a step explains."""


class ModelPlan:
    """The jobs of a model in an engine: cases, measurements, coverage, audit and diagnosis.

    Args:
        target: plan of its folder, or of the file.
        file: the sidecar of a folder's model, or the robot file.
        engine: name of the engine.
        cases: cases to run.
    """

    def __init__(
        self, target: TargetPlan, file: Sidecar | Path, engine: str, cases: Sequence[CaseId]
    ) -> None:
        self._target, self._results, self._options = target, target.results, target.options
        self._sidecar = file if isinstance(file, Sidecar) else None
        self._file, self._cases = model_path(file), cases
        self._folder, self._left = str(target.place), len(cases)
        self.key: ModelKey = self._folder, self._file.name, engine

    def begin(self) -> None:
        """Add the model to the results with the texts of its file and its sidecar."""
        facts, alone = self._target.facts, self._sidecar is None
        self._results.models[self.key] = Model(
            system=facts.record.name,
            model=self._file.name,
            engine=self.key[-1],
            folder=self._folder,
            text=text_of(self._file),
            sidecar="" if alone else text_of(self._file.with_name(f"{self._file.name}.toml")),
            audit=facts.findings if alone else None,
            coverage=Coverage(left_out=facts.left_out) if alone else None,
        )

    def jobs(self, coverage_of: Sequence[ModelKey]) -> Iterator[Job[Any]]:
        """Yield all jobs of a model that has begun.

        Args:
            coverage_of: models whose numbers are counted with this one's; may be empty.
        """
        for case in self._cases:
            yield from self._case(case)
            if self._sidecar is not None:
                yield from self._target.measure(case, self._sidecar)
        energies = self._target.facts.declares == "energies"
        if self._options.described and (energies or self._options.motion):
            yield from self._linearizations()
        if coverage_of and self._options.selection is None:
            yield from self._coverage(coverage_of)
        yield from self.audit()

    def _case(self, case: CaseId) -> Iterator[Job[Any]]:

        def done(value: Case) -> Iterator[Job[Any]]:
            # A robot file that the engine refuses has nothing to measure.
            if self._sidecar is None and value.outcome is not Outcome.REFUSED:
                yield from self._target.measure(case, None)
            yield from self._ended(value)

        def failed(failure: Failure) -> Jobs:
            return self._ended(failed_case(case, self._folder, failure))

        return self._do("case", done, failed, scenario=case.scenario)

    def _ended(self, case: Case) -> Iterator[Job[Any]]:
        """Add a case; after the last one, diagnose the model if any of them differs."""
        self._results.add(case)
        self._compare_more(case)
        self._left -= 1
        mine = [c for c in self._results.cases if c.key == self.key]
        # Motions show no number that only poses depend on.
        differs = any(c.outcome is Outcome.DIFFERS and c.kind not in NO_MOTION for c in mine)
        if self._left or not self._options.diagnosed or not differs:
            return

        def done(value: Diagnosis) -> Jobs:
            self._results.amend(self.key, diagnosis=value)
            return ()

        def failed(failure: Failure) -> Jobs:
            return done(Diagnosis(failure=failure.reason))

        yield from self._do("diagnosis", done, failed)

    def _compare_more(self, case: Case) -> None:
        """Remove from what is left out the parts of the file that whole steps compare."""
        steps, coverage = case.whole_step, self._results.models[self.key].coverage
        if steps is not None and steps.outcome is not None and coverage is not None:
            left_out = tuple(one for one in coverage.left_out if one not in steps.covered)
            self._results.amend(self.key, coverage=structs.replace(coverage, left_out=left_out))

    def _linearizations(self) -> Iterator[Job[Any]]:
        def done(value: tuple[EngineLinearization, ...]) -> Jobs:
            self._results.amend(self.key, linearizations=value)
            return ()

        def failed(failure: Failure) -> Jobs:
            self._results.amend(self.key, linearization_failure=failure.reason)
            return ()

        return self._do("linearizations", done, failed)

    def audit(self) -> Iterator[Job[Any]]:
        """Audit the file without a motion; a robot file already was when it was read."""
        if self._sidecar is None:
            return

        def done(value: Audit) -> Jobs:
            known = self._results.models[self.key].audit or ()
            self._results.amend(self.key, audit=(*known, *value.findings))
            if value.poses is not None:
                self._results.amend(self.key, poses=value.poses)
            if self._target.facts.declares == "bodies":
                counted = self._results.models[self.key].coverage or Coverage()
                coverage = structs.replace(counted, left_out=value.left_out)
                self._results.amend(self.key, coverage=coverage)
            return ()

        def failed(failure: Failure) -> Jobs:
            self._results.amend(self.key, audit_failure=failure.reason)
            return ()

        yield from self._do("audit", done, failed)

    def mechanics(self) -> Iterator[Job[Any]]:
        """Compare the compiled terms of a model of bodies; accelerations show the same in a run."""

        def done(value: Audit) -> Jobs:
            known = self._results.models[self.key].audit or ()
            self._results.amend(self.key, audit=(*known, *value.findings))
            return ()

        def failed(failure: Failure) -> Jobs:
            if self._sidecar is not None:
                self._results.amend(self.key, audit_failure=failure.reason)
                return ()
            # What reading a robot file finds stands, also where an engine refuses the file.
            note = AuditFinding(
                kind="unresolved",
                subject=("engine",),
                message=f"its compiled terms are not compared: {failure.about(self._file)}",
                location=None,
                expected=None,
                found=None,
                severity="note",
            )
            return done(Audit(findings=(note,)))

        return self._do("mechanics", done, failed)

    def _coverage(self, models: Sequence[ModelKey]) -> Iterator[Job[Any]]:
        """Count the numbers of the file; what is left out is known from reading it."""

        def done(value: Coverage) -> Jobs:
            for key in models:
                counted = self._results.models[key].coverage or Coverage()
                coverage = structs.replace(value, left_out=counted.left_out)
                self._results.amend(key, coverage=coverage)
            return ()

        def failed(failure: Failure) -> Jobs:
            return done(Coverage(note=failure.reason))

        return self._do("coverage", done, failed)

    def _do(
        self, kind: TaskKind, done: Done, failed: Failed, *, scenario: str = ""
    ) -> Iterator[Job[Any]]:
        """Yield the job of one kind of task, unless its value is cached."""
        return self._target.do(
            kind, self.key, done, failed, sidecar=self._sidecar, scenario=scenario
        )


def text_of(path: Path) -> str:
    """Return a file's text; empty if the file is gone, which its cases report."""
    try:
        return read_regular(path).decode("utf-8", errors="replace")
    except OSError:
        return ""
