"""Failure messages of pytest and the function API."""

from __future__ import annotations

import os

from physics_crosscheck.harness.records.base import Number, SourceLine
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.codes import part_code
from physics_crosscheck.harness.records.finding import Diagnosis
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.results.causes import cause_sentences
from physics_crosscheck.harness.results.findings import audit_lines
from physics_crosscheck.harness.results.github import on_github, plain_line
from physics_crosscheck.harness.results.messages import with_code
from physics_crosscheck.harness.results.status import Decision
from physics_crosscheck.harness.results.visible import visible_lines


def failure_message(
    record: Case | Model, decision: Decision, diagnosis: Diagnosis | None = None
) -> str:
    """Return the message of a failing test: cause, verdict, numbers, and the engine's output."""
    if isinstance(record, Model):
        findings = audit_lines(record.findings)
        code = part_code() if record.failures else ""
        title = with_code(code, f"audit: {decision.reason}")
        return _visible("\n".join([title, *(f"  {text}" for text in findings)]))
    agrees = record.outcome is Outcome.AGREES
    # A case that agrees can still fail the project's own requirements.
    code = "" if diagnosis is not None and diagnosis.explained else record.code
    lines = [with_code(code, f"{record.outcome}{', but' if agrees else ':'} {decision.reason}")]
    numbers = figures(record)
    if numbers:
        lines.append("  " + ", ".join(f"{name} {text}" for name, text in numbers.items()))
    if diagnosis is not None:
        cause, *more = diagnosis_lines(diagnosis)
        explained = [cause, *(f"  {text}" for text in more)]
        lines = [*explained, *lines] if diagnosis.explained else [*lines, *explained]
    lines += [f"  | {text}" for text in record.stdout.splitlines()]
    return _visible("\n".join(lines))


def _visible(text: str) -> str:
    """Remove control characters and GitHub workflow commands from lines."""
    lines = visible_lines(text)
    return "\n".join(map(plain_line, lines) if on_github(os.environ) else lines)


def diagnosis_lines(diagnosis: Diagnosis) -> list[str]:
    """Return the first explanation of a diagnosis, or why no cause was found."""
    if not diagnosis.explanations:
        return [f"no cause found: {diagnosis.failure or 'no tried cause explains it'}"]
    best = diagnosis.explanations[0]
    *sentences, tail = cause_sentences(best)
    if not diagnosis.explained:
        return ["no cause found; closest:", *sentences, tail]
    coded = zip((cause.code for cause in best.causes), sentences, strict=True)
    cause, *more = (with_code(*one) for one in coded)
    return [f"cause: {cause}", *more, tail]


def in_brief(
    record: Case | Model, decision: Decision, diagnosis: Diagnosis | None = None
) -> tuple[str, SourceLine | None]:
    """Return a failure in one line for pytest's short summary, and its source line if known."""
    if isinstance(record, Case) and diagnosis is not None and diagnosis.explained:
        lines = [one for cause in diagnosis.explanations[0].causes for one in cause.locations]
        summary = _visible(f"{record.outcome}: {diagnosis_lines(diagnosis)[0]}")
        return summary, lines[0] if lines else None
    places = []
    if isinstance(record, Model):
        places = [finding.location for finding in record.findings if finding.location]
    summary = failure_message(record, decision, diagnosis).splitlines()[0]
    return summary, places[0] if places else None


def figures(case: Case) -> dict[str, str]:
    """Return the known numbers of a case by name, formatted."""
    values: dict[str, str] = {}
    if case.verdict is not None:
        component = case.verdict.component
        values |= _figure("discrepancy", case.verdict.discrepancy, "{:.3e}")
        values |= _figure("uncertainty", case.verdict.uncertainty, "{:.3e}")
        values |= {"component": component} if component else {}
        values |= {"decided_by": case.verdict.decided_by}
    if case.full_run is not None:
        values |= _figure("order", case.full_run.order, "{:.3f}")
        values |= _figure("global_error", case.full_run.global_error, "{:.3e}")
        values |= _figure("velocity_error", case.full_run.velocity_error, "{:.3e}")
        values |= _figure("time_step", case.full_run.time_step, "{:g}")
    return values


def _figure(name: str, value: Number, form: str) -> dict[str, str]:
    return {} if value is None else {name: form.format(value)}
