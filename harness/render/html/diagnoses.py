"""The view of a model that differs: its cause, alternatives, and source lines."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.cause import Cause
from physics_crosscheck.harness.records.finding import Explanation
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.render.html.remedies import Remedy, remedy_of
from physics_crosscheck.harness.render.html.text import percent, sci, shown
from physics_crosscheck.harness.results.causes import BEGIN_WITH_AUDIT, cause_sentences
from physics_crosscheck.harness.results.next_steps import (
    DROPS_MASSLESS,
    advice_of,
    massless_links,
    massless_places,
)


@dataclass(frozen=True, kw_only=True)
class Line:
    """A line of a file."""

    number: int
    text: str
    marked: bool


@dataclass(frozen=True, kw_only=True)
class CauseView:
    """A wrong number."""

    name: str
    kind: str
    nominal: str
    estimate: str
    where: str


@dataclass(frozen=True, kw_only=True)
class ExplanationView:
    """A cause or a pair of causes in ranked order, with residual and indistinguishable causes."""

    causes: tuple[CauseView, ...]
    remaining: str
    tied: str


@dataclass(frozen=True, kw_only=True)
class DiagnosisView:
    """The diagnosis of one model in one engine.

    Attributes:
        id: its permalink.
        sentence: the cause.
        explained: whether the residual is within the uncertainty.
        remedy: proposed changes.
        audit_first: whether the audit has findings and no cause explains the difference.
        explanations: ranked explanations.
        files: the model file or its sidecar, with the lines around marked ones; None for a gap.
        audit: audit findings, (severity, message, where).
        cases: permalinks of the cases that differ, with their scenarios.
        pack: id of its numbers and plots; empty without.
    """

    id: str
    system: str
    model: str
    engine: str
    sentence: str
    explained: bool
    remedy: Remedy
    audit_first: bool
    explanations: tuple[ExplanationView, ...]
    files: tuple[tuple[str, tuple[Line | None, ...]], ...]
    audit: tuple[tuple[str, str, str], ...]
    cases: tuple[tuple[str, str], ...]
    pack: str


CONTEXT = 4
"""Number of lines shown before and after a marked one."""


def diagnosis_view(
    model: Model, identity: str, pack: str, cases: Sequence[tuple[str, str]]
) -> DiagnosisView:
    """Return the view of a model's diagnosis and audit.

    Args:
        model: its record.
        identity: its permalink.
        pack: id of its numbers and plots; empty without.
        cases: (permalink, scenario) of the cases that differ.
    """
    diagnosis = model.diagnosis
    return DiagnosisView(
        id=identity,
        system=shown(model.system),
        model=shown(model.model),
        engine=shown(model.engine),
        sentence=sentence(model),
        explained=diagnosis is not None and diagnosis.explained,
        remedy=remedy_of(model),
        audit_first=bool(model.unexplained_findings),
        explanations=() if diagnosis is None else tuple(map(_explanation, diagnosis.explanations)),
        files=_files(model, list(blamed_lines(model))),
        audit=tuple(
            (
                shown(one.kind),
                shown(one.message),
                "" if one.location is None else _short(one.location),
            )
            for one in model.findings
        ),
        cases=tuple(cases),
        pack=pack,
    )


def sentence(model: Model) -> str:
    """Return the cause in one sentence, or other findings without one."""
    diagnosis = model.diagnosis
    if diagnosis is None:
        return shown(model.findings[0].message) if model.findings else ""
    best = diagnosis.best
    if findings := model.unexplained_findings:
        more = f", and {len(findings) - 1} more" if len(findings) > 1 else ""
        advice = BEGIN_WITH_AUDIT[0].upper() + BEGIN_WITH_AUDIT[1:]
        return f"{advice}: {shown(findings[0].message)}{more}."
    if best is None:
        return f"Not diagnosed: {shown(diagnosis.failure or 'no hypothesis fits')}."
    if not diagnosis.explained:
        return (
            f"Unexplained: the best single cause, {named(best.causes)}, leaves a "
            f"residual of {percent(best.remaining)}."
        )
    steps = [f" {text[0].upper()}{text[1:]}." for text in advice_of(model, best.causes)]
    return shown(f"{' and '.join(_statements(model, best))}.{''.join(steps)}")


def _statements(model: Model, explanation: Explanation) -> Iterator[str]:
    """Yield a sentence for each cause."""
    *sentences, _ = cause_sentences(explanation)
    for cause, text in zip(explanation.causes, sentences, strict=True):
        massless = massless_links(cause, model)
        links = massless_places(massless, model)
        yield f"The engine {DROPS_MASSLESS}: {links}" if massless else text


def named(causes: Iterable[Cause]) -> str:
    """Return the names of the causes of one explanation."""
    return " and ".join(shown(cause) for cause in causes)


def blamed_lines(model: Model) -> Iterator[SourceLine]:
    """Yield lines of the explaining cause and of audit findings."""
    if model.diagnosis is not None and model.diagnosis.explained:
        for explanation in model.diagnosis.explanations[:1]:
            for cause in explanation.causes:
                yield from cause.locations
    for finding in model.findings:
        if finding.location is not None:
            yield finding.location


def _explanation(explanation: Explanation) -> ExplanationView:
    return ExplanationView(
        causes=tuple(_cause(cause) for cause in explanation.causes),
        remaining=sci(explanation.remaining),
        tied=", ".join(shown(name) for name in explanation.tied_with),
    )


def _cause(cause: Cause) -> CauseView:
    return CauseView(
        name=shown(cause),
        kind=cause.kind,
        nominal=_number(cause.nominal),
        estimate=f"{_number(cause.estimate)} ± {sci(cause.standard_error)}",
        where=", ".join(dict.fromkeys(map(_short, cause.locations))),
    )


def _number(value: float | None) -> str:
    return "?" if value is None else f"{value:.9g}"


def _short(where: SourceLine) -> str:
    """Format a line without its folders."""
    return shown(SourceLine(file=_path(where.file).rsplit("/", 1)[-1], line=where.line))


def _path(file: str) -> str:
    return file.replace("\\", "/")


def _files(
    model: Model, blamed: Sequence[SourceLine]
) -> tuple[tuple[str, tuple[Line | None, ...]], ...]:
    """Return the model file and its sidecar, if they contain blamed lines."""
    texts = {model.model: model.text, f"{model.model}.toml": model.sidecar}
    marked_files = (
        (file, _lines(text, marked_lines(blamed, file))) for file, text in texts.items()
    )
    return tuple((shown(file), lines) for file, lines in marked_files if lines)


def marked_lines(blamed: Sequence[SourceLine], file: str) -> set[int]:
    """Return the blamed line numbers of a file."""
    return {
        where.line
        for where in blamed
        if where.line is not None and f"/{_path(where.file)}".endswith(f"/{_path(file)}")
    }


def _lines(text: str, marked: set[int]) -> tuple[Line | None, ...]:
    rows: list[Line | None] = []
    for number, row in enumerate(text.splitlines(), 1):
        if any(abs(number - one) <= CONTEXT for one in marked):
            rows.append(Line(number=number, text=shown(row), marked=number in marked))
        elif rows and rows[-1] is not None:
            rows.append(None)
    return tuple(rows)
