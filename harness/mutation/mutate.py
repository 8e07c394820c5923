"""What the check would catch: models made wrong, on purpose, in copies.

Every bound literal is made wrong by three sizes and four factors, and every known mistake
(`harness.mutation.mistakes`) is made wherever a model has a place for it. It tells what a
validation is worth: whether a fault is seen in the motions of the folder's scenarios, whether its
cause is named from them alone, and at what size it is first seen.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

from physics_crosscheck.harness.checks.multibody import PreparedTree, prepare_folder
from physics_crosscheck.harness.checks.prepare import Prepared
from physics_crosscheck.harness.diagnosis.task import DiagnosisTask, diagnosis_task
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.jobs.chosen import executor
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.jobs.graph import Job, Task, work
from physics_crosscheck.harness.jobs.limits import FAULT_SECONDS, Limits
from physics_crosscheck.harness.modelfiles.model_files import (
    UnreadModel,
    chosen_engines,
    model_files,
)
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.mutation.judge import RESOLUTION, MutationTask, mutated, refused
from physics_crosscheck.harness.mutation.survey import MutationError, Survey, survey
from physics_crosscheck.harness.mutation.trees import TreeFault, died, faults_of, mutated_tree
from physics_crosscheck.harness.records.mutation import Mutation

Progress = Callable[[int, int, Mutation | None], None]
"""Called with (faults done, faults in all or 0 while that is unknown, the one just done)."""


def mutate(
    folders: Sequence[Path],
    progress: Progress,
    *,
    only: Sequence[str] = (),
    workers: int = 2,
    limits: Limits | None = None,
) -> list[Mutation]:
    """Make every model of some folders wrong in every known way; engines not there are left out.

    Args:
        folders: of the systems.
        progress: told of every fault.
        only: engines; empty: all.
        workers: processes.
        limits: of one fault.

    Raises:
        MutationError: a folder must be sound to be mutated; the message names file and remedy.
    """
    plan = _Plan(only, progress)
    with executor(jobs=workers, limits=limits or Limits(seconds=FAULT_SECONDS)) as pool:
        work(map(plan.folder, folders), pool)
    return plan.sorted()


@dataclass
class _Plan:
    """The jobs, and the rows that they bring: folders, then surveys of models, then faults.

    Attributes:
        found: rows with their faults' places in the order of the surveys.
        unknown: jobs that are still to tell how many faults there are.
        known: faults so far.
    """

    only: Sequence[str]
    progress: Progress
    found: list[tuple[int, Mutation]] = field(default_factory=list)
    unknown: int = 0
    known: int = 0

    def sorted(self) -> list[Mutation]:
        """The rows: by model and engine, in the order in which faults are told."""
        ordered = sorted(self.found, key=lambda f: (f[1].system, f[1].model, f[1].engine, f[0]))
        return [row for _, row in ordered]

    def folder(self, folder: Path) -> Job[Prepared | PreparedTree]:
        """Prepare it, then survey its models."""
        self.unknown += 1
        unsound = partial(_unsound, folder / "system.py")
        preparing = partial(prepare_folder, described=False)
        return Job(task=Task(preparing, folder), done=self._surveys, failed=unsound)

    def _surveys(self, prepared: Prepared | PreparedTree) -> Iterator[Job[Any]]:
        self.unknown -= 1
        if isinstance(prepared, PreparedTree):
            yield from self._of_tree(prepared)
            return
        for task in _models(prepared, self.only):
            self.unknown += 1
            unsound = partial(_unsound, task.sidecar.model)
            yield Job(task=Task(survey, task), done=partial(self._faults, task), failed=unsound)

    def _faults(self, model: DiagnosisTask, found: Survey) -> Iterator[Job[Mutation]]:
        self.unknown -= 1
        for fault in found.faults:
            # Sent once for each fault: without all the others.
            task = MutationTask(model=model, survey=replace(found, faults=()), fault=fault)
            yield Job(
                task=Task(mutated, task),
                done=partial(self._row, self.known),
                failed=partial(self._died, self.known, task),
            )
            self.known += 1

    def _of_tree(self, prepared: PreparedTree) -> Iterator[Job[Any]]:
        for sidecar, engine in _pairs(prepared.folder, self.only):
            self.unknown += 1
            yield Job(
                task=Task(faults_of, prepared.task(sidecar, engine, RESOLUTION)),
                done=self._tree_faults,
                failed=partial(_unsound, sidecar.model),
            )

    def _tree_faults(self, found: tuple[TreeFault, ...]) -> Iterator[Job[Mutation]]:
        self.unknown -= 1
        for fault in found:
            yield Job(
                task=Task(mutated_tree, fault),
                done=partial(self._row, self.known),
                failed=partial(self._tree_died, self.known, fault),
            )
            self.known += 1

    def _tree_died(self, place: int, fault: TreeFault, failure: Failure) -> tuple[()]:
        return self._row(place, died(fault, failure.reason))

    def _died(self, place: int, task: MutationTask, failure: Failure) -> tuple[()]:
        """An engine that dies of a number has refused it, in its way."""
        return self._row(place, refused(task, failure.reason))

    def _row(self, place: int, row: Mutation) -> tuple[()]:
        self.found.append((place, row))
        self.progress(len(self.found), 0 if self.unknown else self.known, row)
        return ()


def _unsound(file: Path, failure: Failure) -> NoReturn:
    raise MutationError(failure.about(file))


def _models(prepared: Prepared, only: Sequence[str]) -> Iterator[DiagnosisTask]:
    for sidecar, engine in _pairs(prepared.folder, only):
        yield diagnosis_task(prepared, sidecar, engine)


def _pairs(folder: Path, only: Sequence[str]) -> Iterator[tuple[Sidecar, str]]:
    """Every model of a folder with every engine that is wanted and there."""
    known = engines()
    for found in model_files(folder):
        if isinstance(found, UnreadModel):
            raise MutationError(found.reason)
        for name in chosen_engines(found, only):
            if name in known and known[name].version() is not None:
                yield found, name
