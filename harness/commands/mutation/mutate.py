"""Mutation test of the check: faults planted in copies of models.

Every bound literal gets three small faults and four factors, and every known mistake (`mistakes`)
is planted wherever a model has a place for it. The result measures the value of a validation:
whether the motions of the folder's scenarios reveal a fault, whether the motions alone identify its
cause, and its smallest detectable size.
"""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, NoReturn

import msgspec

from physics_crosscheck.harness.checks.prepare import PreparedSystem, PreparedTree, prepare
from physics_crosscheck.harness.checks.task import ModelTask, model_task
from physics_crosscheck.harness.diagnosis.trial import scratch
from physics_crosscheck.harness.documents.errors import original_paths
from physics_crosscheck.harness.engines.protocol import EngineError
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.jobs.chosen import executor
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.jobs.graph import Job, Task, run_jobs
from physics_crosscheck.harness.modelfiles.model_files import (
    UnreadModel,
    chosen_engines,
    model_files,
    model_path,
)
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.numerics.segments import BlownUpError
from physics_crosscheck.harness.planning.options import Options
from physics_crosscheck.harness.records.mutation import FaultVerdict, Mutation
from .judge import judge_motions
from .survey import MutationError, PlantedFault, system_faults
from .trees import judge_bodies, tree_faults

Progress = Callable[[int, int, Mutation | None], None]
"""Called with (faults done, all faults or 0 if unknown, the fault just done)."""


def faults_of(task: ModelTask[Any]) -> tuple[PlantedFault[Any], ...]:
    """Return all faults of a model.

    Raises:
        MutationError: for a model that is not sound.
        RobotError, EngineError, BlownUpError: naming the model that cannot run.
    """
    return (tree_faults if isinstance(task.target, PreparedTree) else system_faults)(task)


def mutated(fault: PlantedFault[Any]) -> Mutation:
    """Plant one fault in a model, and judge it."""
    began = time.process_time()
    judge = judge_bodies if isinstance(fault.model.target, PreparedTree) else judge_motions
    with scratch() as copies:
        wrong = fault.mistake.edit.plant(fault.model, copies)
        try:
            row = judge(fault, wrong)
        except (EngineError, BlownUpError) as error:
            row = fault.row(FaultVerdict.REFUSED, str(error))
        message = original_paths(row.message, wrong.file.parent, fault.model.file.parent)
    seconds = time.process_time() - began
    return msgspec.structs.replace(row, message=message, seconds=seconds)


def mutate(
    targets: Sequence[Path],
    options: Options,
    progress: Progress,
    warn: Callable[[str], object] = lambda _: None,
) -> list[Mutation]:
    """Plant every known fault in models; skip engines that are not installed.

    Args:
        targets: system folders and robot files.
        options: engines, models, workers, and limits of one fault, as of a run.
        progress: called after every fault.
        warn: called with a sentence for each engine that does not agree with a sound robot file.

    Raises:
        MutationError: for a model that is not sound; the message names file and remedy. A robot
            file is sound if it agrees with its equations in one engine.
    """
    plan = _Plan(options, progress)
    preparing = partial(prepare, described=False, floating=options.floating, model=options.model)
    with executor(jobs=options.jobs, limits=options.limits) as pool:
        run_jobs((plan.target(one, preparing) for one in targets), pool)
    for sentence in plan.unsound_engines():
        warn(sentence)
    return plan.sorted()


@dataclass
class _Plan:
    """The jobs and their rows: targets, then surveys of models, then faults."""

    options: Options
    progress: Progress
    unsound: dict[Path, list[str]] = field(default_factory=dict)
    sound: set[Path] = field(default_factory=set)
    placed_rows: list[tuple[int, Mutation]] = field(default_factory=list)
    pending: int = 0
    planned: int = 0

    def sorted(self) -> list[Mutation]:
        """Return the rows by model and engine, with faults in the order of the surveys."""
        ordered = sorted(
            self.placed_rows, key=lambda f: (f[1].system, f[1].model, f[1].engine, f[0])
        )
        return [row for _, row in ordered]

    def unsound_engines(self) -> list[str]:
        """Return why engines do not agree with robot files that are sound.

        Raises:
            MutationError: for a robot file that no engine agrees with.
        """
        for file, reasons in self.unsound.items():
            if file not in self.sound:
                raise MutationError(reasons[0])
        return [*chain.from_iterable(self.unsound.values())]

    def target(
        self, place: Path, prepare: Callable[[Path], PreparedSystem | PreparedTree]
    ) -> Job[PreparedSystem | PreparedTree]:
        """Prepare a folder or a robot file, then survey its models."""
        self.pending += 1
        file = place if place.is_file() else place / "system.py"
        return Job(task=Task(prepare, place), done=self._surveys, failed=partial(_unsound, file))

    def _surveys(self, prepared: PreparedSystem | PreparedTree) -> Iterator[Job[Any]]:
        self.pending -= 1
        standalone = prepared.place.is_file()
        for file, engine in self._pairs(prepared.place):
            self.pending += 1
            path, sidecar = model_path(file), file if isinstance(file, Sidecar) else None
            unsound = partial(self._robot_unsound if standalone else _unsound, path)
            task = model_task(prepared, engine, sidecar, thorough=self.options.thorough)
            yield Job(task=Task(faults_of, task), done=partial(self._faults, path), failed=unsound)

    def _robot_unsound(self, file: Path, failure: Failure) -> tuple[()]:
        self.pending -= 1
        self.unsound.setdefault(file, []).append(failure.about(file))
        return ()

    def _faults(self, file: Path, faults: tuple[PlantedFault[Any], ...]) -> Iterator[Job[Mutation]]:
        self.sound.add(file)
        self.pending -= 1
        for fault in faults:
            yield Job(
                task=Task(mutated, fault),
                done=partial(self._row, self.planned),
                failed=partial(self._died, self.planned, fault),
            )
            self.planned += 1

    def _died(self, place: int, fault: PlantedFault[Any], failure: Failure) -> tuple[()]:
        """Treat an engine that crashes on a number as one that refuses it."""
        return self._row(place, fault.row(FaultVerdict.REFUSED, failure.reason))

    def _pairs(self, place: Path) -> Iterator[tuple[Sidecar | Path, str]]:
        """Yield a robot file, or the chosen models of a folder, with every installed engine."""
        for file in [place] if place.is_file() else model_files(place):
            if isinstance(file, UnreadModel):
                raise MutationError(file.reason)
            for engine in _installed(chosen_engines(file, self.options.engines)):
                name = model_path(file).name
                if place.is_file() or self.options.choice.includes_model(str(place), name, engine):
                    yield file, engine

    def _row(self, place: int, row: Mutation) -> tuple[()]:
        self.placed_rows.append((place, row))
        self.progress(len(self.placed_rows), 0 if self.pending else self.planned, row)
        return ()


def _unsound(file: Path, failure: Failure) -> NoReturn:
    raise MutationError(failure.about(file))


def _installed(names: Iterable[str]) -> list[str]:
    adapters = engines()
    return [name for name in names if name in adapters and adapters[name].version() is not None]
