"""Numbers and plots of every case, system and diagnosis, packed for the page."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from physics_crosscheck.harness.records.case import Case, ModelKey
from physics_crosscheck.harness.records.history import Past
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.render.html.case_charts import OVERLAID, case_charts
from physics_crosscheck.harness.render.html.model_charts import (
    corrected,
    hypotheses,
    reaches,
    responses,
)
from physics_crosscheck.harness.render.html.packs import Chart, Column, Pack
from physics_crosscheck.harness.render.html.past_charts import by_case, case_history, run_history
from physics_crosscheck.harness.render.html.runs import CaseRun, largest, runs


@dataclass(frozen=True)
class Track:
    """Location of another animated motion: pack and key of each column."""

    t: tuple[str, str]
    engine: tuple[tuple[str, str], ...]


@dataclass(frozen=True, kw_only=True)
class AnimatedMotion:
    """Location of the data of an animation.

    Attributes:
        system: id of the pack with the sketch.
        t, reference, engine: keys of the case's own columns.
        others: motions of the other models and engines.
    """

    system: str
    t: str
    reference: tuple[str, ...]
    engine: tuple[str, ...]
    others: tuple[Track, ...]


Parts = tuple[Pack, tuple[Chart, ...], Mapping[str, object]]
"""A pack, its charts, and its other content."""


class _LazyPacks(Mapping[str, str]):
    """Mapping of packs that makes each text on access."""

    def __init__(self, packs: Mapping[str, Parts]) -> None:
        self._packs = packs

    def __getitem__(self, name: str) -> str:
        pack, charts, more = self._packs[name]
        return pack.to_text(charts, **more)

    def __iter__(self) -> Iterator[str]:
        return iter(self._packs)

    def __len__(self) -> int:
        return len(self._packs)


class Content:
    """Packs of a report, by the ids of the elements that hold them.

    Charts of one pack can use numbers of another, so all charts are made before any pack is packed.
    """

    def __init__(self, results: Results, history: Sequence[Past] = ()) -> None:
        self._systems = {system.folder: system for system in results.systems}
        self._runs = runs(results.cases)
        self._packs: dict[str, Parts] = {}
        self._linear: dict[ModelKey, tuple[Chart, ...]] = {}
        self._folder_packs: dict[str, list[str]] = {}
        for place, model in enumerate(results.models):
            system = self._systems.get(model.folder)
            if system is not None:
                pack = Pack(f"pack-model-{place}")
                self._folder_packs.setdefault(model.folder, []).append(pack.id)
                self._linear[model.key] = responses(pack, model, system)
                self._store_pack(pack, ())
        self._system_packs: dict[str, str] = {}
        for place, system in enumerate(results.systems):
            pack = Pack(f"pack-system-{place}")
            self._system_packs[system.folder] = pack.id
            self._folder_packs.setdefault(system.folder, []).append(pack.id)
            self._store_pack(pack, reaches(pack, system), sketch=system.sketch)
        self._history = by_case(history)
        self._keep_cases(_magnitudes(results.cases))
        self.history_pack = self._kept_history(results, history)
        self._diagnosis_packs = {
            place: self._diagnosed(place, model) for place, model in enumerate(results.models)
        }

    def case_pack(self, place: int) -> str:
        """Return the pack id of a case; empty without series."""
        run = self._runs[place]
        return "" if run is None else run.pack.id

    def system_pack(self, folder: str) -> str:
        """Return the pack id of a folder's system."""
        return self._system_packs[folder]

    def folder_packs(self, folder: str) -> tuple[str, ...]:
        """Return the pack ids of a folder's system, models and diagnoses."""
        return tuple(self._folder_packs.get(folder, ()))

    def diagnosis_pack(self, place: int) -> str:
        """Return the pack id of a model's diagnosis; empty without one."""
        return self._diagnosis_packs[place]

    def packs(self) -> Mapping[str, str]:
        """Return every pack by its id, packed on access."""
        return _LazyPacks(self._packs)

    def _store_pack(self, pack: Pack, charts: Iterable[Chart], **more: object) -> None:
        self._packs[pack.id] = pack, tuple(charts), more

    def _keep_cases(self, magnitudes: Mapping[str, list[float]]) -> None:
        together: dict[tuple[str, str], list[CaseRun]] = {}
        for run in self._runs:
            if run is not None:
                together.setdefault((run.case.folder, run.case.scenario), []).append(run)
        for run in self._runs:
            if run is None:
                continue
            folder = run.case.folder
            near = together[folder, run.case.scenario][: OVERLAID + 1]
            others = [other for other in near if other is not run][:OVERLAID]
            charts = case_charts(run, others, self._units(run), magnitudes[folder])
            linear = self._linear.get(run.case.key, ())
            reaching = self._packs[self._system_packs[folder]][1] if folder in self._systems else ()
            past = case_history(run.pack, self._history.get(run.case.id, ()))
            charts = (*charts, *past)
            self._store_pack(
                run.pack, (*charts, *linear, *reaching), motion=self._motion(run, others)
            )

    def _kept_history(self, results: Results, history: Sequence[Past]) -> str:
        """Return the pack id of the history of all cases; empty without plots."""
        pack = Pack("pack-history")
        charts = run_history(pack, results.cases, history)
        if charts:
            self._store_pack(pack, charts)
        return pack.id if charts else ""

    def _motion(self, run: CaseRun, others: Sequence[CaseRun]) -> AnimatedMotion | None:
        """Return the location of the data of an animation; None without a sketch."""
        system = self._systems.get(run.case.folder)
        if system is None or system.sketch is None:
            return None
        half = len(run.reference) // 2
        return AnimatedMotion(
            system=self._system_packs[system.folder],
            t=run.t.key,
            reference=tuple(column.key for column in run.reference[:half]),
            engine=tuple(column.key for column in run.engine[:half]),
            others=tuple(
                Track(_address(other.t), tuple(_address(c) for c in other.engine[:half]))
                for other in others
            ),
        )

    def _units(self, run: CaseRun) -> list[str]:
        """Return the units of the components: coordinates, then rates."""
        system = self._systems.get(run.case.folder)
        if system is None:
            return ["?"] * len(run.reference)
        units = [coordinate.unit for coordinate in system.coordinates]
        return units + [f"{unit}/s" for unit in units]

    def _diagnosed(self, place: int, model: Model) -> str:
        diagnosis = model.diagnosis
        if diagnosis is None:
            return ""
        pack = Pack(f"pack-diagnosis-{place}")
        tracks = {
            run.case.scenario: run
            for run in self._runs
            if run is not None and run.case.key == model.key
        }
        charts = list(hypotheses(pack, diagnosis))
        if tracks and diagnosis.corrected is not None:
            units = self._units(next(iter(tracks.values())))
            charts += corrected(pack, diagnosis.corrected, tracks, units)
        if not charts:
            return ""
        self._store_pack(pack, charts)
        self._folder_packs.setdefault(model.folder, []).append(pack.id)
        return pack.id


def _address(column: Column) -> tuple[str, str]:
    return column.pack, column.key


def _magnitudes(cases: Iterable[Case]) -> dict[str, list[float]]:
    """Return the largest magnitude of each component over all cases of a folder."""
    magnitudes: dict[str, list[float]] = {}
    for case in cases:
        if case.series is not None:
            sizes = [largest(row) for row in case.series.reference]
            before = magnitudes.get(case.folder, [0.0] * len(sizes))
            magnitudes[case.folder] = [max(a, b) for a, b in zip(before, sizes, strict=True)]
    return magnitudes
