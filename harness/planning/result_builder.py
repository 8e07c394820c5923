"""Combined results of a run's jobs, and their journal for resuming the run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.jobs.graph import Job
from physics_crosscheck.harness.jobs.stop import Stop
from physics_crosscheck.harness.planning.model_checks import CHECKS, RESULTS, ModelCheck
from physics_crosscheck.harness.records.baseline import Measurement
from physics_crosscheck.harness.records.case import Case, CaseId, ModelKey
from physics_crosscheck.harness.records.journal import CacheKey, Journal
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.system import SystemResult

Jobs = Iterable[Job[Any]]

Progress = Callable[[int, int, Case | None], None]
"""Called with (cases done, all cases or 0 while unknown, the case just done or None)."""


@dataclass(frozen=True)
class RunControl:
    """Control of a run: `stop` requests its end, `journal` stores results for resuming it."""

    stop: Stop | None = None
    journal: Journal | None = None


class ResultBuilder:
    """The results of a run's jobs so far, in the order of their completion.

    Attributes:
        systems: prepared systems.
        models: models that run.
        cases: cases that are done, or cannot run.
        measured: measurements, or the reasons for their absence, by folder and case.
        left: remaining cases by target.
        cached: number of cases from earlier runs.
        reads: states of the files that each target's code read, by name relative to it.
    """

    def __init__(self, progress: Progress, journal: Journal | None = None) -> None:
        self.systems: list[SystemResult] = []
        self.models: dict[ModelKey, Model] = {}
        self.cases: list[Case] = []
        self.measured: dict[tuple[str, CaseId], Measurement | Failure] = {}
        self.remaining: dict[tuple[str, CaseId], None] = {}
        self.cached = 0
        self.reads: dict[str, Mapping[str, str]] = {}
        self._progress, self._journal = progress, journal
        self._unknown: set[str] = set()
        self._first_models: dict[ModelKey, Model] = {}
        self._values: dict[ModelKey, dict[str, list[Any]]] = {}

    @property
    def keeps(self) -> bool:
        """True if results are stored for resuming the run."""
        return self._journal is not None

    def expect(self, folder: str, cases: Iterable[CaseId], *, complete: bool = True) -> None:
        """Expect these cases of a target; a placeholder stands for them until they are known."""
        self.forget(folder)
        self.remaining |= dict.fromkeys((folder, case) for case in cases)
        if not complete:
            self._unknown.add(folder)

    def add(self, case: Case) -> None:
        """Add a finished case."""
        self.remaining.pop((case.folder, case.id), None)
        self.cases.append(case)
        self._unknown.discard(case.folder)
        total = 0 if self._unknown else len(self.cases) + len(self.remaining)
        self._progress(len(self.cases), total, case)

    def lookup(self, key: CacheKey) -> Any | None:
        """Return a value from the journal, if it has one."""
        return None if self._journal is None else self._journal.find(key, RESULTS[key.kind])

    def store(self, key: CacheKey, value: Any) -> None:
        """Store a value in the journal, if there is one."""
        if self._journal is not None:
            self._journal.store(key, value)

    def forget(self, folder: str) -> None:
        """Remove the remaining cases of a target."""
        self.remaining = {one: None for one in self.remaining if one[0] != folder}
        self._unknown.discard(folder)

    def begin(self, model: Model) -> None:
        """Add a model without results of checks."""
        self.models[model.key] = self._first_models[model.key] = model

    def enter(self, key: ModelKey, check: ModelCheck, value: Any) -> None:
        """Enter a check's value, or its failure, into the record of a model.

        The record depends on the order of `CHECKS`, not on the order in which checks end.
        """
        values = self._values.setdefault(key, {})
        values.setdefault(check.kind, []).append(value)
        model = self._first_models[key]
        for each in CHECKS:
            for entered in values.get(each.kind, ()):
                model = each.enter(model, entered)
        self.models[key] = model
