"""What the overview shows: the matrix of systems by models, what needs a look, what changed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from harness.records.outcome import Outcome
from harness.report.cases import SYMBOLS, CaseView, severity
from harness.report.diagnoses import DiagnosisView
from harness.report.text import NOTHING, agreeing_digits, percent, shown

Record = Mapping[str, Any]
Pair = tuple[Record, CaseView]
Key = tuple[str, str, str]


@dataclass(frozen=True)
class Cell:
    """A system in one model and engine: the worst of its scenarios.

    Attributes:
        id: permalink of the worst case.
        outcome, symbol: its own.
        counts: how many scenarios have its outcome, of how many.
        digits: the fewest.
        raw_error: the largest.
        told: all of these in words.
        about: system, model and engine, as the list of cases has them.
    """

    id: str
    outcome: str
    symbol: str
    counts: str
    digits: str
    raw_error: str
    told: str
    about: str


@dataclass(frozen=True)
class MatrixRow:
    """One system."""

    id: str
    name: str
    cells: tuple[Cell | None, ...]


@dataclass(frozen=True)
class Matrix:
    """Systems by models: columns are (model file, engine); worst systems first."""

    columns: tuple[tuple[str, str], ...]
    rows: tuple[MatrixRow, ...]


@dataclass(frozen=True)
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


@dataclass(frozen=True)
class Change:
    """One case that is not as in the baseline."""

    id: str
    kind: str
    name: str
    message: str


def matrix(pairs: Sequence[Pair], ids: Mapping[str, str], names: Mapping[str, str]) -> Matrix:
    """The matrix of cases.

    Args:
        ids: of each folder's page.
        names: of each folder's system.
    """
    cells: dict[str, dict[tuple[str, str], list[Pair]]] = {}
    columns: Counter[tuple[str, str]] = Counter()
    for case, view in pairs:
        column = case["model"], case["engine"]
        row = cells.setdefault(case["folder"], {})
        columns[column] += column not in row
        row.setdefault(column, []).append((case, view))
    order = [column for column, _ in columns.most_common()]
    folders = sorted(
        cells, key=lambda folder: min(severity(c) for row in cells[folder].values() for c, _ in row)
    )
    return Matrix(
        tuple((shown(model), shown(engine)) for model, engine in order),
        tuple(
            MatrixRow(
                ids[folder],
                names[folder],
                tuple(_cell(cells[folder].get(column)) for column in order),
            )
            for folder in folders
        ),
    )


def _cell(pairs: Sequence[Pair] | None) -> Cell | None:
    if not pairs:
        return None
    worst, view = min(pairs, key=lambda pair: severity(pair[0]))
    outcome = worst["outcome"]
    alike = sum(case["outcome"] == outcome for case, _ in pairs)
    judged = [case for case, v in pairs if v.judged]
    digits = [agreeing_digits(case["discrepancy"], case["uncertainty"]) for case in judged]
    fewest = min(
        (d for d in digits if d not in (NOTHING, "all")),
        key=float,
        default="all" if "all" in digits else NOTHING,
    )
    raw = [case["raw_error"] for case in judged if case["raw_error"] is not None]
    largest = percent(max(raw, default=None))
    counts = f"{alike} of {len(pairs)}"
    told = f"{counts} {outcome}, {fewest} digits, raw error {largest}, {view.scenario} worst"
    about = f"{view.system} {view.model} {view.engine}"
    return Cell(view.id, outcome, SYMBOLS[outcome], counts, fewest, largest, told, about)


def troubles(
    worst_first: Sequence[Pair],
    models: Sequence[Record],
    diagnoses: Mapping[Key, DiagnosisView],
) -> tuple[Trouble, ...]:
    """What to act on: each model of which a case does not agree, or with an audit finding."""
    rows: dict[tuple[Key, str], list[Pair]] = {}
    totals: Counter[Key] = Counter()
    for case, view in worst_first:
        key = case["folder"], case["model"], case["engine"]
        totals[key] += 1
        if case["outcome"] not in (Outcome.AGREES, Outcome.ABSENT):
            rows.setdefault((key, case["outcome"]), []).append((case, view))
    found = []
    told = set()
    for (key, outcome), pairs in rows.items():
        case, view = pairs[0]
        diagnosis = diagnoses.get(key) if outcome == Outcome.DIFFERS else None
        sentence = view.reason
        if diagnosis is not None and diagnosis.sentence:
            sentence = diagnosis.sentence
            told.add(key)
        if view.accepted:
            sentence = f"{sentence} Accepted: {view.accepted}"
        found.append(
            Trouble(
                view.id if diagnosis is None else diagnosis.id,
                outcome,
                view.symbol,
                f"{view.system}/{view.model} [{view.engine}]",
                f"{len(pairs)} of {totals[key]}",
                sentence,
            )
        )
    absent = Counter(case["reason"] for case, _ in worst_first if case["outcome"] == Outcome.ABSENT)
    found += [
        Trouble("", str(Outcome.ABSENT), SYMBOLS[Outcome.ABSENT], "", str(count), shown(reason))
        for reason, count in absent.items()
    ]
    for model in models:
        key = model["folder"], model["model"], model["engine"]
        if key in diagnoses and key not in told:
            view_of = diagnoses[key]
            found.append(
                Trouble(
                    view_of.id,
                    "AUDIT",
                    "!",
                    f"{view_of.system}/{view_of.model} [{view_of.engine}]",
                    "",
                    view_of.sentence,
                )
            )
    return tuple(found)


def changes(baseline: Record, pairs: Sequence[Pair]) -> tuple[Change, ...]:
    """What changed since the baseline, in the order of the record."""
    fields = ("system", "model", "engine", "scenario")
    ids = {tuple(case[name] for name in fields): view.id for case, view in pairs}
    return tuple(
        Change(
            ids.get(tuple(change[name] for name in fields), ""),
            shown(change["kind"]),
            shown("{system}/{model}/{scenario} [{engine}]".format(**change)),
            shown(change["message"]),
        )
        for change in baseline["changes"]
    )
