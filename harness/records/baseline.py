"""Accepted results, present measurements of cases, and results of a gate."""

from pathlib import Path

import msgspec

from .base import Number, Numbers, Record, Rows, record_of
from .case import CaseId, ModelId
from .diff import CaseNumbers, Diff
from .outcome import Outcome

FORMAT = 2
"""Format version of the baseline's files."""


LawNumber = float | int | bool | str
"""A number or a word of a law."""


class StepEnds(Record, frozen=True, kw_only=True):
    """An engine's whole steps from S states, shape (S, C) each.

    Attributes:
        values: Accelerations, and the next state if its rule is known.
        uncertainty: Uncertainty of `values`: rounding and the solver's error.
    """

    values: Rows
    uncertainty: Rows


class WholeSteps(Record, frozen=True, kw_only=True):
    """Whole steps of a robot file, with limits, friction, contacts and drives.

    Attributes:
        coordinates: Names of the engine's coordinates.
        components: Names of the C compared components.
        controls: Number of inputs.
        states: Positions, velocities, controls and states of drives, shape (S, N).
        scale: Scale of the relative differences, shape (C,).
        ends: The engine's steps from these states.
        laws: Compiled numbers of the laws, by name.
    """

    coordinates: tuple[str, ...]
    components: tuple[str, ...]
    controls: int
    states: Rows
    scale: Numbers
    ends: StepEnds
    laws: dict[str, LawNumber]


class Snapshot(Record, frozen=True, kw_only=True, omit_defaults=True):
    """K segments of a scenario with all numbers, so that a later run can repeat them.

    Attributes:
        scenario: Name of the scenario.
        components: Names of the 2n state components.
        duration: Duration of the whole scenario, seconds.
        inputs: Inputs as text, such as `F = 7*Heaviside(t - 1)`.
        fastest: Fastest rate along the motion, rad/s.
        varying: Whether an input changes within any segment.
        t: Start times, shape (K,), seconds; None for separate random states.
        length: Length of each segment, shape (K,), seconds.
        start: Start states, shape (K, 2n).
        input_nodes: Inputs of each segment at Chebyshev points, shape (nodes, inputs); one row for
            constant inputs.
        end: End states by the equations, shape (K, 2n).
        scale: Scale of the relative differences, shape (2n,).
        events: Times of impacts and of other changes of the equations, seconds.
        steps: Whole steps of a robot file; stored with each case.
    """

    scenario: str
    components: tuple[str, ...]
    duration: float
    inputs: tuple[str, ...]
    fastest: float
    varying: bool
    t: Numbers
    length: tuple[float, ...]
    start: tuple[tuple[float, ...], ...]
    input_nodes: tuple[tuple[tuple[float, ...], ...], ...]
    end: tuple[tuple[float, ...], ...]
    scale: tuple[float, ...]
    events: tuple[float, ...] = ()
    steps: WholeSteps | None = None


class Identified(Record, frozen=True, kw_only=True):
    """A constant estimated from a motion.

    Attributes:
        value: Estimate in the constant's unit.
        standard_error: Standard error of the estimate.
    """

    value: float
    standard_error: float


class OnAccepted(Record, frozen=True, kw_only=True):
    """Present end states of the accepted segments, shape (K, 2n) each.

    Attributes:
        end: End states of the model.
        uncertainty: Uncertainty of `end`.
        equations: End states by the equations.
        steps: Whole steps from the accepted states; None if nothing comparable was accepted.
    """

    end: Rows
    uncertainty: Rows
    equations: Rows
    steps: StepEnds | None = None


class Measurement(Record, frozen=True, kw_only=True):
    """Motion of a case's model on its own segments and on the accepted ones.

    Attributes:
        snapshot: The segments.
        end: End states of the model, shape (K, 2n).
        uncertainty: Uncertainty of `end`, shape (K, 2n).
        constants: Constants that the motion identifies.
        on_accepted: Result on the accepted segments; None if nothing comparable was accepted.
        reads: State of each path that the folder's code read or looked for.
        time_step: Time step of a robot file, seconds; None for a folder.
        integrator: Name of its integrator.
        steps: Its whole steps; None without a law.
    """

    snapshot: Snapshot
    end: Rows
    uncertainty: Rows
    constants: dict[str, Identified]
    on_accepted: OnAccepted | None
    reads: dict[str, str] = msgspec.field(default_factory=dict)
    time_step: Number = None
    integrator: str = ""
    steps: WholeSteps | None = None


