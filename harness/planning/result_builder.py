"""Combined results of a run's jobs."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.jobs.graph import Job
from physics_crosscheck.harness.records.baseline import Measurement
from physics_crosscheck.harness.records.case import Case, CaseId, ModelKey
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.system import SystemResult
from .model_checks import CHECKS, ModelCheck

Jobs = Iterable[Job[Any]]

Progress = Callable[[int, int, Case | None], None]
"""Called with (cases done, all cases or 0 while unknown, the case just done or None)."""


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

    def __init__(self, progress: Progress) -> None:
        self.systems: list[SystemResult] = []
        self.models: dict[ModelKey, Model] = {}
        self.cases: list[Case] = []
        self.measured: dict[tuple[str, CaseId], Measurement | Failure] = {}
        self.remaining: dict[tuple[str, CaseId], None] = {}
        self.cached = 0
        self.reads: dict[str, Mapping[str, str]] = {}
        self._progress = progress
        self._unknown: set[str] = set()
        self._first_models: dict[ModelKey, Model] = {}
        self._values: dict[ModelKey, dict[str, list[Any]]] = {}

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
