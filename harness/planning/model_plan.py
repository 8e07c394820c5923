"""Plan of a model file in an engine: its record, and the jobs that all kinds of folders share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from physics_crosscheck.harness.checks.not_run import barred_case, hurdle
from physics_crosscheck.harness.engines.protocol import Engine
from physics_crosscheck.harness.jobs.graph import Job
from physics_crosscheck.harness.jobs.workers import Failure
from physics_crosscheck.harness.modelfiles.reading import read_regular
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.planning.folder_plan import FolderWork
from physics_crosscheck.harness.planning.result_builder import Jobs
from physics_crosscheck.harness.planning.target_plan import Done, Failed
from physics_crosscheck.harness.records.case import CaseId
from physics_crosscheck.harness.records.finding import Diagnosis
from physics_crosscheck.harness.records.model import Model


class ModelPlan(ABC):
    """The jobs of a model in an engine.

    Args:
        folder_plan: plan of its folder.
        adapters: all engines.
        sidecar: the model.
        engine: name of the engine.
        cases: cases to run.
    """

    def __init__(
        self,
        folder_plan: FolderWork,
        adapters: Mapping[str, Engine],
        sidecar: Sidecar,
        engine: str,
        cases: Sequence[CaseId],
    ) -> None:
        self.work, self.sidecar, self.engine, self.cases = folder_plan, sidecar, engine, cases
        self.folder, self.options = str(folder_plan.place), folder_plan.options
        self.key = self.folder, sidecar.model.name, engine
        self._engines = adapters

    def jobs(self) -> Iterator[Job[Any]]:
        """Yield all jobs; report a model that cannot run at once."""
        if why := hurdle(self._engines, self.engine, self.sidecar):
            for case in self.cases:
                self.work.found.add(barred_case(case, self.folder, why))
            return
        yield from self._jobs()

    def audit(self) -> Iterator[Job[Any]]:
        """Yield only the audit."""
        self.begin()
        yield from self._audit()

    @abstractmethod
    def _jobs(self) -> Iterator[Job[Any]]:
        """Yield the jobs of a model that can run."""

    @abstractmethod
    def _audit(self) -> Iterator[Job[Any]]:
        """Yield the jobs that read the file without a motion."""

    def begin(self) -> None:
        """Add the model to the results with the texts of its file and its sidecar, without
        findings.
        """
        file = self.sidecar.model
        self.work.found.models[self.key] = Model(
            system=self.work.facts.record.name,
            model=file.name,
            engine=self.engine,
            folder=self.folder,
            text=text_of(file),
            sidecar=text_of(file.with_name(f"{file.name}.toml")),
        )

    def _do(
        self, kind: str, done: Done, failed: Failed, *, scenario: str = ""
    ) -> Iterator[Job[Any]]:
        """Yield the job of one kind of task, unless its value is cached."""
        return self.work.do(kind, self.key, done, failed, sidecar=self.sidecar, scenario=scenario)

    def diagnosed(self, value: Diagnosis) -> Jobs:
        """Add a diagnosis to the model's record."""
        self.work.found.amend(self.key, diagnosis=value)
        return ()

    def undiagnosed(self, failure: Failure) -> Jobs:
        """Add the reason for a missing diagnosis to the model's record."""
        return self.diagnosed(Diagnosis(failure=failure.reason))


def text_of(path: Path) -> str:
    """Return a file's text; empty if the file is gone, which its cases report."""
    try:
        return read_regular(path).decode("utf-8", errors="replace")
    except OSError:
        return ""
