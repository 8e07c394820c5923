"""Whether a record passes, fails or is skipped, in pytest and in the function API."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from harness.records.outcome import Outcome
from harness.text.table import audit_findings


class TestStatus(StrEnum):
    """How the test of a record ends."""

    __test__ = False  # its name makes pytest take it for tests

    PASS = "pass"
    FAIL = "fail"
    SKIP = "skip"


@dataclass(frozen=True)
class Decision:
    """How a test ends, and the sentence that says why; empty for a pass."""

    ending: TestStatus
    reason: str


def decide(
    record: Mapping[str, Any], *, require_engines: bool, demands: Sequence[str] = ()
) -> Decision:
    """Decide a test from the record of a case, or of an audit (which has `audit`).

    A record with `accepted`, the reason given for it, passes whatever was found, a crash apart.

    Args:
        require_engines: whether an engine that is not installed is a failure.
        demands: what the project asks beyond agreement, and this case does not meet.
    """
    outcome = record.get("outcome")
    if outcome == Outcome.ABSENT:
        ending = TestStatus.FAIL if require_engines else TestStatus.SKIP
        return Decision(ending, record["reason"])
    if outcome == Outcome.FAILED:
        return Decision(TestStatus.FAIL, record["reason"])
    if record.get("accepted"):
        return Decision(TestStatus.PASS, "")
    if "audit" in record:
        findings = audit_findings(record)
        if findings:
            return Decision(TestStatus.FAIL, counted(len(findings), "finding"))
    elif outcome != Outcome.AGREES:
        return Decision(TestStatus.FAIL, record["reason"])
    elif demands:
        return Decision(TestStatus.FAIL, "; ".join(demands))
    return Decision(TestStatus.PASS, "")


def counted(number: int, noun: str) -> str:
    """`1 finding`, `2 findings`."""
    return f"{number} {noun}" + "s" * (number != 1)
