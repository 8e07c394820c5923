"""The same models under several versions of an engine: what is asked of each, and what changes."""

from __future__ import annotations

from typing import Literal

from physics_crosscheck.harness.records.base import Number, Record
from physics_crosscheck.harness.records.baseline import Measurement, Snapshot
from physics_crosscheck.harness.records.case import Case, CaseId, ModelId
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome

CaseChange = Literal[
    "not compared", "fails", "loads", "verdict", "limit", "equations", "discrepancy",
    "step cost", "next state",
]  # fmt: skip
"""What becomes of a case from one version to the next; the worst first."""

ModelChange = Literal["fails", "loads", "linearization", "remark gained", "remark lost"]
"""What becomes of a model beside its cases."""


class Repeated(Record, frozen=True, kw_only=True):
    """Segments that a case is to repeat.

    Attributes:
        folder: of the case.
        case: its name.
        snapshot: the segments.
    """

    folder: str
    case: CaseId
    snapshot: Snapshot


class VersionTask(Record, frozen=True, kw_only=True):
    """What is asked of one version, in a process of its own.

    Attributes:
        engine: its name.
        version: that is there.
        folders, robots: system folders, and robots' files alone.
        resolution: relative discrepancy to resolve.
        jobs: worker processes; 0: one a processor.
        seconds, memory: limits of a task.
        floating: whether the root link of a URDF alone moves freely.
        diagnose: whether models that differ are diagnosed.
        repeated: segments that another version was measured on.
        out: folder for results.json and the report.
    """

    engine: str
    version: str
    folders: tuple[str, ...]
    robots: tuple[str, ...]
    resolution: float
    jobs: int
    seconds: float
    memory: float
    floating: bool
    diagnose: bool
    repeated: tuple[Repeated, ...]
    out: str


class Measured(Record, frozen=True, kw_only=True):
    """What a case's model does under a version.

    Attributes:
        folder: of the case.
        case: its name.
        measurement: None where there is none.
        failure: why; empty where there is one.
    """

    folder: str
    case: CaseId
    measurement: Measurement | None
    failure: str = ""


class VersionRun(Record, frozen=True, kw_only=True):
    """What a version did.

    Attributes:
        version: of the engine, as it says itself.
        cases: all of them.
        models: those that were run.
        measured: what their models do.
    """

    version: str
    cases: tuple[Case, ...]
    models: tuple[Model, ...]
    measured: tuple[Measured, ...]


class VersionCase(Record, frozen=True, kw_only=True):
    """A case under two versions.

    Attributes:
        system, model, scenario, engine: the case.
        folder: of the system; of a robot checked alone its file.
        kinds: what changes; empty: nothing. `loads` and `fails`: under one version alone it can't
            be run; `limit`: extrapolated motions are apart by more than both uncertainties;
            `equations`: so are the equations', of a file that the engine compiles; `discrepancy`:
            the verdict's is another at other segments; `step cost`: global
            error, order, step or integrator; `next state`: that step is another outcome.
        messages: sentences, the most telling first.
        before, after: outcomes; None: there is no such case.
        apart: largest distance of the two limits, relative to the movement over a segment; None
            where they can't be compared.
        uncertainty: of the two together, there.
        global_error_before, global_error_after: at the shipped step, relative to the amplitude.
    """

    system: str
    model: str
    scenario: str
    engine: str
    folder: str
    kinds: tuple[CaseChange, ...] = ()
    messages: tuple[str, ...] = ()
    before: Outcome | None
    after: Outcome | None
    apart: Number = None
    uncertainty: Number = None
    global_error_before: Number = None
    global_error_after: Number = None

    @property
    def id(self) -> CaseId:
        """Its name."""
        return CaseId(
            system=self.system, model=self.model, scenario=self.scenario, engine=self.engine
        )

    @property
    def compared(self) -> bool:
        """Whether anything is known of it under both versions, or it runs under one alone."""
        return "not compared" not in self.kinds


class VersionModel(Record, frozen=True, kw_only=True):
    """A model under two versions, beside its cases.

    Attributes:
        system, model, engine: the model.
        folder: of the system; of a robot checked alone its file.
        kinds: what changes: a part of its check that fails under one version, a linearization, or a
            remark of the audit.
        messages: a sentence each.
    """

    system: str
    model: str
    engine: str
    folder: str
    kinds: tuple[ModelChange, ...]
    messages: tuple[str, ...]

    @property
    def id(self) -> ModelId:
        """Its name."""
        return ModelId(system=self.system, model=self.model, engine=self.engine)


class Upgrade(Record, frozen=True, kw_only=True):
    """From one version to the next that was asked for.

    Attributes:
        before, after: the versions.
        cases: all, worst first.
        models: those of which something changes.
    """

    before: str
    after: str
    cases: tuple[VersionCase, ...]
    models: tuple[VersionModel, ...]

    @property
    def changed(self) -> tuple[VersionCase, ...]:
        """The cases of which something changes."""
        return tuple(case for case in self.cases if case.kinds and case.compared)

    @property
    def not_compared(self) -> tuple[VersionCase, ...]:
        """Those of which nothing can be said."""
        return tuple(case for case in self.cases if not case.compared)

    @property
    def same(self) -> tuple[VersionCase, ...]:
        """Those of which nothing changes."""
        return tuple(case for case in self.cases if not case.kinds)


class EngineVersion(Record, frozen=True, kw_only=True):
    """A version that was run.

    Attributes:
        version: of the engine.
        python: the interpreter of its environment.
        report: folder of its results.json and index.html.
    """

    version: str
    python: str
    report: str


class Versions(Record, frozen=True, kw_only=True):
    """What upgrades of an engine change in some models.

    Attributes:
        created: UTC, ISO 8601.
        engine: its name.
        resolution: relative discrepancy that was to be resolved.
        seconds: that it took, of wall-clock time.
        versions: in the order asked for.
        upgrades: from each to the next.
        left_out: what was named and does not run in the engine, a sentence each.
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
        """Whether anything does."""
        return any(one.changed or one.models for one in self.upgrades)

    @property
    def incomplete(self) -> bool:
        """Whether anything could not be compared, or there was nothing to compare."""
        return any(one.not_compared or not one.cases for one in self.upgrades)
