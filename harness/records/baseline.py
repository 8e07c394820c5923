"""What was accepted of a case, what is measured of it now, and what a gate found."""

from __future__ import annotations

import msgspec

from physics_crosscheck.harness.records.base import Number, Numbers, Record, Rows
from physics_crosscheck.harness.records.case import CaseId, ModelId
from physics_crosscheck.harness.records.outcome import Outcome

FORMAT = 2
"""Of the baseline's files."""


class Snapshot(Record, frozen=True, kw_only=True):
    """Picked segments of a scenario, K of them, complete in numbers: a later run can repeat them.

    Attributes:
        scenario: its name.
        components: names of the state's 2n components.
        duration: of the whole scenario, seconds.
        inputs: in words, `F = 7*Heaviside(t - 1)`.
        fastest: fastest rate along the motion, rad/s.
        varying: whether an input changes over any segment of the scenario.
        t: start times, (K,), seconds; None where no motion joins the segments.
        length: of each segment, (K,), seconds.
        start: states there, (K, 2n).
        input_nodes: each segment's inputs at Chebyshev points inside it, (nodes, inputs); one row
            where they are constant.
        end: where the equations end each segment, (K, 2n).
        scale: what a defect is relative to, (2n,).
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


class Identified(Record, frozen=True, kw_only=True):
    """A constant as a motion tells it.

    Attributes:
        value: in the constant's unit.
        standard_error: of it.
    """

    value: float
    standard_error: float


class OnAccepted(Record, frozen=True, kw_only=True):
    """Where the segments of the accepted snapshot end now, (K, 2n) each.

    Attributes:
        end, uncertainty: by the model.
        equations: by the equations.
    """

    end: Rows
    uncertainty: Rows
    equations: Rows


class Measurement(Record, frozen=True, kw_only=True):
    """What a case's model does, on a snapshot of its own, and on the accepted one.

    Attributes:
        end, uncertainty: of the model on `snapshot`, (K, 2n).
        constants: that the motion identifies, by name.
        on_accepted: None where nothing comparable was accepted.
        reads: states of what the folder's code read or looked for, by name relative to the folder.
    """

    snapshot: Snapshot
    end: Rows
    uncertainty: Rows
    constants: dict[str, Identified]
    on_accepted: OnAccepted | None
    reads: dict[str, str] = msgspec.field(default_factory=dict)


class AcceptedCase(Record, frozen=True, kw_only=True):
    """What was accepted of a case, or would be.

    Attributes:
        system, model, scenario, engine: which case it is of.
        summary: all of it in one line, for who reviews it.
        reason: why it was accepted.
        outcome: of the case.
        outcome_reason: the sentence for what is not AGREES.
        discrepancy, uncertainty, component, order, claimed_order: as in the case's verdict.
        constants: that the motion identifies, by name.
        global_error, time_step, integrator: as in its full run.
        global_order: of the global error.
        engine_version: the name of the engine with its version.
        resolution: of the run.
        numerics: version of this package's numerics.
        files: hashes of what the case depends on, by name, relative to the system's folder. Of what
            its code looked for elsewhere, a word says what it found: `absent`, `names:HASH`.
        snapshot: key of the snapshot that the ends belong to.
        end: where the model ends its segments, (K, 2n).
        end_uncertainty: of these.
        seal: over all of this, its name included.
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
    seal: str = ""

    @property
    def id(self) -> CaseId:
        """The case's name."""
        return CaseId(
            system=self.system, model=self.model, scenario=self.scenario, engine=self.engine
        )


class AcceptedFinding(Record, frozen=True, kw_only=True):
    """What an audit found wrong, and was accepted.

    Attributes:
        kind: as in `AuditFinding`.
        subject: likewise; what was accepted is known again by kind, subject and numbers.
        message: its sentence, files by their places relative to the system's folder.
        expected, found: the numbers; None where there is none.
    """

    kind: str
    subject: tuple[str, ...]
    message: str
    expected: Number
    found: Number


class AcceptedAudit(Record, frozen=True, kw_only=True):
    """What was accepted of a model that its audit found wrong.

    Attributes:
        system, model, engine: which model it is of.
        reason: why it was accepted.
        findings: all that was found wrong.
        seal: over all of this.
    """

    system: str
    model: str
    engine: str
    reason: str
    findings: tuple[AcceptedFinding, ...]
    seal: str = ""

    @property
    def id(self) -> ModelId:
        """The model's name."""
        return ModelId(system=self.system, model=self.model, engine=self.engine)


class Declared(Record, frozen=True, kw_only=True):
    """What a system declared when its cases were accepted.

    Attributes:
        system: its name.
        folder: relative to the baseline's; `builtin:NAME` for an installed one.
        declared: hash of the declaration.
        scenarios: their names.
        constants: name to value.
        seal: over all of this.
    """

    system: str
    folder: str
    declared: str
    scenarios: tuple[str, ...]
    constants: dict[str, float]
    seal: str = ""


class BaselineFile(Record, frozen=True, kw_only=True):
    """A system's baseline, whole.

    Attributes:
        format: of the file.
        declared: what the system declared.
        cases: what was accepted of each.
        snapshots: those that cases refer to, by key: the scenario's name with a hash of the rest.
        audits: what was accepted though the audit finds it wrong, of the models that have such.
    """

    format: int
    declared: Declared
    cases: tuple[AcceptedCase, ...]
    snapshots: dict[str, Snapshot]
    audits: tuple[AcceptedAudit, ...] = ()


class GateChange(Record, frozen=True, kw_only=True):
    """A case against what was accepted of it.

    Attributes:
        system, model, scenario, engine: the case.
        status: what the gate says of it.
        kinds: what changed, such as `model`, `numbers`, `engine`, `equations`.
        messages: sentences, the most telling first.
        moved: how far a limit moved at most, relative to its movement over a segment.
        run: whether it was run.
    """

    system: str
    model: str
    scenario: str
    engine: str
    status: str
    kinds: tuple[str, ...]
    messages: tuple[str, ...]
    moved: Number
    run: bool


class GateLine(Record, frozen=True, kw_only=True):
    """A changed line of a file.

    Attributes:
        line: counted from 1.
        message: what changed in it.
    """

    line: int
    message: str


class GateFile(Record, frozen=True, kw_only=True):
    """What changed in a file.

    Attributes:
        system: that it belongs to.
        file: its path.
        models: those that it belongs to, or depends on it.
        changes: its lines.
    """

    system: str
    file: str
    models: tuple[str, ...]
    changes: tuple[GateLine, ...]


class Gate(Record, frozen=True, kw_only=True):
    """What a gate found, as gate.json.

    Attributes:
        passes: whether every case does, and there is one.
        seconds: that it took.
        cases: worst first.
        files: what changed in them.
    """

    passes: bool
    seconds: float
    cases: tuple[GateChange, ...]
    files: tuple[GateFile, ...]
