"""The view of a model that differs: its cause, alternatives, and source lines."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.cause import Cause
from physics_crosscheck.harness.records.finding import AuditFinding, Explanation
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.results.causes import BEGIN_WITH_AUDIT, cause_sentences
from physics_crosscheck.harness.results.next_steps import (
    DROPS_MASSLESS,
    advice_of,
    massless_links,
    massless_places,
)
from .remedies import Remedy, remedy_of
from .text import percent

Row = tuple[int, str, bool]
"""A line of a file: its number, its text, and whether it is marked."""

CONTEXT = 4
"""Number of lines shown before and after a marked one."""


@dataclass(frozen=True, kw_only=True)
class DiagnosisView:
    """The diagnosis of one model in one engine.

    Attributes:
        id: its permalink.
        model: record of the model.
        cases: permalinks and scenarios of its cases that differ.
        pack: id of its numbers and plots; empty without.
    """

    id: str
    model: Model
    cases: Sequence[tuple[str, str]]
    pack: str

    @cached_property
    def sentence(self) -> str:
        """The cause."""
        return sentence(self.model)

    @cached_property
    def remedy(self) -> Remedy:
        """The proposed changes."""
        return remedy_of(self.model)

    @property
    def explanations(self) -> Sequence[Explanation]:
        """Ranked explanations."""
        return () if self.model.diagnosis is None else self.model.diagnosis.explanations

    @property
    def audit(self) -> list[tuple[str, str, str]]:
        """Audit findings: kind, message and line."""
        return [
            (one.kind, one.message, short_places([one.location])) for one in self.model.findings
        ]

    @property
    def files(self) -> Iterator[tuple[str, list[Row | None]]]:
        """The model file and its sidecar, with the lines around marked ones; None for a gap."""
        blamed = list(blamed_lines(self.model))
        texts = {self.model.model: self.model.text, f"{self.model.model}.toml": self.model.sidecar}
        for file, text in texts.items():
            if rows := _lines(text, marked_lines(blamed, file)):
                yield file, rows


def sentence(model: Model) -> str:
    """Return the cause in one sentence, or other findings without one."""
    diagnosis = model.diagnosis
    if diagnosis is None:
        return next((placed_message(one) for one in model.findings), "")
    best = diagnosis.best
    if findings := model.unexplained_findings:
        more = f", and {len(findings) - 1} more" if len(findings) > 1 else ""
        advice = BEGIN_WITH_AUDIT[0].upper() + BEGIN_WITH_AUDIT[1:]
        return f"{advice}: {placed_message(findings[0])}{more}."
    if best is None:
        return f"Not diagnosed: {diagnosis.failure or 'no hypothesis fits'}."
    if not diagnosis.explained:
        return (
            f"Unexplained: the best single cause, {named(best.causes)}, leaves a "
            f"residual of {percent(best.remaining)}."
        )
    steps = [f" {text[0].upper()}{text[1:]}." for text in advice_of(model, best.causes)]
    return f"{' and '.join(_statements(model, best))}.{''.join(steps)}"


def placed_message(finding: AuditFinding) -> str:
    """Return a finding with its line, if it has one."""
    return ": ".join(filter(None, (short_places([finding.location]), finding.message)))


def _statements(model: Model, explanation: Explanation) -> Iterator[str]:
    """Yield a sentence for each cause."""
    *sentences, _ = cause_sentences(explanation)
    for cause, text in zip(explanation.causes, sentences, strict=True):
        massless = massless_links(cause, model)
        links = massless_places(massless, model)
        yield f"The engine {DROPS_MASSLESS}: {links}" if massless else text


def named(causes: Iterable[Cause]) -> str:
    """Return the names of the causes of one explanation."""
    return " and ".join(map(str, causes))


def blamed_lines(model: Model) -> Iterator[SourceLine]:
    """Yield lines of the explaining cause and of audit findings."""
    if model.diagnosis is not None and model.diagnosis.explained:
        for explanation in model.diagnosis.explanations[:1]:
            for cause in explanation.causes:
                yield from cause.locations
    for finding in model.findings:
        if finding.location is not None:
            yield finding.location


def short_places(places: Iterable[SourceLine | None]) -> str:
    """Return different lines without their folders."""
    return ", ".join(
        dict.fromkeys(
            str(SourceLine(file=_path(where.file).rsplit("/", 1)[-1], line=where.line))
            for where in places
            if where is not None
        )
    )


def _path(file: str) -> str:
    return file.replace("\\", "/")


def marked_lines(blamed: Sequence[SourceLine], file: str) -> set[int]:
    """Return the blamed line numbers of a file."""
    return {
        where.line
        for where in blamed
        if where.line is not None and f"/{_path(where.file)}".endswith(f"/{_path(file)}")
    }


def _lines(text: str, marked: set[int]) -> list[Row | None]:
    rows: list[Row | None] = []
    for number, row in enumerate(text.splitlines(), 1):
        if any(abs(number - one) <= CONTEXT for one in marked):
            rows.append((number, row, number in marked))
        elif rows and rows[-1] is not None:
            rows.append(None)
    return rows
