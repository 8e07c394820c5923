"""What the overview shows: what needs a look, and what changed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass

from harness.records.case import ModelKey
from harness.records.model import Model
from harness.records.outcome import Outcome
from harness.records.results import BaselineChanges
from harness.report.cases import SYMBOLS, CaseView
from harness.report.diagnoses import DiagnosisView
from harness.report.matrix import Pair
from harness.report.text import shown


@dataclass(frozen=True, kw_only=True)
class Trouble:
    """Something to act on: a model, or what was not run.

    Attributes:
        id: where to read on; empty for nowhere.
        name: of the model; empty for what concerns several.
        cases: how many cases, of how many.
        sentence: what is wrong.
    """

    id: str
    outcome: str
    symbol: str
    name: str
    cases: str
    sentence: str


@dataclass(frozen=True, kw_only=True)
class Change:
    """One case that is not as in the baseline."""

    id: str
    kind: str
    name: str
    message: str


def troubles(
    worst_first: Sequence[Pair],
    models: Sequence[Model],
    diagnoses: Mapping[ModelKey, DiagnosisView],
) -> tuple[Trouble, ...]:
    """What to act on: each model of which a case does not agree, or with an audit finding."""
    rows: dict[tuple[ModelKey, Outcome], list[Pair]] = {}
    totals: Counter[ModelKey] = Counter()
    for case, view in worst_first:
        key = case.key
        totals[key] += 1
        if case.outcome not in (Outcome.AGREES, Outcome.ABSENT):
            rows.setdefault((key, case.outcome), []).append((case, view))
    found = []
    diagnosed = set()
    for (key, outcome), pairs in rows.items():
        diagnosis = diagnoses.get(key) if outcome is Outcome.DIFFERS else None
        if diagnosis is not None and diagnosis.sentence:
            diagnosed.add(key)
        found.append(_model_trouble([view for _, view in pairs], diagnosis, totals[key]))
    undone = _undone(models, {case.reason for case, _ in worst_first})
    audits = _audit_troubles(models, diagnoses, diagnosed)
    return (*found, *undone, *_absences(worst_first), *audits)


def _model_trouble(
    views: Sequence[CaseView], diagnosis: DiagnosisView | None, total: int
) -> Trouble:
    """What is wrong with a model: its cases of one outcome, worst first, of `total`."""
    view = views[0]
    sentence = diagnosis.sentence if diagnosis is not None else ""
    sentence = sentence or view.reason
    return Trouble(
        id=view.id if diagnosis is None else diagnosis.id,
        outcome=view.outcome,
        symbol=view.symbol,
        name=f"{view.system}/{view.model} [{view.engine}]",
        cases=f"{len(views)} of {total}",
        sentence=f"{sentence} Accepted: {view.accepted}" if view.accepted else sentence,
    )


def _undone(models: Sequence[Model], told: Set[str]) -> Iterator[Trouble]:
    """What could not be done beside the cases, but for what they tell already."""
    for model in models:
        for what, why in model.failures:
            if why not in told:
                yield Trouble(
                    id="",
                    outcome=Outcome.FAILED,
                    symbol=SYMBOLS[Outcome.FAILED],
                    name=shown(model.id),
                    cases="",
                    sentence=shown(f"{what}: {why}"),
                )


def _absences(pairs: Sequence[Pair]) -> Iterator[Trouble]:
    reasons = Counter(case.reason for case, _ in pairs if case.outcome is Outcome.ABSENT)
    for reason, count in reasons.items():
        yield Trouble(
            id="",
            outcome=Outcome.ABSENT,
            symbol=SYMBOLS[Outcome.ABSENT],
            name="",
            cases=str(count),
            sentence=shown(reason),
        )


def _audit_troubles(
    models: Sequence[Model], diagnoses: Mapping[ModelKey, DiagnosisView], diagnosed: set[ModelKey]
) -> Iterator[Trouble]:
    """Of the models that no case has led to yet."""
    for model in models:
        view = diagnoses.get(model.key)
        if view is not None and model.key not in diagnosed:
            yield Trouble(
                id=view.id,
                outcome="AUDIT",
                symbol="!",
                name=f"{view.system}/{view.model} [{view.engine}]",
                cases="",
                sentence=view.sentence,
            )


def changes(baseline: BaselineChanges, pairs: Sequence[Pair]) -> tuple[Change, ...]:
    """What changed since the baseline, in the order of the record."""
    ids = {case.id: view.id for case, view in pairs}
    return tuple(
        Change(
            id=ids.get(change.id, ""),
            kind=shown(change.kind),
            name=shown(change.id),
            message=shown(change.message),
        )
        for change in baseline.changes
    )
