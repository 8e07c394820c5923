"""The overview: the verdict, the fixes, and the changes since the baseline."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from physics_crosscheck.harness.records.case import Case, ModelKey
from physics_crosscheck.harness.records.coverage import Coverage
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import BaselineChanges, Results
from physics_crosscheck.harness.render.html.cases import SYMBOLS, CaseView
from physics_crosscheck.harness.render.html.diagnoses import DiagnosisView
from physics_crosscheck.harness.render.html.matrix import Pair
from physics_crosscheck.harness.render.html.remedies import NO_REMEDY, Remedy
from physics_crosscheck.harness.render.html.text import shown
from physics_crosscheck.harness.results.coverage import READ
from physics_crosscheck.harness.results.issues import (
    audited_alike,
    collect_issues,
    explained_alike,
    named_models,
    untold_failures,
)
from physics_crosscheck.harness.results.status import counted

Link = tuple[str, str]
"""A permalink and its text."""

SCENARIOS_LINKED = 6
"""Maximum number of cases linked from one issue."""


@dataclass(frozen=True, kw_only=True)
class IssueView:
    """An issue, listed once for all affected cases.

    Attributes:
        id: permalink of the details; empty without one.
        outcome, symbol: outcome of its cases; AUDIT for findings without motion.
        name: name of the affected model.
        cases: number of cases.
        sentence: the problem.
        remedy: the proposed fix.
        links: affected cases.
        more: number of further affected cases.
    """

    id: str
    outcome: str
    symbol: str
    name: str
    cases: str
    sentence: str
    remedy: Remedy = NO_REMEDY
    links: tuple[Link, ...] = ()
    more: int = 0


@dataclass(frozen=True, kw_only=True)
class ChangeView:
    """Cases that differ from the baseline in the same way.

    Attributes:
        kind, message: the change.
        cases: id on the page, empty without one, and name of each.
    """

    kind: str
    message: str
    cases: tuple[tuple[str, str], ...]


@dataclass(frozen=True, kw_only=True)
class Outlier:
    """An extreme case among those that agree: the quantity and its value."""

    id: str
    what: str
    value: str
    name: str


@dataclass(frozen=True, kw_only=True)
class TestedNumbers:
    """Tested numbers of a model file, in the engine that tests most.

    Attributes:
        share: percentage of tested numbers.
        untested: reasons with their counts.
        left_out: parts of the file that are not compared.
    """

    name: str
    engine: str
    tested: int
    total: int
    share: str
    untested: tuple[tuple[str, str], ...]
    left_out: tuple[str, ...]


MAX_FILES = 4
"""Maximum number of model files whose tested numbers the overview shows."""


def tested_numbers(models: Iterable[Model]) -> tuple[TestedNumbers, ...]:
    """Return the tested numbers of each model file, the smallest shares first."""
    best: dict[tuple[str, str], tuple[Model, Coverage]] = {}
    for model in models:
        coverage, key = model.coverage, (model.folder, model.model)
        if coverage is None or not coverage.numbers:
            continue
        if key not in best or _rank(model, coverage) > _rank(*best[key]):
            best[key] = model, coverage
    rows = sorted(best.values(), key=lambda row: row[1].seen / row[1].numbers)
    return tuple(
        TestedNumbers(
            name=shown(f"{model.system}/{model.model}"),
            engine=shown(model.engine),
            tested=coverage.seen,
            total=coverage.numbers,
            share=f"{100 * coverage.seen / coverage.numbers:.3g}",
            untested=(
                *((("only " + READ, str(coverage.read)),) if coverage.read else ()),
                *((shown(one.reason), str(one.count)) for one in coverage.untested),
            ),
            left_out=tuple(map(shown, coverage.left_out)),
        )
        for model, coverage in rows[:MAX_FILES]
    )


def _rank(model: Model, coverage: Coverage) -> tuple[int, bool]:
    """Rank a model by its tested numbers, then by whether its own engine's checks count."""
    return coverage.seen, coverage.engine == model.engine


def issue_views(
    results: Results, views: Mapping[int, CaseView], diagnoses: Mapping[ModelKey, DiagnosisView]
) -> tuple[IssueView, ...]:
    """Return the issues in the terminal's order: fixable ones first, then the worst.

    Args:
        results: all results.
        views: views of the cases, by the identity of their records.
        diagnoses: diagnoses of the models that differ or have findings.
    """
    groups = [(one.worst, *one.others) for one in collect_issues(results.cases)]
    causes = list(_causes(groups, results, views, diagnoses))
    explained = {key for _, keys in causes for key in keys}
    rest: list[IssueView] = []
    for group in groups:
        unexplained = [case for case in group if not _is_covered(case, explained)]
        if unexplained:
            rest.append(_unexplained(unexplained, results, views, diagnoses))
    failures = (_failure(*one) for one in untold_failures(results))
    audits = _audits(results.models, diagnoses, explained)
    return (*(one for one, _ in causes), *rest, *failures, *audits)


def _is_covered(case: Case, explained: set[ModelKey]) -> bool:
    return case.outcome is Outcome.DIFFERS and case.key in explained


