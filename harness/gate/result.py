"""What a gate found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import msgspec

from physics_crosscheck.harness.baseline.changes import Status
from physics_crosscheck.harness.baseline.classify import Change
from physics_crosscheck.harness.baseline.file import SystemBaseline
from physics_crosscheck.harness.baseline.fingerprint import FolderFiles
from physics_crosscheck.harness.gate.file_diffs import FileDiff
from physics_crosscheck.harness.records.base import number
from physics_crosscheck.harness.records.baseline import Gate, GateChange, GateFile, GateLine
from physics_crosscheck.harness.records.case import Case, ModelId
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.results import Results


@dataclass(frozen=True, kw_only=True)
class GateResult:
    """What a gate found.

    Attributes:
        changes: a `Change` for every case, worst first.
        file_diffs: what changed in the files, a model or declaration each.
        results: of what was run, without what a report needs; None where nothing was.
        folders: hashes of every folder and robot file given, by name of its system.
        baseline: what was accepted, by name of the system.
        seconds: how long it took.
    """

    changes: tuple[Change, ...]
    file_diffs: tuple[FileDiff, ...]
    results: Results | None = field(repr=False)
    folders: Mapping[str, FolderFiles] = field(repr=False)
    baseline: Mapping[str, SystemBaseline] = field(repr=False)
    seconds: float

    @property
    def passes(self) -> bool:
        """Whether every case passes, and there is one at all, and nothing beside them failed."""
        passes = all(change.status.passes for change in self.changes)
        return bool(self.changes) and passes and not self.failures

    @property
    def failures(self) -> tuple[str, ...]:
        """What could not be done beside the cases, a sentence each; of audits the cases tell."""
        models = self.results.models if self.results else ()
        return tuple(
            f"{what} of {self.id_of(m)}: {why}"
            for m in models
            for what, why in m.failures
            if what != "audit"
        )

    def of(self, *statuses: Status) -> tuple[Change, ...]:
        """The changes of some statuses."""
        return tuple(change for change in self.changes if change.status in statuses)

    def model_of(self, case: Case) -> Model | None:
        """The record of a case's model, where it was run."""
        return None if self.results is None else self.results.model_of(case)

    def id_of(self, model: Model) -> ModelId:
        """Return the name of a model in the baseline, which calls a robot file by its path."""
        names = {str(scan.folder): name for name, scan in self.folders.items()}
        return msgspec.structs.replace(model.id, system=names.get(model.folder, model.system))

    def record(self) -> Gate:
        """The findings for other programs."""
        return Gate(
            passes=self.passes,
            seconds=self.seconds,
            cases=tuple(_case(change) for change in self.changes),
            files=tuple(_file(one) for one in self.file_diffs),
        )


def _case(change: Change) -> GateChange:
    return GateChange(
        system=change.id.system,
        model=change.id.model,
        scenario=change.id.scenario,
        engine=change.id.engine,
        status=change.status.value,
        kinds=change.kinds,
        messages=change.messages,
        moved=number(change.size),
        run=change.case is not None,
    )


def _file(one: FileDiff) -> GateFile:
    return GateFile(
        system=one.system,
        file=one.name,
        models=one.models,
        changes=tuple(GateLine(line=each.line, message=each.message) for each in one.lines),
    )
