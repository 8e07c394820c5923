"""Construction of audit findings."""

from __future__ import annotations

from typing import Literal

from physics_crosscheck.harness.documents.location import Location
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
    """Build a finding or a note; most have no source line and compare no two numbers."""
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
    """Return the source line of a number, with its byte range."""
    return SourceLine(
        file=str(location.file),
        line=location.line,
        span=(location.start, location.end),
        text=location.text,
    )