def _causes(
    groups: Sequence[Sequence[Case]],
    results: Results,
    views: Mapping[int, CaseView],
    diagnoses: Mapping[ModelKey, DiagnosisView],
) -> Iterator[tuple[IssueView, set[ModelKey]]]:
    """Yield each explaining cause of differences, with the models that it affects."""
    for alike in explained_alike(results.models):
        keys = {model.key for model in alike}
        cases = [case for group in groups for case in group if _is_covered(case, keys)]
        diagnosis = alike[0].diagnosis
        if not cases or diagnosis is None or not diagnosis.explained:
            continue
        view = diagnoses[alike[0].key]
        yield (
            IssueView(
                id=view.id,
                outcome=Outcome.DIFFERS,
                symbol=SYMBOLS[Outcome.DIFFERS],
                name=shown(named_models(alike)),
                cases=counted(len(cases), "case"),
                sentence=view.sentence,
                remedy=view.remedy,
                links=_linked(cases, views),
                more=max(0, len(cases) - SCENARIOS_LINKED),
            ),
            keys,
        )


def _linked(cases: Sequence[Case], views: Mapping[int, CaseView]) -> tuple[Link, ...]:
    """Return links to the first of some cases."""
    engines = {case.engine for case in cases}
    linked = [views[id(case)] for case in cases[:SCENARIOS_LINKED]]
    return tuple(
        (v.id, f"{v.scenario} [{v.engine}]" if len(engines) > 1 else v.scenario) for v in linked
    )


def _unexplained(
    cases: Sequence[Case],
    results: Results,
    views: Mapping[int, CaseView],
    diagnoses: Mapping[ModelKey, DiagnosisView],
) -> IssueView:
    """Return the issue of cases with the same problem and without an explaining cause."""
    worst = cases[0]
    ran = worst.outcome is not Outcome.ABSENT
    diagnosis = diagnoses.get(worst.key) if worst.outcome is Outcome.DIFFERS else None
    view = views[id(worst)]
    files = list(dict.fromkeys(f"{case.system}/{case.model}" for case in cases))
    engines = ", ".join(dict.fromkeys(case.engine for case in cases))
    name = f"{files[0]} [{engines}]" if len(files) == 1 else counted(len(files), "model file")
    sentence = diagnosis.sentence if diagnosis is not None else ""
    return IssueView(
        id=view.id if diagnosis is None else diagnosis.id,
        outcome=view.outcome,
        symbol=view.symbol,
        name=shown(name),
        cases=counted(len(cases), "case"),
        sentence=sentence or view.reason,
        remedy=NO_REMEDY if diagnosis is None else diagnosis.remedy,
        links=_linked(cases, views) if ran else (),
        more=max(0, len(cases) - SCENARIOS_LINKED) if ran else 0,
    )


def _failure(model: Model, what: str, why: str) -> IssueView:
    return IssueView(
        id="",
        outcome=Outcome.FAILED,
        symbol=SYMBOLS[Outcome.FAILED],
        name=shown(model.id),
        cases="",
        sentence=shown(f"{what}: {why}"),
    )


def _audits(
    models: Sequence[Model], diagnoses: Mapping[ModelKey, DiagnosisView], explained: set[ModelKey]
) -> Iterator[IssueView]:
    """Yield audit findings of models without an explaining cause."""
    for alike in audited_alike(models):
        if any(model.key in explained or model.accepted for model in alike):
            continue
        if any(model.unexplained_findings for model in alike):
            continue  # its cases report it
        model = alike[0]
        view = diagnoses[model.key]
        yield IssueView(
            id=view.id,
            outcome="AUDIT",
            symbol="!",
            name=shown(named_models(alike)),
            cases=counted(len(model.findings), "finding"),
            sentence=view.sentence,
            remedy=view.remedy,
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
    if fixes := sum(len(one.remedy.fixes) for one in collect_issues):
        return f"{sentence} {counted(fixes, 'number')} to change."
    return sentence if collect_issues else f"{sentence} Nothing to change."


def changes(baseline: BaselineChanges, pairs: Sequence[Pair]) -> tuple[ChangeView, ...]:
    """Return the changes since the baseline, in the order of the record, equal ones as one."""
    ids = {case.id: view.id for case, view in pairs}
    cases: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for change in baseline.changes:
        what = shown(change.label), shown("; ".join(change.messages))
        cases.setdefault(what, []).append((ids.get(change.id, ""), shown(change.id)))
    return tuple(
        ChangeView(kind=kind, message=message, cases=tuple(names))
        for (kind, message), names in cases.items()
    )


def standing_out(pairs: Sequence[Pair]) -> tuple[Outlier, ...]:
    """Return the cases that agree with the fewest digits and with the largest global error."""
    agreeing = [
        (case, view) for case, view in pairs if case.outcome is Outcome.AGREES and case.verdict
    ]
    if not agreeing:
        return ()
    weakest = max(agreeing, key=lambda pair: float(pair[1].sorts[0] or 0.0))[1]
    extremes = [
        Outlier(
            id=weakest.id,
            what="fewest agreeing digits",
            value=weakest.digits,
            name=_name(weakest),
        )
    ]
    comparable = [pair for pair in agreeing if pair[0].full_run and not pair[1].chaotic]
    if comparable:
        dearest = max(comparable, key=lambda pair: float(pair[1].sorts[3] or 0.0))[1]
        extremes.append(
            Outlier(
                id=dearest.id,
                what=f"largest error at dt ({dearest.step})",
                value=dearest.global_error,
                name=_name(dearest),
            )
        )
    if chaotic := [view for _, view in agreeing if view.chaotic]:
        extremes.append(
            Outlier(
                id=chaotic[0].id,
                what="chaotic motions, which no time step follows to the end",
                value=str(len(chaotic)),
                name=_name(chaotic[0]),
            )
        )
    return tuple(extremes)


def _name(view: CaseView) -> str:
    return f"{view.system}/{view.model}/{view.scenario} [{view.engine}]"
