"""What is to be done of a folder: had from earlier runs where nothing it depends on is another.

A folder is prepared before anything of it is run, and not at all where all of it is known.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, get_args

from harness.baseline.inputs import inputs, with_elsewhere
from harness.cached import (
    FolderFacts,
    Piece,
    Reading,
    Told,
    models_inputs,
    piece_of_folder,
    with_snapshot,
)
from harness.cases.multibody import PreparedTree, prepare_folder
from harness.cases.not_run import failed_case
from harness.cases.prepare import Prepared
from harness.collected import Collected, Jobs, stand_in
from harness.options import Options
from harness.records.baseline import Snapshot
from harness.records.case import CaseId, ModelKey
from harness.records.journal import Kind, Work
from harness.schedule.jobs import Job, Task
from harness.schedule.workers import Failure

KEPT_BY_JOURNALS = frozenset(get_args(Kind))

Make = Callable[[Any], Task[Any, Any]]
"""Makes a task of a folder's preparation."""

Done = Callable[[Any], Jobs]
Failed = Callable[[Failure], Jobs]


class FolderWork:
    """The work of a run in one folder.

    Args:
        folder: of the system.
        options: of the run.
        snapshots: accepted ones of the cases that are to be measured, where no selection says it.
        found: what the jobs bring.

    Attributes:
        folder, options, found: as given.
    """

    def __init__(
        self,
        folder: Path,
        options: Options,
        snapshots: Mapping[CaseId, Snapshot],
        found: Collected,
    ) -> None:
        self.folder, self.options, self.found = folder, options, found
        self._snapshots, self._cache = snapshots, options.cache
        self._facts: FolderFacts | None = None
        self._prepared: Prepared | PreparedTree | None = None
        self._waiting: list[Callable[[], Job[Any]]] | None = None
        # As it is before anything of it is run: what changes meanwhile is another folder's.
        known = options.resolution, options.baseline
        self._journaled = inputs(folder, *known) if found.keeps else {}
        self._cached = models_inputs(folder, *known) if self._cache else {}
        self._piece = piece_of_folder(folder, described=options.described) if self._cache else None

    @property
    def facts(self) -> FolderFacts:
        """Of the folder, once it is prepared or known."""
        assert self._facts is not None
        return self._facts

    def begun(self, models: Callable[[], Jobs]) -> Iterator[Job[Any]]:
        """The jobs of the folder's models, after its preparation where that is needed."""
        known = self._had(self._piece)
        if known is None:
            yield self._preparation(models)
            return
        self._facts, self._waiting = known, []
        yield from models()  # what is to be run waits
        if self._waiting:
            yield self._preparation(self._resumed)

    def _preparation(self, then: Callable[[], Jobs]) -> Job[Prepared | PreparedTree]:
        preparing = partial(prepare_folder, described=self.options.described)

        def done(prepared: Prepared | PreparedTree) -> Jobs:
            self._prepared = prepared
            if self._facts is None:
                self._facts = FolderFacts(
                    record=prepared.record,
                    bodies=isinstance(prepared, PreparedTree),
                    reads=prepared.reads,
                )
                self._keep(self._piece, self._facts, ())
            return then()

        return Job(task=Task(preparing, self.folder), done=done, failed=self._unprepared)

    def _resumed(self) -> Jobs:
        waiting, self._waiting = self._waiting or [], None
        return [make() for make in waiting]

    def _unprepared(self, failure: Failure) -> Jobs:
        self.found.forget(str(self.folder))
        self.found.add(failed_case(stand_in(self.folder), str(self.folder), failure))
        return ()

    def do(
        self,
        kind: str,
        key: ModelKey,
        make: Make,
        done: Done,
        failed: Failed,
        *,
        scenario: str = "",
        snapshot: Snapshot | None = None,
    ) -> Iterator[Job[Any]]:
        """A piece of work of a model, unless it is known what comes of it.

        Args:
            kind: as `harness.cached.KINDS` has it.
            key: of the model.
            make: the task, of the folder's preparation.
            done, failed: what follows, as of a job.
            scenario: of a case or a measurement.
            snapshot: what a measurement is to repeat.
        """
        work = self._work(kind, key, scenario)
        if work is not None and self.found.knows(work):
            yield from done(self.found.known(work))
            return
        piece = self._piece_of(kind, key, scenario, snapshot)
        value = self._had(piece)
        if value is not None:
            self.found.cached += kind == "case"
            yield from done(value)
            return

        def job() -> Job[Any]:
            task = make(self._prepared)
            # Of a model that is code is not known before what it reads.
            if piece is not None and Path(piece.model).suffix == ".py":
                task = Task(Reading(task, self.folder), task.argument)

            def ended(told: Any) -> Jobs:
                value, reads = (told.value, told.reads) if isinstance(told, Told) else (told, ())
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
        return None if piece is None or self._cache is None else self._cache.find(piece)

    def _keep(self, piece: Piece | None, value: Any, reads: Iterable[str]) -> None:
        """For later runs, with what was read for it beside what `system.py` reads."""
        if piece is not None and self._cache is not None:
            self._cache.keep(piece, value, (*self.facts.reads, *reads))

    def _work(self, kind: str, key: ModelKey, scenario: str) -> Work | None:
        """As the run's journal has it; None where it has not."""
        if kind not in KEPT_BY_JOURNALS:
            return None
        known = with_elsewhere(self._journaled.get(key, ""), key, self.facts.reads)
        folder, model, engine = key
        what: Any = kind
        work = Work(
            what=what, folder=folder, model=model, engine=engine, scenario=scenario, inputs=known
        )
        return work if known else None

    def _piece_of(
        self, kind: str, key: ModelKey, scenario: str, snapshot: Snapshot | None
    ) -> Piece | None:
        if self._cache is None:
            return None
        folder, model, engine = key
        known = self._cached.get(key, "")
        return Piece(
            kind=kind,
            folder=folder,
            model=model,
            engine=engine,
            scenario=scenario,
            inputs=with_snapshot(known, snapshot) if kind == "measurement" else known,
        )

    def is_measured(self, case: CaseId) -> bool:
        """Whether what a case's model does is wanted."""
        return self.options.selection is not None or case in self._snapshots

    def snapshot(self, case: CaseId) -> Snapshot | None:
        """The one that was accepted of a case, or is to be repeated."""
        selection = self.options.selection
        if selection is None:
            return self._snapshots.get(case)
        return selection.snapshot(str(self.folder), case)

    def measure(self, case: CaseId, make: Callable[[Any, Snapshot | None], Task[Any, Any]]) -> Jobs:
        """What a case's model does, where a snapshot was accepted, or may be."""
        if not self.is_measured(case):
            return ()
        folder, accepted = str(self.folder), self.snapshot(case)

        def done(value: Any) -> Jobs:
            self.found.measured[folder, case] = value
            return ()

        key = folder, case.model, case.engine
        return self.do(
            "measurement",
            key,
            lambda prepared: make(prepared, accepted),
            done,
            done,
            scenario=case.scenario,
            snapshot=accepted,
        )
