"""Models made wrong on purpose, and what became of each fault."""

from __future__ import annotations

from enum import StrEnum

from physics_crosscheck.harness.records.base import Number, Record


class FaultKind(StrEnum):
    """What was done to a model."""

    LITERAL = "literal"
    MISTAKE = "mistake"
    NONE = "no mistake"


class FaultVerdict(StrEnum):
    """What became of it.

    `named`; `caught` (the model does not agree) but not named; `refused` by the engine; `untested`,
    since no motion and no frame depends on it (the audit may see it); or `missed`. Of no mistake:
    `agrees`.
    """

    NAMED = "named"
    CAUGHT = "caught"
    REFUSED = "refused"
    UNTESTED = "untested"
    MISSED = "missed"
    AGREES = "agrees"


class Mutation(Record, frozen=True, kw_only=True):
    """One fault in one model in one engine.

    Attributes:
        system, model, engine: what was made wrong.
        kind: what was done to it.
        name: by how much a literal was changed, otherwise what the user did.
        location: the literal's address, the joint or the setting.
        verdict: what became of it.
        discrepancy: largest defect, relative.
        message: the first cause of the diagnosis, the engine's refusal, or the global errors before
            and after.
        estimate_error: error of the estimated fault, relative to the fault; None where not named.
        first_caught: for a literal, the relative fault at which it is first seen; for a mistake,
            the share of it; None: never.
        seconds: processor time that it took.
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
    """All that was made wrong.

    Attributes:
        summary: one line.
        rows: a fault each.
        schema: version of this format.
    """

    summary: str
    rows: tuple[Mutation, ...]
    schema: int = 1
