"""The overview: the verdict, the fixes, and the changes since the baseline."""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from physics_crosscheck.harness.records.case import Case, ModelKey
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import BaselineChanges, Results
from physics_crosscheck.harness.render.html.cases import SYMBOLS, CaseView
from physics_crosscheck.harness.render.html.diagnoses import DiagnosisView
from physics_crosscheck.harness.render.html.matrix import Pair
from physics_crosscheck.harness.render.html.text import shown
from physics_crosscheck.harness.results.issues import (
    audited_alike,
    collect_issues,
    explained_alike,
    named_models,
    untold_failures,
)
from physics_crosscheck.harness.results.next_steps import ProposedChange, changes_of, stated_changes
from physics_crosscheck.harness.results.places import is_spelled
from physics_crosscheck.harness.results.status import counted

Link = tuple[str, str]
"""A permalink and its text."""

SCENARIOS_LINKED = 6
"""Maximum number of cases linked from one issue."""


@dataclass(frozen=True, kw_only=True)
class Fix:
    """A number to change: location, name, old and new value."""

    place: str
    name: str
    old: str
    new: str


@dataclass(frozen=True, kw_only=True)
class Remedy:
    """A proposed fix.

    Attributes:
        fixes: numbers to change; empty if unknown.
        lines: changed lines with + and -.
        patch: a unified diff; empty if a change is uncertain.
    """

    fixes: tuple[Fix, ...] = ()
    lines: tuple[str, ...] = ()
    patch: str = ""

    @property
    def words(self) -> str:
        """The numbers, a line each, without a patch."""
        return "\n".join(f"{fix.place} from {fix.old} to {fix.new}" for fix in self.fixes)


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
    remedy: Remedy = Remedy()
    links: tuple[Link, ...] = ()
    more: int = 0


@dataclass(frozen=True, kw_only=True)
class ChangeView:
    """A case that differs from the baseline."""

    id: str
    kind: str
    name: str
    message: str


@dataclass(frozen=True, kw_only=True)
class Outlier:
    """An extreme case among those that agree: the quantity and its value."""

    id: str
    what: str
    value: str
    name: str


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
        changes = changes_of(alike[0])
        whole = len(changes) == len(diagnosis.explanations[0].causes)
        yield (
            IssueView(
                id=view.id,
                outcome=Outcome.DIFFERS,
                symbol=SYMBOLS[Outcome.DIFFERS],
                name=shown(named_models(alike)),
                cases=counted(len(cases), "case"),
                sentence=view.sentence,
                remedy=_remedy(changes, alike[0], whole=whole),
                links=_linked(cases, views),
                more=max(0, len(cases) - SCENARIOS_LINKED),
            ),
            keys,
        )


def _remedy(changes: Sequence[ProposedChange], model: Model, *, whole: bool) -> Remedy:
    """Return changes with their patch; `whole`: whether they fix the model completely."""
    texts = ((model.model, model.text), (f"{model.model}.toml", model.sidecar))
    patch = unified(changes, texts) if whole and changes else ""
    if not _is_shown_as_is(patch):
        patch = ""
    return Remedy(
        fixes=tuple(map(_fix, changes)),
        lines=tuple(map(shown, lines_of(patch))),
        patch=patch,
    )


def _is_shown_as_is(patch: str) -> bool:
    """Return whether a page can show a patch unchanged; otherwise it would not apply."""
    plain = patch.replace("\r\n", "\n")
    return shown(plain) == plain and "\ufffd" not in plain


def _fix(change: ProposedChange) -> Fix:
    return Fix(
        place=shown(", ".join(dict.fromkeys(map(str, change.locations)))),
        name=shown(", ".join(change.subject)),
        old=f"{change.old:.10g}",
        new=shown(change.new),
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
        remedy=Remedy() if diagnosis is None else _stated(results.model_of(worst)),
        links=_linked(cases, views) if ran else (),
        more=max(0, len(cases) - SCENARIOS_LINKED) if ran else 0,
    )


