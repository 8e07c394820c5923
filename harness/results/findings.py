"""The audit's findings as lines for a terminal."""

from __future__ import annotations

from collections.abc import Iterable

from msgspec.structs import replace

from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.harness.results.messages import with_code
from physics_crosscheck.harness.results.places import shown_path


def audit_lines(findings: Iterable[AuditFinding], notes: bool = True) -> list[str]:
    """A line for each: findings first, notes after them, each with its file and line."""
    known = list(findings)
    lines = []
    for severity in ("finding", "note") if notes else ("finding",):
        for one in known:
            if one.severity == severity:
                text = f"{_place(one.location)}{one.message}"
                lines.append(f"{severity:<8} {with_code(one.code, text)}")
    return lines or ["ok: literals and compiled terms match the equations"]


def _place(where: SourceLine | None) -> str:
    return "" if where is None else f"{replace(where, file=shown_path(where.file))}: "
