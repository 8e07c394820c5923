"""Table of models by engines: verdicts, costs, and notes about reading files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.render.html.cases import (
    SYMBOLS,
    CaseView,
    digits_of,
    severity,
)
from physics_crosscheck.harness.render.html.text import NOTHING, percent, shown
from physics_crosscheck.harness.render.terminal.models_table import CHAOTIC

Pair = tuple[Case, CaseView]

MODEL_NOTES = frozenset({"reach", "unresolved", "rounded", "pose"})
"""Kinds of notes about the model itself, not about an engine's reading."""

MAX_NOTES = 8
"""Maximum number of notes per engine."""


@dataclass(frozen=True, kw_only=True)
class Cell:
    """A model in an engine: the worst of its scenarios.

    Attributes:
        id: permalink of the worst case.
        outcome, symbol: outcome of the worst case; that of an agreeing one if it is accepted.
        word: the fewest digits, the outcome, or "as accepted".
        counts: number of scenarios with this outcome, and of all scenarios.
        digits: the fewest digits.
        tint: the digits as colour; empty if none agree.
        global_error: the largest global error of motions that a time step can follow.
        cost: the longest wall-clock time per simulated second; empty if unknown.
        summary: all of these in words.
        about: system, model and engine, as in the list of cases.
    """

    id: str
    outcome: str
    symbol: str
    word: str
    counts: str
    digits: str
    tint: str
    global_error: str
    cost: str
    summary: str
    about: str


@dataclass(frozen=True, kw_only=True)
class MatrixRow:
    """One model.

    Attributes:
        id: id of its system's page.
        name: name of its system.
        first: whether it is the first of its system.
        model: its file.
        cells: cells by engine.
    """

    id: str
    name: str
    first: bool
    model: str
    cells: tuple[Cell | None, ...]


@dataclass(frozen=True, kw_only=True)
class ReadingNotes:
    """Notes on how an engine or its adapter reads files."""

    engine: str
    notes: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class EngineMatrix:
    """Models by engines, worst systems first.

    Attributes:
        engines: names of the columns.
        rows: the models.
        readings: engines with notes.
    """

    engines: tuple[str, ...]
    rows: tuple[MatrixRow, ...]
    readings: tuple[ReadingNotes, ...]


def matrix(
    pairs: Sequence[Pair],
    models: Sequence[Model],
    ids: Mapping[str, str],
    names: Mapping[str, str],
) -> EngineMatrix:
    """Return the matrix of cases.

    Args:
        pairs: the cases, with their views.
        models: models in their engines.
        ids: id of each folder's page.
        names: name of each folder's system.
    """
    cells: dict[str, dict[str, dict[str, list[Pair]]]] = {}
    columns: Counter[str] = Counter()
    for case, view in pairs:
        row = cells.setdefault(case.folder, {}).setdefault(case.model, {})
        columns[case.engine] += case.engine not in row
        row.setdefault(case.engine, []).append((case, view))
    engines = [engine for engine, _ in columns.most_common()]
    rows = []
    for folder in sorted(cells, key=lambda one: _worst(cells[one])):
        for k, (model, row) in enumerate(cells[folder].items()):
            rows.append(
                MatrixRow(
                    id=ids[folder],
                    name=names[folder],
                    first=k == 0,
                    model=shown(model),
                    cells=tuple(_cell(row.get(engine)) for engine in engines),
                )
            )
    engine_notes = {engine: _notes(engine, models) for engine in engines}
    return EngineMatrix(
        engines=tuple(map(shown, engines)),
        rows=tuple(rows),
        readings=tuple(
            ReadingNotes(engine=shown(engine), notes=notes)
            for engine, notes in engine_notes.items()
            if notes
        ),
    )


def _worst(models: Mapping[str, Mapping[str, Sequence[Pair]]]) -> tuple[int, float]:
    every = (case for row in models.values() for pairs in row.values() for case, _ in pairs)
    return min(map(severity, every))


def _notes(engine: str, models: Sequence[Model]) -> tuple[str, ...]:
    """Return distinct notes, the most frequent first."""
    counts = Counter(
        note.message
        for model in models
        if model.engine == engine
        for note in model.audit or ()
        if note.severity == "note" and note.kind not in MODEL_NOTES
    )
    return tuple(shown(message) for message, _ in counts.most_common(MAX_NOTES))


def _cell(pairs: Sequence[Pair] | None) -> Cell | None:
    if not pairs:
        return None
    worst, view = min(pairs, key=lambda pair: severity(pair[0]))
    accepted = bool(worst.accepted) and worst.outcome is not Outcome.AGREES
    outcome = Outcome.AGREES if accepted else worst.outcome
    alike = sum(case.outcome is worst.outcome for case, _ in pairs)
    judged = [case for case, v in pairs if v.judged]
    digits = [digits_of(case) for case in judged]
    numeric = [d for d in digits if d not in (NOTHING, "all")]
    fewest = min(numeric, key=float, default="all" if "all" in digits else NOTHING)
    largest = _largest_error(pairs)
    costs = [took for case in judged if (took := _cost(case)) is not None]
    cost = _pace(max(costs)) if costs else ""
    counts = f"{alike} of {len(pairs)}"
    stated = f"{worst.outcome}, {worst.accepted}" if accepted else worst.outcome
    agrees = outcome is Outcome.AGREES
    return Cell(
        id=view.id,
        outcome=outcome,
        symbol=SYMBOLS[outcome],
        word="as accepted" if accepted else fewest if agrees else outcome,
        counts=counts,
        digits=fewest,
        tint=fewest if numeric else "",
        global_error=largest,
        cost=cost,
        summary=(
            f"{counts} {stated}, {fewest} digits, error at dt {largest}, {view.scenario} worst"
        ),
        about=f"{view.system} {view.model} {view.engine}",
    )


def _largest_error(pairs: Sequence[Pair]) -> str:
    """Return the largest global error that depends on the time step."""
    errors = [
        case.full_run.global_error
        for case, view in pairs
        if view.judged and not view.chaotic and case.full_run is not None
    ]
    finite = [error for error in errors if error is not None]
    if not finite and any(view.chaotic for _, view in pairs):
        return CHAOTIC
    return percent(max(finite, default=None))


def _pace(cost: float) -> str:
    """Format the time per simulated second."""
    return f"{cost:.2g} s/s" if cost >= 0.1 else f"{1e3 * cost:.2g} ms/s"


def _cost(case: Case) -> float | None:
    """Return the engine's wall-clock seconds per simulated second, at the model's time step."""
    series = case.series
    if series is None or not series.full_runs.seconds or not series.t:
        return None
    took, until = series.full_runs.seconds[0], series.t[-1]
    return None if took is None or not until else took / until
