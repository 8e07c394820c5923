"""Plan of a model file in an engine: its record, and its jobs."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Literal

from msgspec.structs import replace

from physics_crosscheck.harness.checks.not_run import failed_case
from physics_crosscheck.harness.documents.reading import read_regular
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.jobs.graph import Job
from physics_crosscheck.harness.modelfiles.model_files import model_path
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.records.case import Case, CaseId, ModelKey
from physics_crosscheck.harness.records.coverage import Coverage
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from .model_checks import CASE, CHECKS, COVERAGE, DIAGNOSIS, ModelCheck, faults_here
from .result_builder import Jobs
from .target_plan import TargetPlan

NO_MOTION = ("pose", "compiled number", "contact")
"""Kinds of differences that no number of a motion or of a step explains."""


class ModelPlan:
    """The jobs of a model in an engine: its cases with their measurements, and its checks.

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
        self._folder, self._remaining = str(target.place), len(cases)
        self.key: ModelKey = self._folder, self._file.name, engine

    def begin(self) -> None:
        """Add the model to the results with the texts of its file and its sidecar."""
        facts, standalone = self._target.facts, self._sidecar is None
        model = Model(
            system=facts.record.name,
            model=self._file.name,
            engine=self.key[-1],
            folder=self._folder,
            text=text_of(self._file),
            sidecar="" if standalone else text_of(self._file.with_name(f"{self._file.name}.toml")),
            audit=faults_here(facts.findings, self.key[-1]) if standalone else None,
            coverage=Coverage(left_out=facts.left_out) if standalone else None,
        )
        self._results.begin(model)

    def jobs(self, coverage_of: Sequence[ModelKey]) -> Iterator[Job[Any]]:
        """Yield all jobs of a model that has begun.

        Args:
            coverage_of: models whose numbers are counted with this one's; may be empty.
        """
        for case in self._cases:
            yield from self._case(case)
            if self._sidecar is not None:
                yield from self._target.measure(case, self._sidecar)
        yield from self.checks("run", coverage_of)

    def checks(
        self, plan: Literal["run", "audit"], coverage_of: Sequence[ModelKey] = ()
    ) -> Iterator[Job[Any]]:
        """Yield the jobs of the checks that a command runs once for each model."""
        for check in CHECKS:
            models = coverage_of if check is COVERAGE else (self.key,)
            wanted = check.wanted(self._target.facts, self._options)
            if plan in check.plans and wanted and models:
                yield from self._do(check, models)

    def _case(self, case: CaseId) -> Iterator[Job[Any]]:
        """Yield the job of a case, which is measured for the baseline too."""

        def done(value: Case) -> Iterator[Job[Any]]:
            # A robot file that the engine refuses has nothing to measure.
            if self._sidecar is None and value.outcome is not Outcome.REFUSED:
                yield from self._target.measure(case, None)
            yield from self._ended(value)

        def failed(failure: Failure) -> Jobs:
            return self._ended(failed_case(case, self._folder, failure))

        return self._target.do(
            CASE, self.key, done, failed, sidecar=self._sidecar, scenario=case.scenario
        )

    def _ended(self, case: Case) -> Iterator[Job[Any]]:
        """Add a case; after the last one, diagnose the model if any of them differs."""
        if self._options.strict:
            case = replace(case, accepted="")
        self._results.add(case)
        self._results.enter(self.key, CASE, case)
        self._remaining -= 1
        mine = [c for c in self._results.cases if c.key == self.key]
        # Motions show no number that only poses depend on, and a misread one has its line already.
        amiss = (c for c in mine if c.outcome is Outcome.DIFFERS and not c.accepted)
        differs = any(c.kind not in NO_MOTION for c in amiss)
        if differs and self._options.diagnosed and not self._remaining:
            yield from self._do(DIAGNOSIS, (self.key,))

    def _do(self, check: ModelCheck, models: Sequence[ModelKey]) -> Iterator[Job[Any]]:
        """Yield the job of a check, whose value enters the records of these models."""

        def enter(value: Any) -> Jobs:
            for key in models:
                self._results.enter(key, check, value)
            return ()

        return self._target.do(check, self.key, enter, enter, sidecar=self._sidecar)


def text_of(path: Path) -> str:
    """Return a file's text; empty if the file is gone, which its cases report."""
    try:
        return read_regular(path).decode("utf-8", errors="replace")
    except OSError:
        return ""
