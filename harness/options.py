"""What a run may be told: which cases, in which engines, how finely, and what beside verdicts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from harness.files.choice import Choice
from harness.records.baseline import Snapshot
from harness.records.case import CaseId, ModelKey
from harness.schedule.limits import Limits

if TYPE_CHECKING:  # a cache asks the equations, and sympy takes a second
    from harness.cached import Cache


def resolvable(resolution: float) -> bool:
    """Whether double precision can serve a resolution."""
    return 1e-13 <= resolution <= 1e-2


@dataclass(frozen=True)
class Selection:
    """What is wanted of a run that compares: what each case's model does, and not all beside it.

    Attributes:
        models: those to run; None: all.
        snapshots: accepted ones, by case.
        repeated: others, by folder and case: two folders may hold systems of one name.
        diagnose: whether models that differ are diagnosed.
        described: whether linearizations are wanted, and the derivation for a report.
    """

    models: frozenset[ModelKey] | None
    snapshots: Mapping[CaseId, Snapshot] = field(default_factory=dict)
    repeated: Mapping[tuple[str, CaseId], Snapshot] = field(default_factory=dict)
    diagnose: bool = False
    described: bool = False

    def includes(self, model: ModelKey) -> bool:
        """Whether a model is to be run."""
        return self.models is None or model in self.models

    def snapshot(self, folder: str, case: CaseId) -> Snapshot | None:
        """The segments that a case is to repeat, if there are such."""
        return self.repeated.get((folder, case)) or self.snapshots.get(case)


@dataclass(frozen=True)
class Options:
    """What `crosscheck run` may be told.

    `baseline` is where known differences are looked up; `floating` lets the root link of a URDF
    that is given alone move; `model` chooses one of several models of an SDFormat file; `choice`
    tells which cases are wanted; `scheduler` is the address of a cluster's, empty for processes of
    this machine; `cache` has what was found before, where nothing it depends on is another.
    """

    engines: tuple[str, ...] = ()
    resolution: float = 1e-9
    jobs: int = 0
    limits: Limits = field(default_factory=Limits)
    baseline: Path | None = None
    selection: Selection | None = None
    floating: bool = False
    model: str = ""
    choice: Choice = field(default_factory=Choice)
    scheduler: str = ""
    cache: Cache | None = None

    @property
    def described(self) -> bool:
        """Whether linearizations are wanted, and the derivation for a report."""
        return self.selection is None or self.selection.described

    @property
    def diagnosed(self) -> bool:
        """Whether models that differ are."""
        return self.selection is None or self.selection.diagnose
