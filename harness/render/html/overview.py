"""The overview: the verdict, the issues with their fixes, outliers, and models by engines."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from physics_crosscheck.harness.records.case import ModelKey
from physics_crosscheck.harness.records.coverage import Coverage
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.results.issues import (
    audited_alike,
    collect_issues,
    explained_alike,
    named_models,
    untold_failures,
)
from physics_crosscheck.harness.results.status import counted
from ..terminal.models_table import CHAOTIC
from .cases import CaseView, severity
from .diagnoses import DiagnosisView
from .remedies import NO_REMEDY, Remedy
from .text import NOTHING, percent

Diagnoses = Mapping[ModelKey, DiagnosisView]

MAX_FILES = 4
"""Maximum number of model files whose tested numbers the overview shows."""


@dataclass(frozen=True, kw_only=True)
class IssueView:
    """An issue, listed once for all affected cases.

    Attributes:
        id: permalink of the details; empty without one.
        outcome: outcome of its cases; AUDIT for findings without motion.
        name: name of the affected model.
        count: number of cases, in words.
        sentence: the problem.
        remedy: the proposed fix.
        cases: the affected cases to link.
    """

    id: str
    outcome: str
    name: str
    count: str
    sentence: str
    remedy: Remedy = NO_REMEDY
    cases: Sequence[CaseView] = ()


def tested_numbers(models: Iterable[Model]) -> list[tuple[Model, Coverage]]:
    """Return each model file in the engine that tests most, the smallest shares first."""
    best: dict[tuple[str, str], tuple[Model, Coverage]] = {}
    for model in models:
        coverage, key = model.coverage, (model.folder, model.model)
        if coverage is None or not coverage.numbers:
            continue
        if key not in best or _rank(model, coverage) > _rank(*best[key]):
            best[key] = model, coverage
    return sorted(best.values(), key=lambda row: row[1].seen / row[1].numbers)[:MAX_FILES]


def _rank(model: Model, coverage: Coverage) -> tuple[int, bool]:
    """Rank a model by its tested numbers, then by whether its own engine's checks count."""
    return coverage.seen, coverage.engine == model.engine


def issue_views(
    results: Results, views: Mapping[int, CaseView], diagnoses: Diagnoses
) -> tuple[IssueView, ...]:
    """Return the issues in the terminal's order: fixable ones first, then the worst.

    Args:
        results: all results.
        views: views of the cases, by the identity of their records.
        diagnoses: diagnoses of the models that differ or have findings.
    """
    groups = [
        [views[id(case)] for case in (one.worst, *one.others)]
        for one in collect_issues(results.cases)
    ]
    causes: list[IssueView] = []
    explained: set[ModelKey] = set()
    for alike in explained_alike(results.models):
        keys = {model.key for model in alike}
        cases = [view for group in groups for view in group if _is_covered(view, keys)]
        if cases and alike[0].diagnosis is not None and alike[0].diagnosis.explained:
            explained |= keys
            causes.append(_diagnosed(alike, diagnoses, Outcome.DIFFERS, "case", cases))
    unexplained = ([view for view in group if not _is_covered(view, explained)] for group in groups)
    failures = (
        IssueView(
            id="", outcome=Outcome.FAILED, name=str(model.id), count="", sentence=f"{what}: {why}"
        )
        for model, what, why in untold_failures(results)
    )
    audits = (
        _diagnosed(alike, diagnoses, "AUDIT", "finding")
        for alike in audited_alike(results.models)
        if not any(
            # The cases of a model with unexplained findings report it.
            model.key in explained or model.accepted or model.unexplained_findings
            for model in alike
        )
    )
    return (
        *causes,
        *(_unexplained(group, diagnoses) for group in unexplained if group),
        *failures,
        *audits,
    )


def _is_covered(view: CaseView, explained: set[ModelKey]) -> bool:
    return view.case.outcome is Outcome.DIFFERS and view.case.key in explained


def _diagnosed(
    alike: Sequence[Model],
    diagnoses: Diagnoses,
    outcome: str,
    noun: str,
    cases: Sequence[CaseView] = (),
) -> IssueView:
    """Return the issue of models with the same cause or findings."""
    view = diagnoses[alike[0].key]
    return IssueView(
        id=view.id,
        outcome=outcome,
        name=named_models(alike),
        count=counted(len(cases or alike[0].findings), noun),
        sentence=view.sentence,
        remedy=view.remedy,
        cases=cases,
    )


def _unexplained(views: Sequence[CaseView], diagnoses: Diagnoses) -> IssueView:
    """Return the issue of cases with the same problem and without an explaining cause."""
    worst, cases = views[0], [view.case for view in views]
    outcome = worst.case.outcome
    diagnosis = diagnoses.get(worst.case.key) if outcome is Outcome.DIFFERS else None
    files = list(dict.fromkeys(f"{case.system}/{case.model}" for case in cases))
    engines = ", ".join(dict.fromkeys(case.engine for case in cases))
    return IssueView(
        id=diagnosis.id if diagnosis else worst.id,
        outcome=outcome,
        name=f"{files[0]} [{engines}]" if len(files) == 1 else counted(len(files), "model file"),
        count=counted(len(cases), "case"),
        sentence=(diagnosis and diagnosis.sentence) or worst.reason,
        remedy=diagnosis.remedy if diagnosis else NO_REMEDY,
        cases=() if outcome is Outcome.ABSENT else views,
    )


_PHRASES = {
    Outcome.DIFFERS: ("differs", "differ"),
    Outcome.FAILED: ("could not be run to its end", "could not be run to their end"),
    Outcome.UNRESOLVED: ("is unresolved", "are unresolved"),
    Outcome.REFUSED: ("was refused by its engine", "were refused by their engines"),
    Outcome.ABSENT: ("was not tested", "were not tested"),
}


