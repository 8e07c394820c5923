"""What the report shows: results turned into strings and tables, ready for the template."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from harness.report.cases import SYMBOLS, CaseView, case_view, severity
from harness.report.charts import amplitudes, charts
from harness.report.systems import SystemView, system_view
from harness.report.text import quantity, shown, slug
from harness.table import summary
from harness.verdict import Outcome

Record = Mapping[str, Any]

MEANINGS = {
    Outcome.AGREES: "no difference beyond the uncertainty, and that is below the resolution",
    Outcome.ABSENT: "the engine is not installed; nothing was tested",
    Outcome.UNRESOLVED: "no difference that could be told from the uncertainty, which is too large",
    Outcome.DIFFERS: "a difference larger than its uncertainty: the model is another one",
    Outcome.FAILED: "it could not be run to its end",
}


@dataclass(frozen=True)
class Count:
    """One outcome: its sign, what it means, how many cases have it."""

    outcome: str
    symbol: str
    meaning: str
    cases: int


@dataclass(frozen=True)
class MatrixRow:
    """One model file in one engine: a cell for each scenario, None where there is no case."""

    model: str
    engine: str
    cells: tuple[CaseView | None, ...]


@dataclass(frozen=True)
class Group:
    """One folder: its rows of the matrix, its section, its cases.

    Attributes:
        id: of the section.
        name: of the system; with its folder where two systems have the same name.
        columns: scenarios.
        spare: columns that the widest system has and this one has not.
        rows: one for each model file and engine.
        about: the system itself; None where it could not be read.
    """

    id: str
    name: str
    columns: tuple[str, ...]
    spare: int
    rows: tuple[MatrixRow, ...]
    about: SystemView | None


@dataclass(frozen=True)
class Report:
    """The whole page.

    Attributes:
        absent: engines that are not installed.
        absences: (cases, reason) of what is ABSENT.
        troubled: cases that are neither ABSENT nor AGREES, worst first.
        groups: in the order of the run.
    """

    title: str
    summary: str
    created: str
    resolution: str
    versions: tuple[tuple[str, str], ...]
    absent: tuple[str, ...]
    counts: tuple[Count, ...]
    absences: tuple[tuple[int, str], ...]
    troubled: tuple[CaseView, ...]
    groups: tuple[Group, ...]

    @property
    def cases(self) -> tuple[CaseView, ...]:
        """Every case, in the order of the page."""
        rows = (row for group in self.groups for row in group.rows)
        return tuple(cell for row in rows for cell in row.cells if cell is not None)


def report(found: Record) -> Report:
    """The view of results."""
    systems = {system["folder"]: system for system in found["systems"]}
    folders = dict.fromkeys([*systems, *(case["folder"] for case in found["cases"])])
    names = {case["folder"]: case["system"] for case in found["cases"]}
    names |= {folder: system["name"] for folder, system in systems.items()}
    views = _views(found["cases"], systems)
    columns = {folder: _columns(folder, found["cases"], systems) for folder in folders}
    width = max((len(each) for each in columns.values()), default=0)
    ids = _Ids()
    groups = []
    for folder in folders:
        cases = [
            (c, v) for c, v in zip(found["cases"], views, strict=True) if c["folder"] == folder
        ]
        models = [model for model in found["models"] if model["folder"] == folder]
        system = systems.get(folder)
        groups.append(
            Group(
                id=ids.new(f"system-{slug(names[folder])}"),
                name=_name(folder, names),
                columns=tuple(shown(column) for column in columns[folder]),
                spare=width - len(columns[folder]),
                rows=_rows(cases, columns[folder]),
                about=None if system is None else system_view(system, models),
            )
        )
    worst_first = sorted(
        zip(found["cases"], views, strict=True), key=lambda pair: severity(pair[0])
    )
    counts = Counter(case["outcome"] for case in found["cases"])
    absences = Counter(c["reason"] for c in found["cases"] if c["outcome"] == Outcome.ABSENT)
    versions = found["versions"]
    return Report(
        title=f"{counts[Outcome.AGREES]} of {len(views)} cases agree",
        summary=shown(summary(found)),
        created=shown(found["created"]),
        resolution=quantity(found["resolution"], ""),
        versions=tuple((shown(k), shown(v)) for k, v in versions.items() if v is not None),
        absent=tuple(shown(k) for k, v in versions.items() if v is None),
        counts=tuple(Count(o, SYMBOLS[o], MEANINGS[o], counts[o]) for o in Outcome),
        absences=tuple((count, shown(reason)) for reason, count in absences.items()),
        troubled=tuple(
            view
            for case, view in worst_first
            if case["outcome"] not in (Outcome.AGREES, Outcome.ABSENT)
        ),
        groups=tuple(groups),
    )


class _Ids:
    """Ids of which none is given twice: a repeated one gets a number."""

    def __init__(self) -> None:
        self._given: Counter[str] = Counter()

    def new(self, wanted: str) -> str:
        self._given[wanted] += 1
        count = self._given[wanted]
        # No slug has an equals sign.
        return wanted if count == 1 else f"{wanted}={count}"


def _views(cases: Sequence[Record], systems: Mapping[str, Record]) -> list[CaseView]:
    reach = amplitudes(cases)
    ids = _Ids()
    views = []
    for place, case in enumerate(cases):
        system = systems.get(case["folder"])
        scenarios = [] if system is None else system["scenarios"]
        scenario = next((s for s in scenarios if s["name"] == case["scenario"]), None)
        name = slug(case["system"], case["model"], case["engine"], case["scenario"])
        drawn = charts(case, _units(case, system), reach.get(case["folder"], []))
        views.append(case_view(case, ids.new(f"case-{name}"), f"plots-{place}", scenario, drawn))
    return views


def _units(case: Record, system: Record | None) -> list[str]:
    """Units of the components: the coordinates', then those of their rates."""
    if case["series"] is None:
        return []
    if system is None:
        return ["?"] * len(case["series"]["components"])
    units = [coordinate["unit"] for coordinate in system["coordinates"]]
    return units + [f"{unit}/s" for unit in units]


def _name(folder: str, names: Mapping[str, str]) -> str:
    name = names[folder]
    alone = list(names.values()).count(name) == 1
    return shown(name if alone else f"{name} in {folder}")


def _columns(folder: str, cases: Sequence[Record], systems: Mapping[str, Record]) -> list[str]:
    declared = [s["name"] for s in systems[folder]["scenarios"]] if folder in systems else []
    run = [case["scenario"] for case in cases if case["folder"] == folder]
    return [name for name in dict.fromkeys([*declared, *run]) if name in run]


def _rows(
    cases: Sequence[tuple[Record, CaseView]], columns: Sequence[str]
) -> tuple[MatrixRow, ...]:
    """Rows in the order of the cases; a case whose place is taken begins a further row."""
    rows: dict[tuple[str, str, int], dict[str, CaseView]] = {}
    for case, view in cases:
        again = 0
        while case["scenario"] in rows.get((case["model"], case["engine"], again), {}):
            again += 1
        rows.setdefault((case["model"], case["engine"], again), {})[case["scenario"]] = view
    return tuple(
        MatrixRow(shown(model), shown(engine), tuple(cells.get(column) for column in columns))
        for (model, engine, _), cells in rows.items()
    )
