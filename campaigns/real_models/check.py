"""Jobs that read a file, solve it, run it in every engine, and diagnose differences."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from msgspec import structs

from campaigns.real_models.entry import STILL, EngineResult, FileEntry
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

Report = Callable[[FileEntry], None]
"""A function that takes the result of a file once all its jobs have ended."""


def digest_of(file: Path) -> str:
    """Return the digest of a file's bytes, without included files."""
    return hashlib.sha256(file.read_bytes()).hexdigest()[:16]


def read_entry(file: Path) -> FileEntry:
    """Read a file, and return its entry without cases."""
    robot = read_robot(file)
    return FileEntry(
        file=str(file),
        digest=digest_of(file),
        tree=robot.tree is not None,
        dof=0 if robot.tree is None else robot.tree.dof,
        obstacles=tuple(map(str, robot.obstacles)),
        left_out=tuple(sorted({one.what for one in robot.left_out})),
        impossible=tuple(sorted({one.kind for one in impossible_inertias(robot)})),
    )


class FileCheck:
    """The jobs of a file.

    Args:
        file: the model file.
        resolution: of the verdicts.
        floating: whether the root of a URDF moves freely.
        report: called at the end.
        causes: whether differences are diagnosed.
    """

    def __init__(
        self, file: Path, resolution: float, floating: bool, report: Report, *, causes: bool = True
    ) -> None:
        self._file, self._resolution, self._floating = file, resolution, floating
        self._report, self._causes = report, causes
        self._began = time.perf_counter()
        self._pending = 0

    @property
    def job(self) -> Job[FileEntry]:
        """The job that reads the file; its end starts the others."""
        return Job(task=Task(read_entry, self._file), done=self._prepare, failed=self._unread)

    def _unread(self, failure: Failure) -> Jobs:
        self._entry = FileEntry(
            file=str(self._file), digest=digest_of(self._file), tree=False, dof=0,
            obstacles=(f"{self._file}: {failure.reason}",), left_out=(), impossible=(),
        )  # fmt: skip
        return self._end()

    def _prepare(self, entry: FileEntry) -> Jobs:
        self._entry, self._began = entry, time.perf_counter()
        if not entry.tree or not entry.dof or any(STILL in one for one in entry.obstacles):
            return self._end()
        prepare = partial(prepare_tree, floating=self._floating)
        failed = partial(self._failed, "-")
        return iter([Job(task=Task(prepare, self._file), done=self._run, failed=failed)])

    def _run(self, prepared: PreparedTree) -> Jobs:
        available = [engine for engine in engines_reading(self._file.suffix) if not absent(engine)]
        self._pending = len(available)
        for engine in available:
            task = model_task(prepared, engine.name, resolution=self._resolution)
            yield Job(
                task=Task(run_case, task),
                done=partial(self._ran, task),
                failed=partial(self._failed, engine.name),
            )

    def _ran(self, task: TreeTask, case: Case) -> Jobs:
        verdict = case.verdict
        result = EngineResult(
            engine=case.engine,
            outcome=case.outcome,
            discrepancy=None if verdict is None else verdict.largest_discrepancy,
            uncertainty=None if verdict is None else verdict.largest_uncertainty,
            reason=case.reason,
        )
        if case.outcome is not Outcome.DIFFERS or not self._causes:
            return self._add(result)
        return iter([
            Job(
                task=Task(partial(diagnose_robot, is_reference=True), task),
                done=partial(self._explain, result),
                failed=lambda failure: self._add(structs.replace(result, cause=failure.reason)),
            )
        ])  # fmt: skip

    def _explain(self, result: EngineResult, diagnosis: Diagnosis) -> Jobs:
        best = diagnosis.explanations[:1]
        cause = "; ".join(cause_sentences(best[0])) if best else ""
        if not diagnosis.explained:
            cause = f"not explained; best fit: {cause}" if cause else "not explained"
        return self._add(structs.replace(result, cause=diagnosis.failure or cause))

    def _failed(self, engine: str, failure: Failure) -> Jobs:
        return self._add(EngineResult(engine=engine, outcome=Outcome.FAILED, reason=failure.reason))

    def _add(self, result: EngineResult) -> Jobs:
        self._entry = structs.replace(self._entry, cases=(*self._entry.cases, result))
        self._pending -= 1
        return iter(()) if self._pending > 0 else self._end()

    def _end(self) -> Jobs:
        self._report(structs.replace(self._entry, seconds=time.perf_counter() - self._began))
        return iter(())
