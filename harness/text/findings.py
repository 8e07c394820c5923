"""The audit's findings as lines for a terminal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any


def audit_lines(findings: Iterable[Mapping[str, Any]], notes: bool = True) -> list[str]:
    """A line for each record: findings first, notes after them, each with its file and line."""
    records = list(findings)
    lines = []
    for severity in ("finding", "note") if notes else ("finding",):
        for record in records:
            if record["severity"] == severity:
                where = f"{record['where']}: " if record["where"] else ""
                lines.append(f"{severity:<8} {record['kind']:<12} {where}{record['message']}")
    return lines or ["nothing to say: literals and compiled terms are those of the equations"]
