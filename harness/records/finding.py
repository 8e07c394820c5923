"""What is found wrong with a model: by reading it (audit), and from its motions (diagnosis)."""

from __future__ import annotations

import math
from typing import Literal

from physics_crosscheck.harness.records.base import Number, Numbers, Record, Rows, SourceLine
from physics_crosscheck.harness.records.cause import Cause, CauseId

BEYOND = "reach"
"""Kind of a note on a stop or an obstacle that no motion reaches: what it does is not checked."""


SAME = 1e-6
"""Computed numbers this close, relative to each other, are of the same finding: another machine or
engine rounds otherwise."""


def is_near(one: Number, other: Number, tolerance: float) -> bool:
    """Return whether two numbers are equal to a relative tolerance, or both are missing."""
    if one is None or other is None:
        return one is other
    return math.isclose(one, other, rel_tol=tolerance)


class AuditFinding(Record, frozen=True, kw_only=True):
    """Something that the audit has to say.

    Attributes:
        kind: `literal`, a compiled term such as `inertia`, `pose`, `default`, or `reach` for a stop
            or an obstacle that no motion reaches.
        subject: what it is about, as of a cause: the address of a literal, coordinates, frames, a
            link, or what an engine does on its own. Two findings of one kind and subject are the
            same finding, perhaps with other numbers.
        message: one sentence.
        location: None where it stands in no line.
        expected, found: the numbers; None where there is none.
        replacement: what to write in the span of `location`; empty where no number is to change.
        severity: a `finding` is wrong, a `note` is worth knowing.
    """

    kind: str
    subject: tuple[str, ...]
    message: str
    location: SourceLine | None
    expected: Number
    found: Number
    replacement: str = ""
    severity: Literal["finding", "note"]

    def is_like(self, other: AuditFinding, tolerance: float) -> bool:
        """Return whether another finding is this one, of the same file, by fields and not by words.

        Args:
            other: of another engine, version or run.
            tolerance: by how much the numbers may differ, relative to the larger.
        """
        mine = self.kind, self.severity, self.subject, self.location
        theirs = other.kind, other.severity, other.subject, other.location
        return mine == theirs and all(
            is_near(one, two, tolerance)
            for one, two in ((self.expected, other.expected), (self.found, other.found))
        )


class Explanation(Record, frozen=True, kw_only=True):
    """One cause, or two together, with what is left of the discrepancy.

    Attributes:
        causes: one, or a pair.
        remaining: share of the discrepancy left.
        tied_with: causes that no motion of these scenarios tells from this one.
    """

    causes: tuple[Cause, ...]
    remaining: float
    tied_with: tuple[CauseId, ...] = ()


class CorrectedScenario(Record, frozen=True, kw_only=True):
    """One scenario with the estimates put in; a row a component.

    Attributes:
        scenario: its name.
        t: seconds.
        corrected: the motion.
        segment_t: starts of the segments that the diagnosis stands on, seconds.
        before: their defects, as in a case's series.
        after: the same with the estimates.
    """

    scenario: str
    t: Numbers
    corrected: Rows
    segment_t: Numbers
    before: Rows
    after: Rows


class CorrectedMotion(Record, frozen=True, kw_only=True):
    """The motion with the values that were found.

    Attributes:
        causes: those put in.
        put_into: the `equations`, solved again; or the `file`, run again at its step.
        scenarios: each with its motion.
    """

    causes: tuple[Cause, ...]
    put_into: Literal["equations", "file"]
    scenarios: tuple[CorrectedScenario, ...]


class Diagnosis(Record, frozen=True, kw_only=True):
    """What explains a model's discrepancy.

    Attributes:
        explained: whether the first explanation leaves no more than the uncertainty, or 0.3 %.
        explanations: ranked, best first.
        floor: share of the discrepancy that the uncertainty makes; None without a ranking.
        corrected: None where the cause can't be put in, or nothing is explained.
        failure: why there is no ranking; empty where there is one.
        seconds: that it took.
    """

    explained: bool = False
    explanations: tuple[Explanation, ...] = ()
    floor: Number = None
    corrected: CorrectedMotion | None = None
    failure: str = ""
    seconds: float = 0.0
