"""Problems of a model: audit findings, and diagnosed causes of its motions."""

from __future__ import annotations

import math
from typing import Literal

import msgspec

from .base import Number, Numbers, Record, Rows, SourceLine
from .cause import Cause, CauseId
from .codes import finding_code

AuditKind = Literal[
    "literal", "rounded", "binding",
    "massless", "negative mass", "moments", "triangle", "not finite",
    "negative damping", "negative stiffness", "negative armature",
    "inertia", "damping", "stiffness", "friction", "rest", "acceleration", "freedom",
    "linearization", "unresolved", "pose", "frames",
    "inertial", "ignored", "dry friction", "joint limit", "reach", "empty limit", "contact",
    "constraint", "setting", "warning", "replaced", "default", "unread", "misspelled",
    "unstable step",
]  # fmt: skip
"""Subject of an audit finding; each has a message code and a page.

A number of the file against its binding in the sidecar; an inertia, damping, stiffness or armature
that no body can have; a compiled term compared with the equations; a pose; a name that no engine
reads, or that is misspelled; and what an engine or a format ignores, adds or assumes
(`physics_crosscheck.harness.engines.remark`).
"""

UsdKind = Literal[
    "articulation root", "unset mass", "clashing values", "quaternion", "joint frames", "gain unit",
    "scaled body", "unread effort", "unset friction",
]  # fmt: skip
"""Subject of advice about what engines read in different ways in a USD stage."""

PlausibilityKind = Literal[
    "mesh unit", "equal inertias", "moving without inertia", "inertia too large", "center outside",
    "density", "inertia too small", "swapped axes", "left and right", "weak drive",
    "damping ratio", "rest outside limits", "negative limit", "repeated element",
    "implausible limit", "one density", "default density", "odd moment", "loop gap", "overlap",
    UsdKind,
]  # fmt: skip
"""Subject of advice about a number that real robots do not have; the most certain kind first."""

Severity = Literal["finding", "advice", "note"]

BEYOND: AuditKind = "reach"
"""Kind of a note on a joint limit or a contact that no motion reaches, so that it is not tested."""


SAME = 1e-6
"""Relative tolerance of computed numbers in one finding.

Rounding differs between machines and engines.
"""


def is_near(number: Number, other: Number, tolerance: float) -> bool:
    """Return whether two numbers are equal to a relative tolerance, or both are missing."""
    if number is None or other is None:
        return number is other
    return math.isclose(number, other, rel_tol=tolerance)


class AuditFinding(Record, frozen=True, kw_only=True):
    """One finding of the audit.

    Attributes:
        kind: Type: `literal`, a compiled term such as `inertia`, `pose`, `default`, or `reach`
            (never reached).
        code: Message code of the kind; empty without one.
        subject: Affected objects. Findings of equal kind and subject are the same finding, whatever
            their numbers.
        message: Explanation in one sentence.
        location: Line of the file; None if unknown.
        expected: Expected number; None without one.
        actual: Number in the model; None without one.
        replacement: Text to write in the span of `location`; empty if no number must change.
        severity: `finding` for an error, `advice` for an implausible number, which changes no
            verdict, `note` for information.
        accepted: Reason for accepting advice; empty if it is not accepted.
    """

    kind: AuditKind | PlausibilityKind
    code: str = ""
    subject: tuple[str, ...]
    message: str
    location: SourceLine | None
    expected: Number
    actual: Number
    replacement: str = ""
    severity: Severity
    accepted: str = ""

    def __post_init__(self) -> None:
        msgspec.structs.force_setattr(self, "code", finding_code(self.kind))

    def is_like(self, other: AuditFinding, tolerance: float) -> bool:
        """Return whether another finding is the same, in the same file, by fields and not by words.

        Args:
            other: finding of another engine, version or run.
            tolerance: tolerance of the numbers, relative to the larger.
        """
        mine = self.kind, self.severity, self.subject, self.location
        theirs = other.kind, other.severity, other.subject, other.location
        return mine == theirs and all(
            is_near(one, two, tolerance)
            for one, two in ((self.expected, other.expected), (self.actual, other.actual))
        )


class Explanation(Record, frozen=True, kw_only=True):
    """One cause, or two together.

    Attributes:
        causes: One cause or a pair.
        remaining: Share of the discrepancy that remains.
        tied_with: Causes that these motions cannot distinguish from this one.
    """

    causes: tuple[Cause, ...]
    remaining: float
    tied_with: tuple[CauseId, ...] = ()


class CorrectedScenario(Record, frozen=True, kw_only=True):
    """One scenario with the corrected values; one row per component.

    Attributes:
        scenario: Name of the scenario.
        t: Times, seconds.
        corrected: Motion with the corrected values.
        segment_t: Start times of the segments that the diagnosis used, seconds.
        before: Differences of these segments before the correction.
        after: Differences of these segments after the correction.
    """

    scenario: str
    t: Numbers
    corrected: Rows
    segment_t: Numbers
    before: Rows
    after: Rows


class CorrectedMotion(Record, frozen=True, kw_only=True):
    """The motion with the corrected values.

    Attributes:
        causes: The corrected causes.
        put_into: `file` if the file ran again, `equations` if these were solved
            again.
        scenarios: Motion of each scenario.
    """

    causes: tuple[Cause, ...]
    put_into: Literal["equations", "file"]
    scenarios: tuple[CorrectedScenario, ...]


CLOSE = 0.1
"""Largest remaining share of the discrepancy at which a cause is printed."""


class Diagnosis(Record, frozen=True, kw_only=True):
    """The causes of a model's discrepancy.

    Attributes:
        explained: Whether the first explanation leaves at most the uncertainty, or 0.3 %.
        explanations: Explanations, best first.
        floor: Share of the discrepancy that the uncertainty alone makes; None without explanations.
        corrected: Corrected motion; None if nothing is explained or the cause cannot be corrected.
        behaviours: What the engine does with constraints of the file, if no number explains.
        failure: Reason if the diagnosis failed; empty otherwise.
        seconds: Duration, seconds.
    """

    explained: bool = False
    explanations: tuple[Explanation, ...] = ()
    behaviours: tuple[AuditFinding, ...] = ()
    floor: Number = None
    corrected: CorrectedMotion | None = None
    failure: str = ""
    seconds: float = 0.0

    @property
    def best(self) -> Explanation | None:
        """The first explanation, unless it leaves more than a tenth of the discrepancy."""
        return next((one for one in self.explanations[:1] if one.remaining <= CLOSE), None)
