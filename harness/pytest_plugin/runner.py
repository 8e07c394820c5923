"""Where the tests of one pytest process are run: one worker process, and what is known already.

A system is prepared once and a model diagnosed once, however many tests ask for it.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from harness.audit.run import run_audit
from harness.audit.task import audit_task
from harness.baseline.known import Accepted, accepted, mark_known
from harness.baseline.measure import measure, measure_task
from harness.baseline.store import read_baseline
from harness.cases.case import case_task, run_case
from harness.cases.prepare import Prepared, prepare
from harness.diagnosis.task import diagnose_model, diagnosis_task
from harness.engines.registry import engines
from harness.files.sidecar import Sidecar
from harness.run import Record, failed, hurdle
from harness.schedule.main_module import without_main
from harness.schedule.workers import Failure, Workers
from harness.text.table import case_id


class Laboratory:
    """Runs one case or audit at a time, apart from pytest: a crash there is an outcome here."""

    def __init__(self, resolution: float, limit: float, baseline: Path | None) -> None:
        self._resolution, self._limit, self._baseline = resolution, limit, baseline
        if baseline is not None:
            read_baseline(baseline)  # one that can't be believed ends the session before it begins
        self._accepted: dict[Path, Accepted | None] = {}
        self._workers: Workers | None = None
        self._engines = engines()
        self._prepared: dict[Path, Prepared | Failure] = {}
        self._diagnoses: dict[tuple[Path, str], Record] = {}

    def hurdle(self, sidecar: Sidecar, engine: str) -> Record | None:
        """Why a model can't be run at all, as fields of a record; None where it can."""
        return hurdle(self._engines, engine, sidecar)

    def prepared(self, folder: Path) -> Prepared | Failure:
        """The reference side of a folder, once."""
        if folder not in self._prepared:
            self._prepared[folder] = self._run(prepare, folder)
        return self._prepared[folder]

    def case(self, named: Record, folder: Path, sidecar: Sidecar) -> Record:
        """Run the case that a record names; returns the whole record.

        A difference that the baseline knows has `accepted`, the reason it was accepted with.
        """
        found = self.prepared(folder)
        if isinstance(found, Failure):
            return named | failed(found)
        engine, scenario = named["engine"], named["scenario"]
        task = case_task(found, sidecar, engine, scenario, self._resolution)
        value = self._run(run_case, task)
        if isinstance(value, Failure):
            return named | failed(value)
        record: Record = named | value
        if folder not in self._accepted:
            self._accepted[folder] = accepted(self._baseline, (folder,), self._resolution)
        before = self._accepted[folder]
        if before is not None and case_id(record) in before.known:
            measuring = measure_task(task, found.variants, before.tracks[case_id(record)])
            seen = self._run(measure, measuring)
            record["measured"] = {"failed": seen.reason} if isinstance(seen, Failure) else seen
            mark_known([record], before)
        return record

    def audit(self, folder: Path, sidecar: Sidecar, engine: str) -> Record:
        """Audit a model; returns `audit`, its findings and notes, or why there is none."""
        found = self.prepared(folder)
        if isinstance(found, Failure):
            return failed(found)
        value = self._run(run_audit, audit_task(found, sidecar, engine))
        return failed(value) if isinstance(value, Failure) else {"audit": value}

    def diagnosis(self, folder: Path, sidecar: Sidecar, engine: str) -> Record:
        """Name the cause of what a model does wrong, from its motions in every scenario; once."""
        key = sidecar.model, engine
        if key not in self._diagnoses:
            found = self.prepared(folder)
            value: Any = found
            if not isinstance(found, Failure):
                value = self._run(diagnose_model, diagnosis_task(found, sidecar, engine))
            if isinstance(value, Failure):
                value = {"reason": value.reason}
            self._diagnoses[key] = value
        return self._diagnoses[key]

    def close(self, *, at_once: bool) -> None:
        """End the worker process, if one was needed; `at_once`: with what it is doing."""
        if self._workers is not None:
            with without_main():
                self._workers.__exit__(KeyboardInterrupt if at_once else None, None, None)
            self._workers = None

    def _run(self, function: Callable[[Any], Any], argument: Any) -> Any:
        with without_main():
            if self._workers is None:
                self._workers = Workers(1, self._limit).__enter__()
            return self._workers.outcome(self._workers.submit(function, argument))
