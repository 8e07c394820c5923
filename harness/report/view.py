"""What the report shows: results turned into strings and tables, ready for the template."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from harness.records.outcome import Outcome
from harness.report.cases import SYMBOLS, CaseView, case_view, severity
from harness.report.content import Content
from harness.report.diagnoses import DiagnosisView, diagnosis_view
from harness.report.overview import Change, Matrix, Trouble, changes, matrix, troubles
from harness.report.systems import SystemView, system_view
from harness.report.text import quantity, shown, slug
from harness.text.table import summary

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
class Beside:
    """Other cases that a reader may want next: (permalink, what)."""

    engines: tuple[tuple[str, str], ...]
    scenarios: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class ModelGroup:
    """One model file in one engine, with its cases and what is wrong with it."""

    model: str
    engine: str
    diagnosis: DiagnosisView | None
    cases: tuple[tuple[CaseView, Beside], ...]


@dataclass(frozen=True)
class Group:
    """One folder: its page, and those of its models.

    Attributes:
        id: of its page.
        name: of the system; with its folder where two systems have the same name.
        models: one for each model file and engine.
        about: the system itself; None where it could not be read.
    """

    id: str
    name: str
    models: tuple[ModelGroup, ...]
    about: SystemView | None


@dataclass(frozen=True)
class Report:
    """The whole page.

    Attributes:
        settings: (what, value) of the run.
        absent: engines that are not installed.
        troubles: what needs a look, worst first.
        changes: since the baseline; None without one.
        baseline: which one.
        matrix: systems by models.
        cases: every case, worst first.
        groups: in the order of the run.
        packs: numbers and plots, by the ids of their elements.
    """

    title: str
    summary: str
    settings: tuple[tuple[str, str], ...]
    absent: tuple[str, ...]
    counts: tuple[Count, ...]
    troubles: tuple[Trouble, ...]
    changes: tuple[Change, ...] | None
    baseline: str
    matrix: Matrix
    cases: tuple[CaseView, ...]
    engines: tuple[str, ...]
    systems: tuple[str, ...]
    groups: tuple[Group, ...]
    packs: Mapping[str, str]


def report(found: Record) -> Report:
    """The view of results."""
    systems = {system["folder"]: system for system in found["systems"]}
    folders = list(dict.fromkeys([*systems, *(case["folder"] for case in found["cases"])]))
    names = {case["folder"]: case["system"] for case in found["cases"]}
    names |= {folder: system["name"] for folder, system in systems.items()}
    ids = _Ids()
    content = Content(found)
    groups_ids = {folder: ids.new(f"system-{slug(names[folder])}") for folder in folders}
    views = _views(found["cases"], systems, ids, content)
    pairs = list(zip(found["cases"], views, strict=True))
    diagnoses = _diagnoses(found["models"], pairs, ids, content)
    worst_first = sorted(pairs, key=lambda pair: severity(pair[0]))
    counts = Counter(case["outcome"] for case in found["cases"])
    by_folder: dict[str, list[tuple[Record, CaseView]]] = {folder: [] for folder in folders}
    for case, view in pairs:
        by_folder[case["folder"]].append((case, view))
    groups = []
    for folder in folders:
        models = [model for model in found["models"] if model["folder"] == folder]
        about = None
        if folder in systems:
            about = system_view(systems[folder], models, content.system_pack(folder))
        groups.append(
            Group(
                groups_ids[folder],
                _name(folder, names),
                _model_groups(folder, by_folder[folder], diagnoses),
                about,
            )
        )
    shown_names = {folder: _name(folder, names) for folder in folders}
    baseline = found.get("baseline")
    return Report(
        title=f"{counts[Outcome.AGREES]} of {len(views)} cases agree",
        summary=shown(summary(found)),
        settings=(
            ("created", shown(found["created"])),
            ("resolution asked", quantity(found["resolution"], "")),
            *((shown(k), shown(v)) for k, v in found["versions"].items() if v is not None),
        ),
        absent=tuple(shown(k) for k, v in found["versions"].items() if v is None),
        counts=tuple(Count(o, SYMBOLS[o], MEANINGS[o], counts[o]) for o in Outcome),
        troubles=troubles(worst_first, found["models"], diagnoses),
        changes=None if baseline is None else changes(baseline, pairs),
        baseline="" if baseline is None else shown(baseline.get("name") or "the baseline"),
        matrix=matrix(pairs, groups_ids, shown_names),
        cases=tuple(view for _, view in worst_first),
        engines=tuple(sorted({view.engine for view in views})),
        systems=tuple(dict.fromkeys(view.system for view in views)),
        groups=tuple(groups),
        packs=content.packs(),
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


def _views(
    cases: Sequence[Record], systems: Mapping[str, Record], ids: _Ids, content: Content
) -> list[CaseView]:
    scenarios = {
        (folder, scenario["name"]): scenario
        for folder, system in systems.items()
        for scenario in system["scenarios"]
    }
    return [
        case_view(
            case,
            ids.new(f"case-{slug(*(case[k] for k in ('system', 'model', 'engine', 'scenario')))}"),
            content.case_pack(place),
            scenarios.get((case["folder"], case["scenario"])),
        )
        for place, case in enumerate(cases)
    ]


Key = tuple[str, str, str]


def _key(record: Record) -> Key:
    return record["folder"], record["model"], record["engine"]


def _diagnoses(
    models: Sequence[Record], pairs: Sequence[tuple[Record, CaseView]], ids: _Ids, content: Content
) -> dict[Key, DiagnosisView]:
    """Of the models that a motion or the audit finds wrong."""
    differing: dict[Key, list[tuple[str, str]]] = {}
    for case, view in pairs:
        if case["outcome"] == Outcome.DIFFERS:
            differing.setdefault(_key(case), []).append((view.id, view.scenario))
    found = {}
    for place, model in enumerate(models):
        audited = any(entry["severity"] == "finding" for entry in model.get("audit") or ())
        if model.get("diagnosis") or audited:
            name = slug(model["system"], model["model"], model["engine"])
            found[_key(model)] = diagnosis_view(
                model,
                ids.new(f"diagnosis-{name}"),
                content.diagnosis_pack(place),
                differing.get(_key(model), ()),
            )
    return found


BESIDE = 12
"""Links to other cases at most: a longer row is no help."""


def _model_groups(
    folder: str, pairs: Sequence[tuple[Record, CaseView]], diagnoses: Mapping[Key, DiagnosisView]
) -> tuple[ModelGroup, ...]:
    rows: dict[Key, list[tuple[Record, CaseView]]] = {}
    same: dict[str, list[CaseView]] = {}
    for case, view in pairs:
        rows.setdefault(_key(case), []).append((case, view))
        same.setdefault(case["scenario"], []).append(view)
    groups = []
    for key, mine in rows.items():
        cases = []
        for case, view in mine:
            engines = [v for v in same[case["scenario"]] if v is not view][:BESIDE]
            scenarios = [v for _, v in mine if v is not view][:BESIDE]
            beside = Beside(
                tuple((v.id, f"{v.symbol} {v.engine}, {v.model}") for v in engines),
                tuple((v.id, f"{v.symbol} {v.scenario}") for v in scenarios),
            )
            cases.append((view, beside))
        groups.append(ModelGroup(shown(key[1]), shown(key[2]), diagnoses.get(key), tuple(cases)))
    return tuple(groups)


def _name(folder: str, names: Mapping[str, str]) -> str:
    name = names[folder]
    alone = list(names.values()).count(name) == 1
    return shown(name if alone else f"{name} in {folder}")
