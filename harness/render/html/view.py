"""The content of the report: cases, systems and diagnoses, with packed numbers and plots."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TypeVar

from physics_crosscheck.harness.records.case import Case, ModelKey
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.records.scene import Scene
from physics_crosscheck.harness.records.system import SystemResult
from physics_crosscheck.harness.results.headline import headline
from physics_crosscheck.harness.results.next_steps import DEFAULT_OUT
from physics_crosscheck.harness.results.status import counted, unread_words
from .case_charts import OVERLAID, case_charts
from .cases import CaseView, severity
from .diagnoses import DiagnosisView
from .model_charts import corrected, hypotheses, reaches, responses
from .overview import issue_views, verdict
from .packs import Chart, Pack
from .runs import CaseRun, largest, runs
from .scenes import THREE, SceneView, case_states, scene_about, three_code
from .text import slug

Parts = tuple[Pack, tuple[Chart, ...], Mapping[str, object]]
"""A pack, its charts, and its other content."""


class Content:
    """Packs of a report, by the ids of the elements that hold them.

    Charts of one pack can use numbers of another, so all charts are made before any pack is packed.

    Attributes:
        system_packs: pack of each folder's system.
        folder_packs: packs of each folder's system, models and diagnoses.
        scenes: scene of each case; None for declared energies.
        diagnosis_packs: pack of each model's diagnosis; empty without one.
    """

    def __init__(self, results: Results) -> None:
        self._systems = {system.folder: system for system in results.systems}
        self._runs = runs(results.cases)
        self._packs: dict[str, Parts] = {}
        self._linear: dict[ModelKey, tuple[Chart, ...]] = {}
        self.folder_packs: dict[str, list[str]] = defaultdict(list)
        for place, model in enumerate(results.models):
            system = self._systems.get(model.folder)
            if system is not None:
                pack = Pack(f"pack-model-{place}")
                self.folder_packs[model.folder].append(pack.id)
                self._linear[model.key] = responses(pack, model, system)
                self._store_pack(pack, ())
        self.system_packs: dict[str, str] = {}
        self._scene_packs: dict[str, str] = {}
        for place, system in enumerate(results.systems):
            pack = Pack(f"pack-system-{place}")
            self.system_packs[system.folder] = pack.id
            self.folder_packs[system.folder].append(pack.id)
            self._store_pack(pack, reaches(pack, system), sketch=system.sketch)
            if system.scene is not None:
                self._keep_scene(system.folder, Pack(f"pack-scene-{place}"), system.scene)
        self.scenes = [
            self._scene(place, case, results.model_of(case))
            for place, case in enumerate(results.cases)
        ]
        self._keep_cases(_magnitudes(results.cases))
        self.diagnosis_packs = [
            self._diagnosed(place, model) for place, model in enumerate(results.models)
        ]

    def case_pack(self, place: int) -> str:
        """Return the pack id of a case; empty without series."""
        run = self._runs[place]
        return "" if run is None else run.pack.id

    @property
    def code(self) -> str:
        """Code of three.js, if a page has a scene."""
        return three_code() if self._scene_packs else ""

    def _keep_scene(self, folder: str, pack: Pack, scene: Scene) -> None:
        self._scene_packs[folder] = pack.id
        self.folder_packs[folder].append(pack.id)
        self._store_pack(pack, (), scene=scene)
        if self.code:
            self._store_pack(Pack(THREE), (), code=self.code)

    def _scene(self, place: int, case: Case, model: Model | None) -> SceneView | None:
        system = self._systems.get(case.folder)
        if system is None or system.scene is None:
            return None
        states, about = "", scene_about(system.scene, ())
        if case.by_state is not None:
            states = f"pack-states-{place}"
            about, content = case_states(system.scene, case, case.by_state, model)
            self._store_pack(Pack(states), (), **content)
        return SceneView(
            scene=self._scene_packs[case.folder],
            states=states,
            about=about,
            unread=unread_words(system.scene.unread),
        )

    @property
    def names(self) -> Iterable[str]:
        """Ids of the packs."""
        return self._packs

    def text(self, name: str) -> str:
        """Return a pack as text."""
        pack, charts, more = self._packs[name]
        return pack.to_text(charts, **more)

    def _store_pack(self, pack: Pack, charts: Iterable[Chart], **more: object) -> None:
        self._packs[pack.id] = pack, tuple(charts), more

    def _keep_cases(self, magnitudes: Mapping[str, list[float]]) -> None:
        drawn = [run for run in self._runs if run is not None]
        together = _grouped(drawn, lambda run: (run.case.folder, run.case.scenario))
        for run in drawn:
            folder = run.case.folder
            near = together[folder, run.case.scenario][: OVERLAID + 1]
            others = [other for other in near if other is not run][:OVERLAID]
            charts = case_charts(run, others, self._units(run), magnitudes[folder])
            linear = self._linear.get(run.case.key, ())
            reaching = self._packs[self.system_packs[folder]][1] if folder in self._systems else ()
            self._store_pack(
                run.pack,
                (*charts, *linear, *reaching),
                motion=self._motion(run, others),
                worst=run.verdict.time,
            )

    def _motion(self, run: CaseRun, others: Sequence[CaseRun]) -> Mapping[str, object] | None:
        """Return where the script finds an animation's numbers; None without a sketch.

        The keys of the case's own columns, and pack and key of each other motion's.
        """
        system = self._systems.get(run.case.folder)
        if system is None or system.sketch is None:
            return None
        half = len(run.reference) // 2
        return {
            "system": self.system_packs[system.folder],
            "t": run.t.key,
            "reference": [column.key for column in run.reference[:half]],
            "engine": [column.key for column in run.engine[:half]],
            "others": [
                {"t": other.t.address, "engine": [one.address for one in other.engine[:half]]}
                for other in others
            ],
        }

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
        self.folder_packs[model.folder].append(pack.id)
        return pack.id


def _magnitudes(cases: Iterable[Case]) -> dict[str, list[float]]:
    """Return the largest magnitude of each component over all cases of a folder."""
    magnitudes: dict[str, list[float]] = {}
    for case in cases:
        if case.series is not None:
            sizes = [largest(row) for row in case.series.reference]
            before = magnitudes.get(case.folder, [0.0] * len(sizes))
            magnitudes[case.folder] = [max(a, b) for a, b in zip(before, sizes, strict=True)]
    return magnitudes


@dataclass(frozen=True, kw_only=True)
class FolderView:
    """One folder: its page, and those of its models.

    Attributes:
        id: id of its page.
        name: name of the system, with its folder if another system has the same name.
        system: its record; None if it could not be read.
        models: records of its models.
        cases: its cases.
        pack: id of the numbers and plots of the system; empty if it could not be read.
        packs: packs of the system, its models and its diagnoses.
    """

    id: str
    name: str
    system: SystemResult | None
    models: Sequence[Model]
    cases: Sequence[CaseView]
    pack: str
    packs: tuple[str, ...]

    @cached_property
    def by_model(self) -> Mapping[ModelKey, list[CaseView]]:
        """Cases of each model file in each engine."""
        return _grouped(self.cases, lambda view: view.case.key)

    @cached_property
    def by_scenario(self) -> Mapping[str, list[CaseView]]:
        """Cases of each scenario."""
        return _grouped(self.cases, lambda view: view.case.scenario)

    @cached_property
    def files(self) -> Mapping[str, list[Model]]:
        """Each model file with its records in the engines."""
        return _grouped(self.models, lambda model: model.model)


K = TypeVar("K")
V = TypeVar("V")


def _grouped(values: Iterable[V], key: Callable[[V], K]) -> dict[K, list[V]]:
    groups: dict[K, list[V]] = {}
    for value in values:
        groups.setdefault(key(value), []).append(value)
    return groups


def worst_scene(views: Iterable[CaseView]) -> SceneView | None:
    """Return the scene of the worst case with errors by state; None for declared energies."""
    worst_first = sorted(views, key=lambda view: severity(view.case))
    scenes = [view.scene for view in worst_first if view.scene is not None]
    return next((one for one in scenes if one.states), scenes[0] if scenes else None)


class Report:
    """The whole page.

    Attributes:
        results: results of the run.
        out: folder of the page.
        content: packed numbers and plots.
        folders: folders in the order of the run.
        cases: every case, in the order of the run.
        diagnoses: diagnoses of the models with a difference or a finding.
        issues: issues to act on.
    """

    def __init__(self, results: Results, out: Path = DEFAULT_OUT) -> None:
        self.results, self.out, self.content = results, out, Content(results)
        self._given: Counter[str] = Counter()
        systems = {system.folder: system for system in results.systems}
        folders = dict.fromkeys([*systems, *(case.folder for case in results.cases)])
        names = {case.folder: case.system for case in results.cases}
        names |= {folder: system.name for folder, system in systems.items()}
        pages = {folder: self._unique(f"system-{slug(names[folder])}") for folder in folders}
        self.cases = self._case_views(systems)
        self.diagnoses = self._diagnosis_views()
        times = Counter(names.values())
        self.folders = {
            folder: FolderView(
                id=page,
                name=names[folder] if times[names[folder]] == 1 else f"{names[folder]} in {folder}",
                system=systems.get(folder),
                models=[model for model in results.models if model.folder == folder],
                cases=[view for view in self.cases if view.case.folder == folder],
                pack=self.content.system_packs.get(folder, ""),
                packs=tuple(self.content.folder_packs[folder]),
            )
            for folder, page in pages.items()
        }
        views = {id(view.case): view for view in self.cases}
        self.issues = issue_views(results, views, self.diagnoses)

    def _unique(self, wanted: str) -> str:
        """Return an id; a repeated one gets a number after an equals sign, which no slug has."""
        self._given[wanted] += 1
        count = self._given[wanted]
        return wanted if count == 1 else f"{wanted}={count}"

    def _case_views(self, systems: Mapping[str, SystemResult]) -> list[CaseView]:
        scenarios = {
            (folder, scenario.name): scenario
            for folder, system in systems.items()
            for scenario in system.scenarios
        }
        models = {model.key: model for model in self.results.models}
        return [
            CaseView(
                id=self._unique(
                    f"case-{slug(case.system, case.model, case.engine, case.scenario)}"
                ),
                case=case,
                pack=self.content.case_pack(place),
                scene=self.content.scenes[place],
                scenario=scenarios.get((case.folder, case.scenario)),
                model=models.get(case.key),
            )
            for place, case in enumerate(self.results.cases)
        ]

    def _diagnosis_views(self) -> dict[ModelKey, DiagnosisView]:
        differing: dict[ModelKey, list[tuple[str, str]]] = {}
        for view in self.cases:
            if view.case.outcome is Outcome.DIFFERS:
                differing.setdefault(view.case.key, []).append((view.id, view.case.scenario))
        return {
            model.key: DiagnosisView(
                id=self._unique(f"diagnosis-{slug(model.system, model.model, model.engine)}"),
                model=model,
                cases=differing.get(model.key, ()),
                pack=self.content.diagnosis_packs[place],
            )
            for place, model in enumerate(self.results.models)
            if model.diagnosis is not None or model.findings
        }

    @property
    def counts(self) -> Mapping[Outcome, int]:
        """Number of cases by outcome, for outcomes with cases."""
        counts = Counter(view.case.outcome for view in self.cases)
        return {outcome: counts[outcome] for outcome in Outcome if counts[outcome]}

    @property
    def sentences(self) -> tuple[str, str]:
        """The first sentence; then the others, how many cases agree, and what to do on failure."""
        count = len(self.cases)
        agreeing = self.counts.get(Outcome.AGREES, 0)
        numbers = f"{agreeing} of {counted(count, 'case')} agree{'s' if count == 1 else ''}"
        first, *others = headline(self.results) or [f"{numbers}."]
        return first, " ".join((*others, f"{numbers}.", verdict(self.results, self.issues)))

    @property
    def worst_first(self) -> list[CaseView]:
        """Every case, worst first."""
        return sorted(self.cases, key=lambda view: severity(view.case))

    @property
    def changes(self) -> Mapping[tuple[str, str], list[tuple[str, str]]]:
        """Changes since the baseline, with the id on the page and the name of each case.

        Equal ones are listed once; a case that did not run has no id.
        """
        ids = {view.case.id: view.id for view in self.cases}
        changes: dict[tuple[str, str], list[tuple[str, str]]] = {}
        for change in self.results.baseline.changes if self.results.baseline else ():
            what = change.label, "; ".join(change.messages)
            changes.setdefault(what, []).append((ids.get(change.id, ""), str(change.id)))
        return changes
