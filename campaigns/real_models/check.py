"""The jobs of a file: it is read, solved, run in every engine, and what differs is explained."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from msgspec import structs

from campaigns.real_models.entry import STILL, Came, Entry
from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.not_run import absent
from physics_crosscheck.harness.checks.prepare import PreparedTree, prepare_tree
from physics_crosscheck.harness.checks.task import TreeTask, model_task
from physics_crosscheck.harness.diagnosis.robot_task import diagnose_robot
from physics_crosscheck.harness.engines.registry import engines_reading
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.jobs.graph import Job, Task
from physics_crosscheck.harness.modelfiles.inertias import impossible_inertias
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.finding import Diagnosis
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.results.causes import cause_sentences

Jobs = Iterator[Job[Any]]

Told = Callable[[Entry], None]
"""Called with what became of a file, once nothing of it is left to be done."""


def digest_of(file: Path) -> str:
    """Of a file's own bytes: what it includes is not looked at."""
    return hashlib.sha256(file.read_bytes()).hexdigest()[:16]


def read_entry(file: Path) -> Entry:
    """What reading a file alone tells."""
    robot = read_robot(file)
    return Entry(
        file=str(file),
        digest=digest_of(file),
        tree=robot.tree is not None,
        freedoms=0 if robot.tree is None else robot.tree.dof,
        obstacles=tuple(map(str, robot.obstacles)),
        left_out=tuple(sorted({one.what for one in robot.left_out})),
        impossible=tuple(sorted({one.kind for one in impossible_inertias(robot)})),
    )


class Check:
    """What is to be done for one file.

    Args:
        file: the model file.
        resolution: that is asked.
        floating: whether the root of a URDF moves freely.
        told: called at the end.
        causes: whether what differs is explained.
    """

    def __init__(
        self, file: Path, resolution: float, floating: bool, told: Told, *, causes: bool = True
    ) -> None:
        self._file, self._resolution, self._floating, self._told = file, resolution, floating, told
        self._causes = causes
        self._began = time.perf_counter()
        self._left = 0

    @property
    def job(self) -> Job[Entry]:
        """To read it, and what follows."""
        return Job(task=Task(read_entry, self._file), done=self._prepare, failed=self._unread)

    def _unread(self, failure: Failure) -> Jobs:
        self._entry = Entry(
            file=str(self._file), digest=digest_of(self._file), tree=False, freedoms=0,
            obstacles=(f"{self._file}: {failure.reason}",), left_out=(), impossible=(),
        )  # fmt: skip
        return self._end()

    def _prepare(self, entry: Entry) -> Jobs:
        self._entry, self._began = entry, time.perf_counter()
        if not entry.tree or not entry.freedoms or any(STILL in one for one in entry.obstacles):
            return self._end()
        prepare = partial(prepare_tree, floating=self._floating)
        failed = partial(self._failed, "-")
        return iter([Job(task=Task(prepare, self._file), done=self._run, failed=failed)])

    def _run(self, prepared: PreparedTree) -> Jobs:
        there = [engine for engine in engines_reading(self._file.suffix) if not absent(engine)]
        self._left = len(there)
        for engine in there:
            task = model_task(prepared, engine.name, resolution=self._resolution)
            yield Job(
                task=Task(run_case, task),
                done=partial(self._ran, task),
                failed=partial(self._failed, engine.name),
            )

    def _ran(self, task: TreeTask, case: Case) -> Jobs:
        known = case.verdict
        came = Came(
            engine=case.engine,
            outcome=case.outcome,
            discrepancy=None if known is None else known.largest_discrepancy,
            uncertainty=None if known is None else known.largest_uncertainty,
            reason=case.reason,
        )
        if case.outcome is not Outcome.DIFFERS or not self._causes:
            return self._came(came)
        return iter([
            Job(
                task=Task(partial(diagnose_robot, is_reference=True), task),
                done=partial(self._explained, came),
                failed=lambda failure: self._came(structs.replace(came, cause=failure.reason)),
            )
        ])  # fmt: skip

    def _explained(self, came: Came, found: Diagnosis) -> Jobs:
        told = "; ".join(cause_sentences(found.explanations[0])) if found.explanations else ""
        if not found.explained:
            told = f"not explained; at best {told}" if told else "not explained"
        return self._came(structs.replace(came, cause=found.failure or told))

    def _failed(self, engine: str, failure: Failure) -> Jobs:
        return self._came(Came(engine=engine, outcome=Outcome.FAILED, reason=failure.reason))

    def _came(self, came: Came) -> Jobs:
        self._entry = structs.replace(self._entry, cases=(*self._entry.cases, came))
        self._left -= 1
        return iter(()) if self._left > 0 else self._end()

    def _end(self) -> Jobs:
        self._told(structs.replace(self._entry, seconds=time.perf_counter() - self._began))
        return iter(())
