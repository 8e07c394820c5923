"""What is to be done of a place: had from earlier runs where nothing it depends on is another.

A folder or a file is prepared before anything of it is run, and not at all where all of it is
known.
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
from physics_crosscheck.harness.planning.cache import Piece, Reading, Told, with_snapshot
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
"""What is known of a place once it is prepared, without its equations; a record."""


class PlaceWork(ABC, Generic[Facts]):
    """The work of a run in a folder, or on a robot's file.

    Args:
        place: the folder or the file.
        options: of the run.
        found: what the jobs bring.
        piece: its preparation, by what it depends on; None: nothing is had from earlier runs.
        before: what was accepted, if anything; cases of it are measured where no selection says so.

    Attributes:
        place, options, found: as given.
    """

    def __init__(
        self,
        place: Path,
        options: Options,
        found: Collected,
        piece: Piece | None,
        before: Accepted | None = None,
    ) -> None:
        self.place, self.options, self.found = place, options, found
        self._piece, self._cache, self._before = piece, options.cache, before
        self._facts: Facts | None = None
        self._solved: object = None
        self._waiting: list[Callable[[], Job[Any]]] | None = None

    @property
    def facts(self) -> Facts:
        """Of the place, once it is prepared or known."""
        assert self._facts is not None
        return self._facts

    @property
    @abstractmethod
    def stand_in(self) -> CaseId:
        """What stands for all its cases while they are not known."""

    @property
    @abstractmethod
    def reads(self) -> Mapping[str, str]:
        """States of what its code has read, by name relative to it; once that is known."""

    @abstractmethod
    def _preparing(self) -> Task[Any, Any]:
        """What prepares it."""

    @abstractmethod
    def _inputs(self, key: ModelKey) -> str:
        """Hash of what a model in an engine depends on; empty: it can't be told."""

    def _inputs_of_journal(self, key: ModelKey) -> str:
        """Hash of the same with what its code has read, which a journal does not keep beside."""
        return self._inputs(key)

    def _work(self, kind: str, key: ModelKey, scenario: str) -> Work | None:
        """A piece of work as the run's journal has it; None where it has not."""
        if kind not in KEPT_BY_JOURNALS or not self.found.keeps:
            return None
        known = self._inputs_of_journal(key)
        folder, model, engine = key
        what: Any = kind
        work = Work(
            what=what, folder=folder, model=model, engine=engine, scenario=scenario, inputs=known
        )
        return work if known else None

    def begun(self, models: Callable[[], Jobs]) -> Iterator[Job[Any]]:
        """The jobs of its models, after its preparation where that is needed."""
        known = self._known_facts()
        if known is None:
            yield self._preparation(models)
            return
        self._know(known)
        self._waiting = []
        yield from models()  # what is to be run waits
        if self._waiting:
            yield self._preparation(self._resumed)

    def _know(self, facts: Facts) -> None:
        self._facts = facts
        self.found.reads[str(self.place)] = self.reads

    def _known_facts(self) -> Facts | None:
        """What earlier runs knew of the place, where they did."""
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
        """A piece of work of a model, unless it is known what comes of it.

        Args:
            kind: of `planning.cache.KINDS`, and so the function of `planning.tasks`.
            key: of the model.
            done, failed: what follows, as of a job.
            sidecar: of a folder's model.
            scenario: of a case or a measurement.
            snapshot: what a measurement is to repeat.
        """
        work = self._work(kind, key, scenario)
        if work is not None and (value := self._sound(self.found.known(work))) is not None:
            yield from done(value)
            return
        piece = self._piece_of(kind, key, scenario, snapshot)
        if (value := self._had(piece)) is not None:
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
            # Of a model that is code is not known before what it reads.
            if piece is not None and Path(piece.model).suffix == ".py":
                task = Task(Reading(task, self.place), task.argument)

            def ended(told: Any) -> Jobs:
                value, reads = (told.value, told.reads) if isinstance(told, Told) else (told, {})
                if work is not None:
                    self.found.keep(work, value)
                self._keep(piece, value, reads)
                return done(value)

            return Job(task=task, done=ended, failed=failed)

        if self._waiting is None:
            yield job()
        else:
            self._waiting.append(job)

    def _had(self, piece: Piece | None) -> Any | None:
        if piece is None or self._cache is None:
            return None
        return self._sound(self._cache.find(piece))

    def _sound(self, value: Any | None) -> Any | None:
        """What was kept; a case that contradicts its own numbers is as good as none."""
        if isinstance(value, Case) and value.contradiction(self.options.resolution):
            return None
        return value

    def _keep(self, piece: Piece | None, value: Any, reads: Mapping[str, str]) -> None:
        """For later runs, with what was read for it beside what `system.py` reads."""
        if piece is not None and self._cache is not None:
            self._cache.keep(piece, value, merged(self.reads, reads))

    def _piece_of(
        self, kind: str, key: ModelKey, scenario: str, snapshot: Snapshot | None
    ) -> Piece | None:
        if self._cache is None:
            return None
        folder, model, engine = key
        known = self._inputs(key)
        return Piece(
            kind=kind,
            folder=folder,
            model=model,
            engine=engine,
            scenario=scenario,
            inputs=with_snapshot(known, snapshot) if kind == "measurement" else known,
        )

    def snapshot(self, case: CaseId) -> Snapshot | None:
        """The one that was accepted of a case, or is to be repeated."""
        known = self.options.selection or self._before
        return None if known is None else known.snapshot(str(self.place), case)

    def is_measured(self, case: CaseId) -> bool:
        """Whether what a case's model does is wanted."""
        return self.options.selection is not None or self.snapshot(case) is not None

    def measure(self, case: CaseId, sidecar: Sidecar | None = None) -> Jobs:
        """Measure what a case's model does, where a snapshot was accepted, or may be."""
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
