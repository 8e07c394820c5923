"""What the jobs of a run bring together; and what of it is kept, should the run be ended."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypedDict, Unpack

from msgspec.structs import replace

from physics_crosscheck.harness.jobs.graph import Job
from physics_crosscheck.harness.jobs.stop import Stop
from physics_crosscheck.harness.jobs.workers import Failure
from physics_crosscheck.harness.records.baseline import Measurement
from physics_crosscheck.harness.records.case import Case, CaseId, ModelKey
from physics_crosscheck.harness.records.coverage import Coverage
from physics_crosscheck.harness.records.finding import AuditFinding, Diagnosis
from physics_crosscheck.harness.records.journal import Journal, Work
from physics_crosscheck.harness.records.model import EngineLinearization, Model
from physics_crosscheck.harness.records.poses import Poses
from physics_crosscheck.harness.records.system import System

Jobs = Iterable[Job[Any]]

Progress = Callable[[int, int, Case | None], None]
"""Called with (cases done, cases known, the case just done or None)."""


@dataclass(frozen=True)
class Interruption:
    """How a run may be ended, and gone on with: `stop` asks, `journal` keeps what is done."""

    stop: Stop | None = None
    journal: Journal | None = None


class _Found(TypedDict, total=False):
    """Fields of a model's record that a job brings."""

    linearizations: tuple[EngineLinearization, ...]
    linearization_failure: str
    audit: tuple[AuditFinding, ...]
    audit_failure: str
    poses: Poses
    coverage: Coverage
    diagnosis: Diagnosis


class Collected:
    """What the jobs of a run have brought so far, in the order in which they ended.

    Attributes:
        systems: prepared.
        models: those that are run.
        cases: done, or not to be run.
        measured: what models do, or why it is not known, by folder and case.
        left: what is still to be done: cases, and folders as their `system.py`, by folder.
        cached: how many cases were had from earlier runs.
        reads: states of what each place's code has read, by name relative to it.
    """

    def __init__(self, progress: Progress, journal: Journal | None = None) -> None:
        self.systems: list[System] = []
        self.models: dict[ModelKey, Model] = {}
        self.cases: list[Case] = []
        self.measured: dict[tuple[str, CaseId], Measurement | Failure] = {}
        self.left: dict[tuple[str, CaseId], None] = {}
        self.cached = 0
        self.reads: dict[str, Mapping[str, str]] = {}
        self._progress, self._journal = progress, journal

    @property
    def keeps(self) -> bool:
        """Whether anything is kept, should the run be ended."""
        return self._journal is not None

    def expect(self, folder: str, cases: Iterable[CaseId]) -> None:
        """These are known of; or a folder is, by its `system.py`, until its cases are."""
        self.left.pop((folder, stand_in(Path(folder))), None)
        self.left |= dict.fromkeys((folder, case) for case in cases)

    def add(self, case: Case) -> None:
        """A case is done."""
        self.left.pop((case.folder, case.id), None)
        self.cases.append(case)
        self._progress(len(self.cases), len(self.cases) + len(self.left), case)

    def known(self, work: Work) -> Any | None:
        """What came of a piece of work, if the journal has it."""
        return None if self._journal is None else self._journal.kept.get(work)

    def keep(self, work: Work, value: Any) -> None:
        """What came of a piece of work goes to the journal, if there is one."""
        if self._journal is not None:
            self._journal.keep(work, value)

    def forget(self, folder: str) -> None:
        """Nothing more is to come of a folder."""
        self.left = {one: None for one in self.left if one[0] != folder}

    def amend(self, key: ModelKey, **fields: Unpack[_Found]) -> None:
        """Put what was found of a model into its record."""
        self.models[key] = replace(self.models[key], **fields)


def stand_in(folder: Path) -> CaseId:
    """What stands for all cases of a folder while they are not known."""
    return CaseId(system=folder.name, model="system.py", scenario="-", engine="-")
