"""Result of the gate."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import msgspec

from physics_crosscheck.harness.baseline.classify import Change
from physics_crosscheck.harness.baseline.file import SystemBaseline
from physics_crosscheck.harness.baseline.fingerprint import FolderFiles
from physics_crosscheck.harness.records.baseline import FileDiff, Gate
from physics_crosscheck.harness.records.case import Case, ModelId
from physics_crosscheck.harness.records.diff import Status
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.results import Results


@dataclass(frozen=True, kw_only=True)
class GateResult:
    """The result of the gate.

    Attributes:
        changes: a `Change` for every case, worst first.
        file_diffs: changes in the files, one for each model or declaration.
        results: results of the run without the data of a report; None if nothing was run.
        folders: hashes of every given folder and robot file, by name of the system.
        baseline: accepted results, by name of the system.
        seconds: duration.
    """

    changes: tuple[Change, ...]
    file_diffs: tuple[FileDiff, ...]
    results: Results | None = field(repr=False)
    folders: Mapping[str, FolderFiles] = field(repr=False)
    baseline: Mapping[str, SystemBaseline] = field(repr=False)
    seconds: float

    @property
    def passes(self) -> bool:
        """True if there are cases, all of them pass, and nothing else failed."""
        return bool(self.changes) and not self.failing and not self.failures

    @property
    def is_incomplete(self) -> bool:
        """True if there is no case, one could not run, or another check failed."""
        return bool(not self.changes or self.with_status(Status.NOT_RUN) or self.failures)

    @property
    def failing(self) -> tuple[Change, ...]:
        """The changes that do not pass, worst first."""
        return tuple(change for change in self.changes if not change.status.passes)

    @property
    def failures(self) -> tuple[str, ...]:
        """Failures besides the cases, a sentence each; the cases report those of audits."""
        models = self.results.models if self.results else ()
        return tuple(
            f"{what} of {self.id_of(m)}: {why}"
            for m in models
            for what, why in m.failures
            if what != "audit"
        )

    def with_status(self, *statuses: Status) -> tuple[Change, ...]:
        """Return the changes with one of the given statuses."""
        return tuple(change for change in self.changes if change.status in statuses)

    def model_of(self, case: Case) -> Model | None:
        """Return the record of a case's model, if it was run."""
        return None if self.results is None else self.results.model_of(case)

    def id_of(self, model: Model) -> ModelId:
        """Return the name of a model in the baseline, which names a robot file by its path."""
        names = {str(scan.folder): name for name, scan in self.folders.items()}
        return msgspec.structs.replace(model.id, system=names.get(model.folder, model.system))

    def record(self) -> Gate:
        """Return the record for other programs."""
        return Gate(
            passes=self.passes,
            seconds=self.seconds,
            cases=tuple(change.diff for change in self.changes),
            files=self.file_diffs,
        )
