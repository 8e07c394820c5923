"""What the report says of a model that differs: the cause, what else it may be, and the line."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.cause import Cause
from physics_crosscheck.harness.records.finding import Explanation
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.render.html.text import percent, sci, shown
from physics_crosscheck.harness.results.causes import BEGIN_WITH_AUDIT, cause_sentences


@dataclass(frozen=True, kw_only=True)
class Line:
    """One line of a file."""

    number: int
    text: str
    marked: bool


@dataclass(frozen=True, kw_only=True)
class CauseView:
    """One number that is wrong."""

    name: str
    kind: str
    nominal: str
    estimate: str
    where: str


@dataclass(frozen=True, kw_only=True)
class ExplanationView:
    """One cause, or a pair, in the order of the ranking: what it leaves, what it is tied with."""

    causes: tuple[CauseView, ...]
    left: str
    tied: str


@dataclass(frozen=True, kw_only=True)
class DiagnosisView:
    """What is wrong with one model in one engine.

    Attributes:
        id: its permalink.
        sentence: the cause.
        explained: whether it leaves no more than the uncertainty.
        audit_first: whether no cause explains it, and reading finds something wrong.
        explanations: ranked.
        files: the model file, or its sidecar, with the lines about the marked ones; None stands
            for what is left out.
        audit: what was found by reading, (severity, message, where).
        cases: permalinks of the cases that differ, with their scenarios.
        pack: id of its numbers and plots; empty without.
    """

    id: str
    system: str
    model: str
    engine: str
    sentence: str
    explained: bool
    audit_first: bool
    explanations: tuple[ExplanationView, ...]
    files: tuple[tuple[str, tuple[Line | None, ...]], ...]
    audit: tuple[tuple[str, str, str], ...]
    cases: tuple[tuple[str, str], ...]
    pack: str


CONTEXT = 4
"""Lines shown before and after a marked one."""


def diagnosis_view(
    model: Model, identity: str, pack: str, cases: Sequence[tuple[str, str]]
) -> DiagnosisView:
    """The view of a model's diagnosis and audit.

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
        audit_first=bool(model.unexplained_findings),
        explanations=() if diagnosis is None else tuple(map(_explanation, diagnosis.explanations)),
        files=_files(model, list(_blamed(model))),
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
    """The cause in one sentence; what is known instead where there is none."""
    diagnosis = model.diagnosis
    if diagnosis is None:
        return shown(model.findings[0].message) if model.findings else ""
    if not diagnosis.explanations:
        return f"Not diagnosed: {shown(diagnosis.failure or 'no hypothesis fits')}."
    best = diagnosis.explanations[0]
    if found := model.unexplained_findings:
        more = f", and {len(found) - 1} more" if len(found) > 1 else ""
        begun = BEGIN_WITH_AUDIT[0].upper() + BEGIN_WITH_AUDIT[1:]
        return f"{begun}: {shown(found[0].message)}{more}."
    if not diagnosis.explained:
        return (
            f"Unexplained: the best single cause, {named(best.causes)}, leaves a "
            f"residual of {percent(best.remaining)}."
        )
    return f"{shown(' and '.join(cause_sentences(best)[:-1]))}."


def named(causes: Iterable[Cause]) -> str:
    """Names of causes that are one explanation together."""
    return " and ".join(shown(cause) for cause in causes)


def _blamed(model: Model) -> Iterator[SourceLine]:
    """Lines of the cause, where it explains the motion, and of what the audit found."""
    if model.diagnosis is not None and model.diagnosis.explained:
        for explanation in model.diagnosis.explanations[:1]:
            for cause in explanation.causes:
                yield from cause.locations
    for finding in model.findings:
        if finding.location is not None:
            yield finding.location


def _explanation(one: Explanation) -> ExplanationView:
    return ExplanationView(
        causes=tuple(_cause(cause) for cause in one.causes),
        left=sci(one.remaining),
        tied=", ".join(shown(name) for name in one.tied_with),
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
    """As text, without the folders."""
    return shown(SourceLine(file=_path(where.file).rsplit("/", 1)[-1], line=where.line))


def _path(file: str) -> str:
    return file.replace("\\", "/")


def _files(
    model: Model, blamed: Sequence[SourceLine]
) -> tuple[tuple[str, tuple[Line | None, ...]], ...]:
    """The model file and its sidecar, those of them of which a line is blamed."""
    texts = {model.model: model.text, f"{model.model}.toml": model.sidecar}
    found = ((file, _lines(text, _marked(blamed, file))) for file, text in texts.items())
    return tuple((shown(file), lines) for file, lines in found if lines)


def _marked(blamed: Sequence[SourceLine], file: str) -> set[int]:
    """Lines of a file; the others are of other files, or mean a whole file."""
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
