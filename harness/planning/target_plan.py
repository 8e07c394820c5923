"""Plan of a target, which reuses results of earlier runs with unchanged dependencies.

A folder or a file is prepared before its cases run, and not at all if all its results are known.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Generic, TypeVar, cast, get_args

from physics_crosscheck.harness.baseline.known import Accepted
from physics_crosscheck.harness.checks.not_run import failed_case
from physics_crosscheck.harness.jobs.graph import Job, Task
from physics_crosscheck.harness.jobs.workers import Failure
from physics_crosscheck.harness.modelfiles.path_states import merged
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.planning.cache import Piece, Reading, TaskOutput, with_snapshot
from physics_crosscheck.harness.planning.options import Options
from physics_crosscheck.harness.planning.prepared import ModelTask, Preparation, task_function
from physics_crosscheck.harness.planning.result_builder import Collected, Jobs
from physics_crosscheck.harness.records.baseline import Measurement, Snapshot
from physics_crosscheck.harness.records.case import Case, CaseId, ModelKey
from physics_crosscheck.harness.records.journal import Kind, Work

KEPT_BY_JOURNALS = frozenset(get_args(Kind))

Done = Callable[[Any], Jobs]
Failed = Callable[[Failure], Jobs]

Facts = TypeVar("Facts")
"""Facts about a prepared target without its equations; a record."""


class PlaceWork(ABC, Generic[Facts]):
    """The plan of a run for a folder or a robot file.

    Args:
        place: the folder or the file.
        options: options of the run.
        results: results of the jobs.
        key: cache key of its preparation; None: reuse nothing.
        before: accepted results, if any; their cases are measured unless a selection decides.

    Attributes:
        place, options, results: as given.
    """

    def __init__(
        self,
        place: Path,
        options: Options,
        results: Collected,
        key: Piece | None,
        before: Accepted | None = None,
    ) -> None:
        self.place, self.options, self.found = place, options, results
        self._piece, self._cache, self._before = key, options.cache, before
        self._facts: Facts | None = None
        self._solved: object = None
        self._waiting: list[Callable[[], Job[Any]]] | None = None

    @property
    def facts(self) -> Facts:
        """Facts about the target, once it is prepared or known."""
        assert self._facts is not None
        return self._facts

    @property
    @abstractmethod
    def stand_in(self) -> CaseId:
        """Placeholder for all its cases while they are unknown."""

    @property
    @abstractmethod
    def reads(self) -> Mapping[str, str]:
        """States of the files that its code read, by name relative to the target, once known."""

    @abstractmethod
    def _preparing(self) -> Task[Any, Any]:
        """Return the task that prepares the target."""

    @abstractmethod
    def _inputs(self, key: ModelKey) -> str:
        """Return a hash of the dependencies of a model in an engine; "" if unknown."""

    def _inputs_of_journal(self, key: ModelKey) -> str:
        """Return the same hash with the files that the code read, which a journal does not
        store.
        """
        return self._inputs(key)

    def _work(self, kind: str, key: ModelKey, scenario: str) -> Work | None:
        """Return the journal's key of a task; None without a journal."""
        if kind not in KEPT_BY_JOURNALS or not self.found.keeps:
            return None
        inputs = self._inputs_of_journal(key)
        folder, model, engine = key
        what: Any = kind
        journal_entry = Work(
            what=what, folder=folder, model=model, engine=engine, scenario=scenario, inputs=inputs
        )
        return journal_entry if inputs else None

    def begun(self, models: Callable[[], Jobs]) -> Iterator[Job[Any]]:
        """Yield the jobs of its models, after its preparation if needed."""
        facts = self._known_facts()
        if facts is None:
            yield self._preparation(models)
            return
        self._know(facts)
        self._waiting = []
        yield from models()  # jobs of the models wait
        if self._waiting:
            yield self._preparation(self._resumed)

    def _know(self, facts: Facts) -> None:
        self._facts = facts
        self.found.reads[str(self.place)] = self.reads

    def _known_facts(self) -> Facts | None:
        """Return the facts from earlier runs, if any."""
        return self._had(self._piece)

    def _preparation(self, then: Callable[[], Jobs]) -> Job[Any]:
        def done(prepared: Preparation) -> Jobs:
            self._solved = prepared.solved
            if self._facts is None:
                self._know(cast(Facts, prepared.facts))
                self._keep(self._piece, self._facts, {})
            return then()

        return Job(task=self._preparing(), done=done, failed=self._unprepared)

    def _resumed(self) -> Jobs:
        waiting, self._waiting = self._waiting or [], None
        return [make() for make in waiting]

    def _unprepared(self, failure: Failure) -> Jobs:
        self.found.forget(str(self.place))
        self.found.add(failed_case(self.stand_in, str(self.place), failure))
        return ()

    def do(
        self,
        kind: str,
        key: ModelKey,
        done: Done,
        failed: Failed,
        *,
        sidecar: Sidecar | None = None,
        scenario: str = "",
        snapshot: Snapshot | None = None,
    ) -> Iterator[Job[Any]]:
        """Yield the job of a model's task, unless its value is cached.

        Args:
            kind: key of `planning.cache.KINDS`, and name of the function in `planning.tasks`.
            key: key of the model.
            done, failed: follow-up jobs, as in `Job`.
            sidecar: sidecar of a folder's model.
            scenario: scenario of a case or a measurement.
            snapshot: snapshot that a measurement repeats.
        """
        journal_key = self._work(kind, key, scenario)
        if (
            journal_key is not None
            and (value := self._sound(self.found.known(journal_key))) is not None
        ):
            yield from done(value)
            return
        cache_key = self._piece_of(kind, key, scenario, snapshot)
        if (value := self._had(cache_key)) is not None:
            self.found.cached += kind == "case"
            yield from done(value)
            return

        arguments = ModelTask(
            engine=key[-1],
            resolution=self.options.resolution,
            sidecar=sidecar,
            scenario=scenario,
            snapshot=snapshot,
        )

        def job() -> Job[Any]:
            task = Task(task_function(kind, task=arguments), self._solved)
            # The files that a model in code reads are not known in advance.
            if cache_key is not None and Path(cache_key.model).suffix == ".py":
                task = Task(Reading(task, self.place), task.argument)

            def ended(outcome: Any) -> Jobs:
                value, reads = (
                    (outcome.value, outcome.reads)
                    if isinstance(outcome, TaskOutput)
                    else (outcome, {})
                )
                if journal_key is not None:
                    self.found.keep(journal_key, value)
                self._keep(cache_key, value, reads)
                return done(value)

            return Job(task=task, done=ended, failed=failed)

        if self._waiting is None:
            yield job()
        else:
            self._waiting.append(job)

    def _had(self, key: Piece | None) -> Any | None:
        if key is None or self._cache is None:
            return None
        return self._sound(self._cache.find(key))

    def _sound(self, value: Any | None) -> Any | None:
        """Return a stored value; ignore a case that contradicts its own numbers."""
        if isinstance(value, Case) and value.contradiction(self.options.resolution):
            return None
        return value

    def _keep(self, key: Piece | None, value: Any, reads: Mapping[str, str]) -> None:
        """Store a value, with the files that it read in addition to those of `system.py`."""
        if key is not None and self._cache is not None:
            self._cache.keep(key, value, merged(self.reads, reads))

    def _piece_of(
        self, kind: str, key: ModelKey, scenario: str, snapshot: Snapshot | None
    ) -> Piece | None:
        if self._cache is None:
            return None
        folder, model, engine = key
        inputs = self._inputs(key)
        return Piece(
            kind=kind,
            folder=folder,
            model=model,
            engine=engine,
            scenario=scenario,
            inputs=with_snapshot(inputs, snapshot) if kind == "measurement" else inputs,
        )

    def snapshot(self, case: CaseId) -> Snapshot | None:
        """Return the accepted snapshot of a case, or the one to repeat."""
        source = self.options.selection or self._before
        return None if source is None else source.snapshot(str(self.place), case)

    def is_measured(self, case: CaseId) -> bool:
        """Return whether a case must be measured."""
        return self.options.selection is not None or self.snapshot(case) is not None

    def measure(self, case: CaseId, sidecar: Sidecar | None = None) -> Jobs:
        """Measure a case, if a snapshot was accepted, or may be."""
        if not self.is_measured(case):
            return ()
        folder = str(self.place)

        def done(value: Measurement | Failure) -> Jobs:
            self.found.measured[folder, case] = value
            return ()

        return self.do(
            "measurement",
            (folder, case.model, case.engine),
            done,
            done,
            sidecar=sidecar,
            scenario=case.scenario,
            snapshot=self.snapshot(case),
        )
