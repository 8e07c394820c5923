"""Where the tests of one pytest process are run: one worker process, and what is known already.

A system is prepared once and a model diagnosed once, however many tests ask for it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeVar

from physics_crosscheck.harness.baseline.audits import mark_models
from physics_crosscheck.harness.baseline.known import Accepted, accepted, mark_known
from physics_crosscheck.harness.baseline.store import read_baseline
from physics_crosscheck.harness.checks.declared import Declared, declared
from physics_crosscheck.harness.checks.not_run import Hurdle, failed_case, hurdle, not_of_a_tree
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.jobs.main_module import without_main
from physics_crosscheck.harness.jobs.workers import Failure, Limits, Workers
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.planning import tasks
from physics_crosscheck.harness.planning.prepared import FolderFacts, ModelTask, Preparation
from physics_crosscheck.harness.records.baseline import Measurement, Snapshot
from physics_crosscheck.harness.records.case import Case, CaseId
from physics_crosscheck.harness.records.finding import Diagnosis
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.poses import Poses
from physics_crosscheck.harness.records.survey import Audit

Argument = TypeVar("Argument")
Value = TypeVar("Value")


class CaseRunner:
    """Runs one case or audit at a time, apart from pytest: a crash there is an outcome here."""

    def __init__(self, resolution: float, limits: Limits, baseline: Path | None) -> None:
        self._resolution, self._limits, self._baseline = resolution, limits, baseline
        if baseline is not None:
            read_baseline(baseline)  # one that can't be believed ends the session before it begins
        self._accepted: dict[Path, Accepted | None] = {}
        self._workers: Workers | None = None
        self._engines = engines()
        self._prepared: dict[Path, Preparation | Failure] = {}
        self._diagnoses: dict[tuple[Path, str], Diagnosis] = {}

    def hurdle(self, sidecar: Sidecar, engine: str) -> Hurdle | None:
        """Why a model can't be run at all; None where it can."""
        return hurdle(self._engines, engine, sidecar)

    def declared(self, folder: Path) -> Declared | Failure:
        """What a folder's declaration says at a glance."""
        return self._ask(declared, folder)

    def prepared(self, folder: Path) -> Preparation | Failure:
        """Prepare a folder, once."""
        if folder not in self._prepared:
            prepare = partial(tasks.folder, described=False)
            self._prepared[folder] = self._ask(prepare, folder)
        return self._prepared[folder]

    def case(self, one: CaseId, folder: Path, sidecar: Sidecar) -> Case:
        """Run a case; one that the baseline knows has the reason that it was accepted with."""
        found = self.prepared(folder)
        if isinstance(found, Failure):
            return failed_case(one, str(folder), found)
        if _has_bodies(found) and (reason := not_of_a_tree(sidecar)):
            return failed_case(one, str(folder), Failure(reason, "", kind="sidecar"))
        task = self._task(sidecar, one.engine, one.scenario)

        def measured(accepted: Snapshot) -> Measurement | Failure:
            measuring = replace(task, snapshot=accepted)
            return self._ask(partial(tasks.measurement, task=measuring), found.solved)

        case = self._ask(partial(tasks.case, task=task), found.solved)
        return self._judged(case, one, folder, measured)

    def _task(self, sidecar: Sidecar, engine: str, scenario: str = "") -> ModelTask:
        return ModelTask(
            engine=engine, resolution=self._resolution, sidecar=sidecar, scenario=scenario
        )

    def _judged(
        self,
        case: Case | Failure,
        one: CaseId,
        folder: Path,
        measured: Callable[[Snapshot], Measurement | Failure],
    ) -> Case:
        """A case as it came out; with the reason that it was accepted with, if it is known."""
        if isinstance(case, Failure):
            return failed_case(one, str(folder), case)
        if case.outcome not in (Outcome.DIFFERS, Outcome.UNRESOLVED):
            return case
        before = self._before(folder)
        if before is None or case.id not in before.snapshots:
            return case
        seen = {(case.folder, case.id): measured(before.snapshots[case.id])}
        (case,) = mark_known((case,), seen, before)
        return case

    def _before(self, folder: Path) -> Accepted | None:
        """What was accepted of a folder, read once."""
        if folder not in self._accepted:
            self._accepted[folder] = accepted(self._baseline, (folder,), self._resolution)
        return self._accepted[folder]

    def marked(self, model: Model, folder: Path) -> Model:
        """A model with the reason for which what its audit finds was accepted, if it was."""
        before = self._before(folder) if model.findings else None
        return model if before is None else mark_models((model,), before.systems)[0]

    def audit(self, folder: Path, sidecar: Sidecar, engine: str) -> Audit | Failure:
        """Audit a model, or say why it can't be."""
        found = self.prepared(folder)
        if isinstance(found, Failure):
            return found
        task = self._task(sidecar, engine)
        if not _has_bodies(found):
            return self._ask(partial(tasks.audit, task=task), found.solved)
        survey = self._ask(partial(tasks.survey, task=task), found.solved)
        if isinstance(survey, Failure):
            return survey
        return Audit(findings=survey.findings, poses=Poses(note="bodies are declared"))

    def diagnosis(self, folder: Path, sidecar: Sidecar, engine: str) -> Diagnosis:
        """Name the cause of what a model does wrong, from its motions in every scenario; once."""
        key = sidecar.model, engine
        if key not in self._diagnoses:
            found = self.prepared(folder)
            value: Diagnosis | Failure
            if isinstance(found, Failure):
                value = found
            else:
                task = self._task(sidecar, engine)
                value = self._ask(partial(tasks.diagnosis, task=task), found.solved)
            if isinstance(value, Failure):
                value = Diagnosis(failure=value.reason)
            self._diagnoses[key] = value
        return self._diagnoses[key]

    def close(self) -> None:
        """End the worker process, if one was needed, with what it is doing."""
        if self._workers is not None:
            self._workers.close()
            self._workers = None

    def _ask(self, function: Callable[[Argument], Value], argument: Argument) -> Value | Failure:
        with without_main():
            if self._workers is None:
                self._workers = Workers(1, self._limits)
            return self._workers.outcome(self._workers.submit(function, argument))


def _has_bodies(found: Preparation) -> bool:
    return isinstance(found.facts, FolderFacts) and found.facts.bodies
