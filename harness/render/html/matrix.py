"""Table of models by engines: verdicts, costs, and notes about reading files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.render.html.cases import CaseView, severity
from physics_crosscheck.harness.render.html.text import NOTHING, percent
from physics_crosscheck.harness.render.terminal.models_table import CHAOTIC

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
        runs = [view.case.full_run for view in self.cases if view.judged and not view.chaotic]
        errors = [run.global_error for run in runs if run and run.global_error is not None]
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


def reading_notes(engine: str, models: Iterable[Model]) -> list[str]:
    """Return different notes on how an engine reads files, the most frequent first."""
    counts = Counter(
        note.message
        for model in models
        if model.engine == engine
        for note in model.audit or ()
        if note.severity == "note" and note.kind not in MODEL_NOTES
    )
    return [message for message, _ in counts.most_common(MAX_NOTES)]