def verdict(results: Results, collect_issues: Sequence[IssueView]) -> str:
    """Return the verdict in words and, on failure, what to do."""
    if not results.cases:
        return "Nothing was run."
    counts = Counter(case.outcome for case in results.cases if not case.accepted)
    parts = [f"{n} {said[n > 1]}" for one, said in _PHRASES.items() if (n := counts[one])]
    if accepted := sum(bool(case.accepted) for case in results.cases):
        parts.append(f"{counted(accepted, 'difference')} accepted")
    sentence = ", ".join(parts) or "every motion matches the equations"
    sentence = f"{sentence[0].upper()}{sentence[1:]}."
    if fixes := sum(len(one.remedy.changes) for one in collect_issues):
        return f"{sentence} {counted(fixes, 'number')} to change."
    has_advice = any(model.advice for model in results.models)
    return sentence if collect_issues or has_advice else f"{sentence} Nothing to change."


def standing_out(views: Iterable[CaseView]) -> Iterator[tuple[CaseView, str, str]]:
    """Yield the cases that agree with the fewest digits and with the largest global error.

    Each comes with the quantity and its value.
    """
    agreeing = [view for view in views if view.case.outcome is Outcome.AGREES and view.case.verdict]
    if agreeing:
        weakest = max(agreeing, key=lambda view: view.sorts[0] or 0.0)
        yield weakest, "fewest agreeing digits", weakest.digits
    timed = [view for view in agreeing if view.sorts[3] is not None or view.case.full_run]
    if comparable := [view for view in timed if not view.chaotic]:
        dearest = max(comparable, key=lambda view: view.sorts[3] or 0.0)
        yield dearest, f"largest error at dt ({dearest.step})", dearest.global_error
    if chaotic := [view for view in agreeing if view.chaotic]:
        what = "chaotic motions, which no time step follows to the end"
        yield chaotic[0], what, str(len(chaotic))


def implausible(models: Iterable[Model]) -> Iterable[Model]:
    """Return a model of each file with implausible numbers."""
    return {(model.folder, model.model): model for model in models if model.advice}.values()


MODEL_NOTES = frozenset({"reach", "unresolved", "rounded", "pose"})
"""Kinds of notes about the model itself, not about an engine's reading."""

MAX_NOTES = 8
"""Maximum number of notes per engine."""


@dataclass(frozen=True, kw_only=True)
class Cell:
    """A model in an engine, with its scenarios."""

    cases: Sequence[CaseView]

    @property
    def worst(self) -> CaseView:
        """The worst scenario."""
        return min(self.cases, key=lambda view: severity(view.case))

    @property
    def outcome(self) -> Outcome:
        """Outcome of the worst scenario; an accepted difference agrees."""
        case = self.worst.case
        return Outcome.AGREES if case.accepted else case.outcome

    @property
    def word(self) -> str:
        """The fewest digits if it agrees, "as accepted", or the outcome."""
        if self.worst.case.outcome is not self.outcome:
            return "as accepted"
        return self.digits if self.outcome is Outcome.AGREES else self.outcome

    @property
    def counts(self) -> str:
        """Number of scenarios with the outcome of the worst one, and of all scenarios."""
        outcome = self.worst.case.outcome
        alike = sum(view.case.outcome is outcome for view in self.cases)
        return f"{alike} of {len(self.cases)}"

    @property
    def digits(self) -> str:
        """The fewest digits."""
        digits = [view.digits for view in self.cases if view.judged]
        numeric = [one for one in digits if one not in (NOTHING, "all")]
        return min(numeric, key=float, default="all" if "all" in digits else NOTHING)

    @property
    def global_error(self) -> str:
        """The largest global error of motions that a time step can follow."""
        cases = [view for view in self.cases if view.judged and not view.chaotic]
        errors = [error for view in cases if (error := view.sorts[3]) is not None]
        if not errors and any(view.chaotic for view in self.cases):
            return CHAOTIC
        return percent(max(errors, default=None))


Row = tuple[str, str, Sequence[Cell | None]]
"""A folder, a model file of it, and its cells by engine."""


def matrix(views: Iterable[CaseView]) -> tuple[list[str], list[Row]]:
    """Return the engines of the columns, and the rows, worst systems first."""
    cells: dict[str, dict[str, dict[str, list[CaseView]]]] = {}
    columns: Counter[str] = Counter()
    for view in views:
        case = view.case
        row = cells.setdefault(case.folder, {}).setdefault(case.model, {})
        columns[case.engine] += case.engine not in row
        row.setdefault(case.engine, []).append(view)
    engines = [engine for engine, _ in columns.most_common()]

    def worst(folder: str) -> tuple[int, float]:
        rows = cells[folder].values()
        return min(severity(one.case) for row in rows for cases in row.values() for one in cases)

    return engines, [
        (folder, model, [Cell(cases=row[one]) if one in row else None for one in engines])
        for folder in sorted(cells, key=worst)
        for model, row in cells[folder].items()
    ]


def reading_notes(engines: Iterable[str], models: Iterable[Model]) -> dict[str, list[str]]:
    """Return different notes on how each engine reads files, the most frequent first."""
    counts: dict[str, Counter[str]] = {engine: Counter() for engine in engines}
    for model in models:
        for note in model.audit or ():
            if note.severity == "note" and note.kind not in MODEL_NOTES and model.engine in counts:
                counts[model.engine][note.message] += 1
    return {
        engine: [message for message, _ in notes.most_common(MAX_NOTES)]
        for engine, notes in counts.items()
        if notes
    }
