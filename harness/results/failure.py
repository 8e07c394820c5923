"""Failure messages of pytest and the function API, and audit findings as lines."""

import os
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby

from msgspec.structs import replace

from physics_crosscheck.harness.records.base import Number, SourceLine
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.codes import part_code
from physics_crosscheck.harness.records.finding import AuditFinding, Diagnosis
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.survey import ActingQuantity
from .causes import cause_sentences
from .github import on_github, plain_line
from .messages import with_code
from .places import shown_path
from .status import Decision, listed
from .visible import visible_lines


def survey_lines(
    findings: Iterable[AuditFinding], left_out: Sequence[str], *, mechanics: bool
) -> list[str]:
    """Return the lines of a model of bodies; `mechanics`: whether its terms were compared."""
    success = "ok: no inertia or sign is impossible"
    success += "; compiled terms match the equations" if mechanics else ""
    lines = audit_lines(findings, success=success)
    skipped = [f"{'note':<8} left out: {', '.join(left_out)}"] if left_out else []
    return [*lines, *skipped]


def audit_lines(
    findings: Iterable[AuditFinding],
    success: str = "ok: literals and compiled terms match the equations",
) -> list[str]:
    """Return one line per finding, then one per note, each with its file and line."""
    all_findings = list(findings)
    lines = []
    for severity in ("finding", "note"):
        for finding in all_findings:
            if finding.severity == severity:
                lines.append(f"{severity:<8} {_coded(finding)}")
    return lines or [success]


MAX_ADVICE_KINDS = 4
"""Maximum number of kinds of advice in a short list."""


def advice_lines(advice: Sequence[AuditFinding], *, details: bool = False) -> list[str]:
    """Return one line per kind of advice: its worst finding and the number of others.

    Args:
        advice: of one file, by kind, the worst first in each.
        details: whether to return one line per finding.
    """
    kinds: dict[str, list[AuditFinding]] = {}
    for finding in advice:
        kinds.setdefault(finding.kind, []).append(finding)
    if details:
        return [_coded(one) for one in advice]
    lines = [
        _coded(worst) + (f" (and {len(others)} more like it)" if others else "")
        for worst, *others in kinds.values()
    ]
    hidden = lines[MAX_ADVICE_KINDS:]
    more = [f"{len(hidden)} more kinds; --details lists all"] if hidden else []
    return [*lines[:MAX_ADVICE_KINDS], *more]


def _coded(finding: AuditFinding) -> str:
    return with_code(finding.code, f"{_place(finding.location)}{finding.message}")


def acting_lines(quantities: Iterable[ActingQuantity]) -> list[str]:
    """Return one line per subject, or equal ones: what its numbers act as, with units and rules."""
    alike: dict[str, list[str]] = {}
    for row in quantities:
        text = f"{row.quantity} {_digits(row, 4)}"
        alike.setdefault(row.subject, []).append(text + (f" ({row.rule})" if row.rule else ""))
    equal: dict[tuple[str, str], list[str]] = {}
    for subject, rows in alike.items():
        head, between, name = subject.partition(" of ")
        equal.setdefault((head + between, ", ".join(rows)), []).append(name)
    return [f"{'acts as':<8} {head}{listed(n, 6)}: {text}" for (head, text), n in equal.items()]


def acting_texts(quantities: Iterable[ActingQuantity]) -> Iterator[tuple[str, str]]:
    """Yield a label and a line for each subject: what it acts as, then what is declared."""
    rows = sorted(quantities, key=lambda row: row.declared)
    for (declared, subject), alike in groupby(rows, key=lambda row: (row.declared, row.subject)):
        values = (f"{row.quantity} {_digits(row, 3)}" for row in alike)
        yield "rigid" if declared else "acts", f"{subject}: {', '.join(values)}"


def _digits(row: ActingQuantity, digits: int) -> str:
    value = "not finite" if row.value is None else f"{row.value:.{digits}g}"
    return f"{value}{row.unit and ' '}{row.unit}"


def _place(where: SourceLine | None) -> str:
    return "" if where is None else f"{replace(where, file=shown_path(where.file))}: "


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
    best = diagnosis.best
    if best is None:
        return [f"no cause found: {diagnosis.failure or 'no tried cause explains it'}"]
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
