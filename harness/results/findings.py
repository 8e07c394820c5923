"""Audit findings as lines for a terminal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from msgspec.structs import replace

from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.harness.results.messages import with_code
from physics_crosscheck.harness.results.places import shown_path


def survey_lines(
    findings: Iterable[AuditFinding], left_out: Sequence[str], *, mechanics: bool
) -> list[str]:
    """Return the lines of a model of bodies; `mechanics`: whether its terms were compared."""
    success = "ok: no inertia or sign is implausible"
    success += "; compiled terms match the equations" if mechanics else ""
    lines = audit_lines(findings, success=success)
    skipped = [f"{'note':<8} left out: {', '.join(left_out)}"] if left_out else []
    return [*lines, *skipped]


def audit_lines(
    findings: Iterable[AuditFinding],
    notes: bool = True,
    success: str = "ok: literals and compiled terms match the equations",
) -> list[str]:
    """Return one line per finding, then one per note, each with its file and line."""
    all_findings = list(findings)
    lines = []
    for severity in ("finding", "note") if notes else ("finding",):
        for finding in all_findings:
            if finding.severity == severity:
                text = f"{_place(finding.location)}{finding.message}"
                lines.append(f"{severity:<8} {with_code(finding.code, text)}")
    return lines or [success]


def _place(where: SourceLine | None) -> str:
    return "" if where is None else f"{replace(where, file=shown_path(where.file))}: "
