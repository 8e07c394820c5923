"""What a test makes of a record: pass, fail or skip, and what it says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from harness.audit_text import audit_lines
from harness.table import audit_findings, cause_sentences
from harness.verdict import Outcome


class Ending(StrEnum):
    """How a test ends."""

    PASS = "pass"
    FAIL = "fail"
    SKIP = "skip"


@dataclass(frozen=True)
class Decision:
    """How a test ends, and the sentence that says why; empty for a pass."""

    ending: Ending
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
        ending = Ending.FAIL if require_engines else Ending.SKIP
        return Decision(ending, record["reason"])
    if outcome == Outcome.FAILED:
        return Decision(Ending.FAIL, record["reason"])
    if record.get("accepted"):
        return Decision(Ending.PASS, "")
    if "audit" in record:
        findings = audit_findings(record)
        if findings:
            return Decision(Ending.FAIL, counted(len(findings), "finding"))
    elif outcome != Outcome.AGREES:
        return Decision(Ending.FAIL, record["reason"])
    elif demands:
        return Decision(Ending.FAIL, "; ".join(demands))
    return Decision(Ending.PASS, "")


def counted(number: int, noun: str) -> str:
    """`1 finding`, `2 findings`."""
    return f"{number} {noun}" + "s" * (number != 1)


def told(record: Mapping[str, Any], decision: Decision, diagnosis: Mapping[str, Any] | None) -> str:
    """What a failing test prints: the verdict, its numbers, the cause, what the engine printed."""
    head = "audit" if "audit" in record else record["outcome"]
    lines = [f"{head}: {decision.reason}"]
    if "audit" in record:
        lines += [f"  {text}" for text in audit_lines(record["audit"], notes=False)]
    numbers = {name: text for name, text in figures(record).items() if name != "outcome"}
    if numbers:
        lines.append("  " + ", ".join(f"{name} {text}" for name, text in numbers.items()))
    if diagnosis is not None:
        cause, *more = diagnosis_lines(diagnosis)
        lines += [cause, *(f"  {text}" for text in more)]
    lines += [f"  | {text}" for text in (record.get("printed") or "").splitlines()]
    return "\n".join(lines)


def diagnosis_lines(diagnosis: Mapping[str, Any]) -> list[str]:
    """A diagnosis in words: its first finding, or why there is none."""
    if not diagnosis.get("findings"):
        return [f"no cause found: {diagnosis.get('reason') or 'nothing tried explains it'}"]
    sentences = cause_sentences(diagnosis["findings"][0])
    if diagnosis["explained"]:
        return [f"cause: {sentences[0]}", *sentences[1:]]
    return ["no cause explains it; what leaves least is", *sentences]


def in_brief(
    record: Mapping[str, Any], decision: Decision, diagnosis: Mapping[str, Any] | None
) -> tuple[str, str]:
    """A failure in one line, for pytest's short summary, and where it lies: file:line or empty."""
    lines = told(record, decision, diagnosis).splitlines()
    if diagnosis is not None and diagnosis.get("explained"):
        where = [place for place in diagnosis["findings"][0]["where"] if place]
        return f"{record['outcome']}: {diagnosis_lines(diagnosis)[0]}", where[0] if where else ""
    places = [finding["where"] for finding in audit_findings(record) if finding["where"]]
    return lines[0], places[0] if places else ""


def figures(record: Mapping[str, Any]) -> dict[str, str]:
    """The numbers of a case by name, as a person reads them; those that it has."""
    forms = {
        "outcome": "{}", "discrepancy": "{:.3e}", "uncertainty": "{:.3e}", "component": "{}",
        "order": "{:.3f}", "raw_error": "{:.3e}", "shipped_step": "{:g}",
    }  # fmt: skip
    return {
        name: form.format(record[name])
        for name, form in forms.items()
        if record.get(name) not in (None, "") and record[name] == record[name]
    }