def _stated(model: Model | None) -> Remedy:
    """Return the changes that the audit proposes."""
    return Remedy() if model is None else _remedy(stated_changes(model), model, whole=True)


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
            remedy=_stated(model),
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
    counts = Counter(case.outcome for case in results.cases)
    parts = [f"{n} {said[n > 1]}" for one, said in _PHRASES.items() if (n := counts[one])]
    if accepted := sum(bool(case.accepted) for case in results.cases):
        parts.append(f"{accepted} accepted as known")
    sentence = ", ".join(parts) or "every motion matches the equations"
    sentence = f"{sentence[0].upper()}{sentence[1:]}."
    if fixes := sum(len(one.remedy.fixes) for one in collect_issues):
        return f"{sentence} {counted(fixes, 'number')} to change."
    return sentence if collect_issues else f"{sentence} Nothing to change."


def changes(baseline: BaselineChanges, pairs: Sequence[Pair]) -> tuple[ChangeView, ...]:
    """Return the changes since the baseline, in the order of the record."""
    ids = {case.id: view.id for case, view in pairs}
    return tuple(
        ChangeView(
            id=ids.get(change.id, ""),
            kind=shown(change.label),
            name=shown(change.id),
            message=shown("; ".join(change.messages)),
        )
        for change in baseline.changes
    )


def standing_out(pairs: Sequence[Pair]) -> tuple[Outlier, ...]:
    """Return the cases that agree with the fewest digits and with the largest global error."""
    agreeing = [
        (case, view)
        for case, view in pairs
        if case.outcome is Outcome.AGREES and case.verdict and case.full_run
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
    comparable = [pair for pair in agreeing if not pair[1].chaotic]
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


def unified(edits: Sequence[ProposedChange], texts: Iterable[tuple[str, str]]) -> str:
    """Return a unified diff that makes edits; empty if an edit is uncertain.

    An edit is certain if the file still has the old text in the span of each location.

    Args:
        edits: edits of one cause.
        texts: (name, text) of the files that may be edited.
    """
    parts, edit_count = [], 0
    for name, text in texts:
        data = text.encode(errors="surrogatepass")
        here = [
            (where.span, edit.new, where.file)
            for edit in edits
            for where in edit.locations
            if where.span is not None and is_spelled(where, name, data)
        ]
        edit_count += len(here)
        changed = data
        for (start, end), new, _ in sorted(here, reverse=True):
            changed = changed[:start] + new.encode() + changed[end:]
        if changed != data:
            parts.append(
                _diff(here[0][2], _lines(text), _lines(changed.decode(errors="surrogatepass")))
            )
    certain = edit_count == sum(len(edit.locations) for edit in edits)
    return "".join(parts) if certain else ""


def lines_of(patch: str) -> tuple[str, ...]:
    """Return the removed and added lines of a diff with their signs, with less indentation."""
    rows = (row for row in _lines(patch) if not row.startswith(("--- ", "+++ ")))
    changed_rows = [(row[0], row[1:].rstrip("\r\n")) for row in rows if row.startswith(("-", "+"))]
    margin = min((len(text) - len(text.lstrip()) for _, text in changed_rows), default=0)
    return tuple(f"{sign} {text[margin:]}" for sign, text in changed_rows)


def _lines(text: str) -> list[str]:
    """Split text into lines as `git` and `patch` do: `str.splitlines` splits at more characters."""
    *whole, last = text.split("\n")
    return [*(f"{line}\n" for line in whole), *([last] if last else [])]


def _diff(path: str, before: Sequence[str], after: Sequence[str]) -> str:
    """Return a diff with three lines of context for `git apply` and `patch -p1`."""
    # Both reject an absolute path.
    name = path if not path.startswith("/") and ":" not in path else path.rsplit("/", 1)[-1]
    end = "\t" if " " in name else ""  # a tab ends a name with blanks
    rows = []
    for row in difflib.unified_diff(before, after, f"a/{name}{end}", f"b/{name}{end}"):
        rows.append(row if row.endswith("\n") else f"{row}\n\\ No newline at end of file\n")
    return "".join(rows)