class AcceptedCase(Record, frozen=True, kw_only=True):
    """The accepted result of a case.

    Attributes:
        system: Name of the system.
        model: Name of the model file.
        scenario: Name of the scenario.
        engine: Name of the engine.
        summary: One line for the reviewer.
        reason: Reason for accepting.
        outcome: Accepted outcome.
        outcome_reason: Explanation of an outcome other than AGREES.
        discrepancy: Discrepancy of the verdict.
        uncertainty: Uncertainty of the verdict.
        component: Deciding component of the verdict.
        constants: Constants that the motion identifies.
        global_error: Largest position error at `time_step`, relative to the amplitude.
        global_order: Order of the global error.
        time_step: Time step of the model, seconds.
        integrator: Name of the integrator.
        order: Observed order of the verdict.
        claimed_order: Order that the engine claims.
        engine_version: Name and version of the engine.
        resolution: Resolution of the run.
        numerics: Version of this package's numerical methods.
        files: Hashes of all inputs, by path; `unknown` outside the folder.
        snapshot: Key of the snapshot for `end`; empty if the engine refuses the file.
        end: End states of the model, shape (K, 2n).
        end_uncertainty: Uncertainty of `end`.
        steps: Whole steps of a robot file that has a law.
        content: Hashes of a robot's files by path, without comments, format and colors.
        seal: Hash of this entry.
    """

    system: str
    model: str
    scenario: str
    engine: str
    summary: str
    reason: str
    outcome: Outcome
    outcome_reason: str
    discrepancy: Number
    uncertainty: Number
    component: str
    constants: dict[str, Identified]
    global_error: Number
    global_order: Number
    time_step: Number
    integrator: str
    order: Number
    claimed_order: int
    engine_version: str
    resolution: float
    numerics: int
    files: dict[str, str]
    snapshot: str
    end: Rows
    end_uncertainty: Rows
    steps: WholeSteps | msgspec.UnsetType = msgspec.UNSET
    content: dict[str, str] | msgspec.UnsetType = msgspec.UNSET
    seal: str = ""

    @property
    def id(self) -> CaseId:
        """Name of the case."""
        return CaseId(
            system=self.system, model=self.model, scenario=self.scenario, engine=self.engine
        )

    @property
    def numbers(self) -> CaseNumbers:
        """Numbers that a later run is compared with."""
        return record_of(CaseNumbers, self, reason=self.outcome_reason, digits=None)


class AcceptedFinding(Record, frozen=True, kw_only=True):
    """An accepted finding of an audit.

    Attributes:
        kind: Type of the finding, as in `AuditFinding`.
        subject: Affected objects. Kind, subject and numbers identify the finding.
        message: Explanation, with paths relative to the system folder.
        expected: Expected number; None without one.
        actual: Number in the model; None without one.
    """

    kind: str
    subject: tuple[str, ...]
    message: str
    expected: Number
    actual: Number


class AcceptedAudit(Record, frozen=True, kw_only=True):
    """Accepted findings of one model.

    Attributes:
        system: Name of the system.
        model: Name of the model file.
        engine: Name of the engine.
        reason: Reason for accepting.
        findings: All accepted findings.
        seal: Hash of this entry.
    """

    system: str
    model: str
    engine: str
    reason: str
    findings: tuple[AcceptedFinding, ...]
    seal: str = ""

    @property
    def id(self) -> ModelId:
        """Name of the model."""
        return ModelId(system=self.system, model=self.model, engine=self.engine)


class RobotOptions(Record, frozen=True, kw_only=True):
    """Options with which a robot file is read.

    Attributes:
        floating: Whether the root link of a URDF moves.
        model: Model to read from an SDFormat file; empty for the only movable one.
    """

    floating: bool | None = None
    model: str = ""


class AcceptedDeclaration(Record, frozen=True, kw_only=True):
    """The declaration of a system when its cases were accepted.

    Attributes:
        system: Name of the system; the path of a robot file.
        folder: Path relative to the baseline; `builtin:NAME` for an installed system.
        declared: Hash of the declaration; empty for a robot file.
        scenarios: Names of the scenarios.
        constants: Values of the constants.
        robot: Options with which a robot file is read; a system folder has none.
        seal: Hash of this entry.
    """

    system: str
    folder: str
    declared: str
    scenarios: tuple[str, ...]
    constants: dict[str, float]
    robot: RobotOptions | msgspec.UnsetType = msgspec.UNSET
    seal: str = ""


class BaselineFile(Record, frozen=True, kw_only=True):
    """The baseline of one system.

    Attributes:
        format: Version of this format.
        declared: Declaration of the system.
        cases: Accepted cases.
        snapshots: Segments that the cases refer to. The key is the scenario's name and a hash.
        audits: Accepted findings of audits.
    """

    format: int
    declared: AcceptedDeclaration
    cases: tuple[AcceptedCase, ...]
    snapshots: dict[str, Snapshot]
    audits: tuple[AcceptedAudit, ...] = ()


class ChangedLine(Record, frozen=True, kw_only=True):
    """A changed line of a file.

    Attributes:
        line: Line number, counted from 1.
        message: Description of the change.
        edit: The same in a few words, such as `damping 0.05 -> 0.06`; empty for a whole file.
        old: The accepted number; empty if more than a number changed.
    """

    line: int
    message: str
    edit: str = ""
    old: str = ""


class FileDiff(Record, frozen=True, kw_only=True):
    """Changes of one file.

    Attributes:
        system: Name of the system.
        file: Path of the file, relative to the system folder.
        path: Path of the file or folder to which the lines belong.
        models: Models that depend on the file.
        changes: Changed numbers first, then other changed lines.
        more: Number of changed lines that are not listed.
    """

    system: str
    file: str
    path: str
    models: tuple[str, ...]
    changes: tuple[ChangedLine, ...]
    more: int = 0

    @property
    def is_outside(self) -> bool:
        """True if the file is outside of the system's folder."""
        return self.file.startswith("../") or Path(self.file).is_absolute()

    def concerns(self, case: CaseId) -> bool:
        """Return whether a case depends on the file."""
        return case.system == self.system and case.model in self.models


class Gate(Record, frozen=True, kw_only=True):
    """The result of a gate.

    Attributes:
        passes: Whether there are cases and all pass.
        seconds: Duration, seconds.
        cases: Cases, worst first.
        files: Changed files.
    """

    passes: bool
    seconds: float
    cases: tuple[Diff, ...]
    files: tuple[FileDiff, ...]
