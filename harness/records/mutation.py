"""Deliberate faults in models, and the result of each."""

from enum import StrEnum

from .base import Number, Record


class FaultKind(StrEnum):
    """Kind of change of a model."""

    LITERAL = "literal"
    MISTAKE = "mistake"
    NONE = "no mistake"


class FaultVerdict(StrEnum):
    """Result of a fault.

    `named`; `caught` (the model does not agree) but not named; `refused` by the engine; `untested`,
    since no motion and no frame depends on it (the audit may find it); or `missed`. Without a
    fault: `agrees`.
    """

    NAMED = "named"
    CAUGHT = "caught"
    REFUSED = "refused"
    UNTESTED = "untested"
    MISSED = "missed"
    AGREES = "agrees"


class Mutation(Record, frozen=True, kw_only=True):
    """One deliberate fault in one model in one engine.

    Results for a fault:

    * `named`: the diagnosis named it.
    * `caught`: the model does not agree, but the diagnosis named something else.
    * `refused`: the engine refused the file.
    * `untested`: no motion and no frame depends on it; the audit may still find it.
    * `missed`: the model agrees although the fault changes its motion.
    * `agrees`: the unchanged model agrees.

    Attributes:
        system: Name of the system.
        model: Name of the model file.
        engine: Name of the engine.
        kind: Type of the fault.
        name: Size of the change of a number, or the user mistake.
        location: Address of the number, joint or setting.
        verdict: Result for this fault.
        discrepancy: Largest relative difference.
        message: First cause of the diagnosis, the engine's error, or the global errors before and
            after.
        estimate_error: Error of the estimated fault, relative to the fault; None if not named.
        first_caught: Smallest relative fault, or share of a mistake, that is detected; None if
            never.
        seconds: Processor time, seconds.
    """

    system: str
    model: str
    engine: str
    kind: FaultKind
    name: str
    location: str
    verdict: FaultVerdict
    discrepancy: Number
    message: str
    estimate_error: Number
    first_caught: Number
    seconds: float = 0.0


class Mutations(Record, frozen=True, kw_only=True):
    """All deliberate faults and their results.

    Attributes:
        summary: Summary in one line.
        rows: One entry per fault.
        schema: Version of this format.
    """

    summary: str
    rows: tuple[Mutation, ...]
    schema: int = 1
