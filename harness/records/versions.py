"""The same models under several versions of an engine: the task of each, and the changes."""

from __future__ import annotations

from typing import Literal

from physics_crosscheck.harness.records.base import Record
from physics_crosscheck.harness.records.baseline import Measurement, Snapshot
from physics_crosscheck.harness.records.case import Case, CaseId, ModelId
from physics_crosscheck.harness.records.diff import Diff
from physics_crosscheck.harness.records.model import Model

ModelChange = Literal["fails", "loads", "linearization", "remark gained", "remark lost"]
"""Kind of change of a model besides its cases."""


class Repeated(Record, frozen=True, kw_only=True):
    """Segments that a case must repeat.

    Attributes:
        folder: Folder of the case.
        case: Name of the case.
        snapshot: The segments.
    """

    folder: str
    case: CaseId
    snapshot: Snapshot


class VersionTask(Record, frozen=True, kw_only=True):
    """The work for one version, done in a process of its own.

    Attributes:
        engine: Name of the engine.
        version: Installed version; empty before one is chosen.
        folders: System folders.
        robots: Standalone robot files.
        resolution: Requested resolution: the smallest relative difference that counts.
        jobs: Number of worker processes; 0 for one per processor.
        seconds: Time limit of a task, seconds.
        memory: Memory limit of a task.
        floating: Whether the root link of a standalone URDF moves freely.
        diagnose: Whether to diagnose models that differ.
        repeated: Segments that another version was measured on.
        out: Folder for results.json and the report.
    """

    engine: str
    version: str = ""
    folders: tuple[str, ...]
    robots: tuple[str, ...]
    resolution: float
    jobs: int
    seconds: float
    memory: float
    floating: bool
    diagnose: bool
    repeated: tuple[Repeated, ...] = ()
    out: str


class Measured(Record, frozen=True, kw_only=True):
    """The motion of a case's model under one version.

    Attributes:
        folder: Folder of the case.
        case: Name of the case.
        measurement: The measurement; None if it failed.
        failure: Reason if it failed; empty otherwise.
    """

    folder: str
    case: CaseId
    measurement: Measurement | None
    failure: str = ""


class VersionRun(Record, frozen=True, kw_only=True):
    """The results of one version.

    Attributes:
        version: Version that the engine reports.
        cases: All cases.
        models: All models that ran.
        measured: Motions of the models.
    """

    version: str
    cases: tuple[Case, ...]
    models: tuple[Model, ...]
    measured: tuple[Measured, ...]


class VersionModel(Record, frozen=True, kw_only=True):
    """One model under two versions.

    Attributes:
        system: Name of the system.
        model: Name of the model file.
        engine: Name of the engine.
        folder: System folder; the file itself for a standalone robot file.
        kinds: Types of change: loading, a failed check, a linearization, or an audit remark.
        messages: Explanations, one sentence each.
    """

    system: str
    model: str
    engine: str
    folder: str
    kinds: tuple[ModelChange, ...]
    messages: tuple[str, ...]

    @property
    def id(self) -> ModelId:
        """Name of the model."""
        return ModelId(system=self.system, model=self.model, engine=self.engine)


class Upgrade(Record, frozen=True, kw_only=True):
    """Changes from one version to the next.

    Attributes:
        before: Older version.
        after: Newer version.
        cases: All cases, worst first.
        models: Models that change.
    """

    before: str
    after: str
    cases: tuple[Diff, ...]
    models: tuple[VersionModel, ...]

    @property
    def changed(self) -> tuple[Diff, ...]:
        """Cases that change."""
        return tuple(case for case in self.cases if case.is_change)

    @property
    def not_compared(self) -> tuple[Diff, ...]:
        """Cases that could not be compared."""
        return tuple(case for case in self.cases if not case.is_compared)

    @property
    def same(self) -> tuple[Diff, ...]:
        """Cases that do not change."""
        return tuple(case for case in self.cases if case.is_compared and not case.is_change)


class EngineVersion(Record, frozen=True, kw_only=True):
    """A version that ran.

    Attributes:
        version: Version of the engine.
        python: Python interpreter of its environment.
        report: Folder of its results.json and index.html.
    """

    version: str
    python: str
    report: str


class Versions(Record, frozen=True, kw_only=True):
    """Changes that upgrades of an engine cause.

    Attributes:
        created: Time of the run, UTC, ISO 8601.
        engine: Name of the engine.
        resolution: Requested resolution: the smallest relative difference that counts.
        seconds: Duration, wall-clock seconds.
        versions: Versions, in the requested order.
        upgrades: Changes from each version to the next.
        left_out: Named targets that do not run in this engine, one sentence each.
    """

    created: str
    engine: str
    resolution: float
    seconds: float
    versions: tuple[EngineVersion, ...]
    upgrades: tuple[Upgrade, ...]
    left_out: tuple[str, ...] = ()

    @property
    def changed(self) -> bool:
        """True if anything changes."""
        return any(one.changed or one.models for one in self.upgrades)

    @property
    def incomplete(self) -> bool:
        """True if a case could not be compared, or there was nothing to compare."""
        return any(one.not_compared or not one.cases for one in self.upgrades)
