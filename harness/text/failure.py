"""A failure in words, as pytest and the function API print it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from harness.text.causes import cause_sentences
from harness.text.findings import audit_lines
from harness.text.status import Decision
from harness.text.table import audit_findings


def told(record: Mapping[str, Any], decision: Decision, diagnosis: Mapping[str, Any] | None) -> str:
    """What a failing test prints: the verdict, its numbers, the cause, what the engine printed."""
    head = "audit" if "audit" in record else record["outcome"]
    but = ", but" if head == "AGREES" else ":"  # to a project's demands
    lines = [f"{head}{but} {decision.reason}"]
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
        "outcome": "{}",
        "discrepancy": "{:.3e}",
        "uncertainty": "{:.3e}",
        "component": "{}",
        "order": "{:.3f}",
        "raw_error": "{:.3e}",
        "shipped_step": "{:g}",
    }
    return {
        name: form.format(record[name])
        for name, form in forms.items()
        if record.get(name) not in (None, "") and record[name] == record[name]
    }
