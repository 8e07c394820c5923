"""What an audit has to say, one thing at a time."""

from __future__ import annotations

from typing import Literal

from physics_crosscheck.harness.modelfiles.locations import Location
from physics_crosscheck.harness.records.base import SourceLine, number
from physics_crosscheck.harness.records.finding import AuditFinding, AuditKind


def finding(
    kind: AuditKind,
    subject: tuple[str, ...],
    message: str,
    *,
    location: SourceLine | None = None,
    expected: float | None = None,
    found: float | None = None,
    replacement: str = "",
    severity: Literal["finding", "note"] = "finding",
) -> AuditFinding:
    """A finding, or a note, of which most stand in no line or are about no two numbers."""
    return AuditFinding(
        kind=kind,
        subject=subject,
        message=message,
        location=location,
        expected=number(expected),
        found=number(found),
        replacement=replacement,
        severity=severity,
    )


def source_line(location: Location) -> SourceLine:
    """The line that a number stands in, and its bytes there."""
    return SourceLine(
        file=str(location.file),
        line=location.line,
        span=(location.start, location.end),
        text=location.text,
    )
