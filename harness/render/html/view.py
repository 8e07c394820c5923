"""The view of the report: results as strings and tables, ready for the template.

Numbers and plots of every case, system and diagnosis, packed for the page.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.records.case import Case, ModelKey
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.records.scene import Scene
from physics_crosscheck.harness.records.system import SystemResult
from physics_crosscheck.harness.render.html.case_charts import OVERLAID, case_charts
from physics_crosscheck.harness.render.html.cases import SYMBOLS, CaseView, case_view, severity
from physics_crosscheck.harness.render.html.diagnoses import DiagnosisView, diagnosis_view
from physics_crosscheck.harness.render.html.matrix import EngineMatrix, Pair, matrix
from physics_crosscheck.harness.render.html.model_charts import (
    corrected,
    hypotheses,
    reaches,
    responses,
)
from physics_crosscheck.harness.render.html.overview import (
    ChangeView,
    IssueView,
    Outlier,
    TestedNumbers,
    changes,
    issue_views,
    standing_out,
    tested_numbers,
    verdict,
)
from physics_crosscheck.harness.render.html.packs import Chart, Column, Pack
from physics_crosscheck.harness.render.html.runs import CaseRun, largest, runs
from physics_crosscheck.harness.render.html.scenes import (
    THREE,
    SceneView,
    case_states,
    scene_about,
    three_code,
)
from physics_crosscheck.harness.render.html.systems import SystemView, system_view
from physics_crosscheck.harness.render.html.text import quantity, shown, slug
from physics_crosscheck.harness.render.terminal.table import summary
from physics_crosscheck.harness.results.next_steps import DEFAULT_OUT, run_again
from physics_crosscheck.harness.results.status import counted, unread_words


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

    def __init__(self, results: Results) -> None:
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
        self._scene_packs: dict[str, str] = {}
        for place, system in enumerate(results.systems):
            pack = Pack(f"pack-system-{place}")
            self._system_packs[system.folder] = pack.id
            self._folder_packs.setdefault(system.folder, []).append(pack.id)
            self._store_pack(pack, reaches(pack, system), sketch=system.sketch)
            if system.scene is not None:
                self._keep_scene(system.folder, Pack(f"pack-scene-{place}"), system.scene)
        self._scenes = [
            self._scene(place, case, results.model_of(case))
            for place, case in enumerate(results.cases)
        ]
        self._keep_cases(_magnitudes(results.cases))
        self._diagnosis_packs = {
            place: self._diagnosed(place, model) for place, model in enumerate(results.models)
        }

    def case_pack(self, place: int) -> str:
        """Return the pack id of a case; empty without series."""
        run = self._runs[place]
        return "" if run is None else run.pack.id

    def scene(self, place: int) -> SceneView | None:
        """Return the scene of a case; None for declared energies."""
        return self._scenes[place]

    @property
    def code(self) -> str:
        """Code of three.js, if a page has a scene."""
        return three_code() if self._scene_packs else ""

    def _keep_scene(self, folder: str, pack: Pack, scene: Scene) -> None:
        self._scene_packs[folder] = pack.id
        self._folder_packs.setdefault(folder, []).append(pack.id)
        self._store_pack(pack, (), scene=scene)
        if self.code:
            self._store_pack(Pack(THREE), (), code=self.code)

    def _scene(self, place: int, case: Case, model: Model | None) -> SceneView | None:
        system = self._systems.get(case.folder)
        if system is None or system.scene is None:
            return None
        states, about = "", scene_about(system.scene, ())
        if case.by_state is not None:
            content = case_states(system.scene, case, case.by_state, model)
            states, about = f"pack-states-{place}", scene_about(system.scene, content.lit)
            self._store_pack(Pack(states), (), **vars(content))
        return SceneView(
            scene=self._scene_packs[case.folder],
            states=states,
            about=about,
            unread=shown(unread_words(system.scene.unread)),
        )

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
            self._store_pack(
                run.pack,
                (*charts, *linear, *reaching),
                motion=self._motion(run, others),
                worst=run.verdict.time,
            )

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


@dataclass(frozen=True, kw_only=True)
class Count:
    """An outcome: its symbol, its meaning, and its number of cases."""

    outcome: Outcome
    symbol: str
    meaning: str
    cases: int


@dataclass(frozen=True, kw_only=True)
class RelatedCase:
    """A link to a related case: (permalink, label)."""

    engines: tuple[tuple[str, str], ...]
    scenarios: tuple[tuple[str, str], ...]


@dataclass(frozen=True, kw_only=True)
class ModelGroup:
    """A model file in one engine, with its cases and its problems."""

    model: str
    engine: str
    scene: SceneView | None
    diagnosis: DiagnosisView | None
    cases: tuple[tuple[CaseView, RelatedCase], ...]


@dataclass(frozen=True, kw_only=True)
class FolderView:
    """One folder: its page, and those of its models.

    Attributes:
        id: id of its page.
        name: name of the system, with its folder if another system has the same name.
        models: one per model file and engine.
        about: the system itself; None if it could not be read.
        scene: scene of its worst case; None for declared energies.
        packs: packs of the system, its models and its diagnoses.
    """

    id: str
    name: str
    models: tuple[ModelGroup, ...]
    about: SystemView | None
    scene: SceneView | None
    packs: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Report:
    """The whole page.

    Attributes:
        settings: (label, value) of the run.
        absent: engines that are not installed.
        verdict: the verdict in words, and what to do on failure.
        troubles: issues to act on.
        again: command that checks a fix; empty if all passes.
        outliers: extreme cases among those that agree.
        tested: tested numbers of each model file.
        changes: changes since the baseline; None without one.
        baseline: name of the baseline.
        matrix: models by engines.
        cases: every case, worst first.
        groups: folders in the order of the run.
        scene: scene of the only system; None for several systems.
        code: code of three.js, which the page may run; empty without scenes.
        packs: numbers and plots, by the ids of their elements.
    """

    title: str
    verdict: str
    summary: str
    settings: tuple[tuple[str, str], ...]
    absent: tuple[str, ...]
    counts: tuple[Count, ...]
    troubles: tuple[IssueView, ...]
    again: str
    outliers: tuple[Outlier, ...]
    tested: tuple[TestedNumbers, ...]
    changes: tuple[ChangeView, ...] | None
    baseline: str
    matrix: EngineMatrix
    cases: tuple[CaseView, ...]
    engines: tuple[str, ...]
    systems: tuple[str, ...]
    groups: tuple[FolderView, ...]
    scene: SceneView | None
    code: str
    packs: Mapping[str, str]

    @property
    def has_scenes(self) -> bool:
        """True if a page shows bodies."""
        return any(group.scene is not None for group in self.groups)


def report(results: Results, out: Path = DEFAULT_OUT) -> Report:
    """Return the view of results, for a page in the folder `out`."""
    systems = {system.folder: system for system in results.systems}
    names = _names(results, systems)
    ids = _Ids()
    content = Content(results)
    pages = {folder: ids.new(f"system-{slug(name)}") for folder, (name, _) in names.items()}
    views = _views(results, systems, ids, content)
    pairs = list(zip(results.cases, views, strict=True))
    diagnoses = _diagnoses(results.models, pairs, ids, content)
    worst_first = sorted(pairs, key=lambda pair: severity(pair[0]))
    counts = Counter(case.outcome for case in results.cases)
    issues = issue_views(results, {id(case): view for case, view in pairs}, diagnoses)
    shown_names = {folder: name for folder, (_, name) in names.items()}
    baseline = results.baseline
    groups = _groups(results, pages, shown_names, pairs, diagnoses, content)
    return Report(
        title=f"{counts[Outcome.AGREES]} of {counted(len(views), 'case')}"
        f" agree{'s' if len(views) == 1 else ''}",
        verdict=verdict(results, issues),
        summary=shown(summary(results)),
        settings=(
            ("created", shown(results.created)),
            ("requested resolution", quantity(results.resolution, "")),
            *((shown(k), shown(v)) for k, v in results.versions.items() if v is not None),
        ),
        absent=tuple(shown(k) for k, v in results.versions.items() if v is None),
        counts=tuple(
            Count(outcome=o, symbol=SYMBOLS[o], meaning=o.meaning, cases=counts[o]) for o in Outcome
        ),
        troubles=issues,
        again=shown(run_again(results, out)),
        outliers=standing_out(pairs),
        tested=tested_numbers(results.models),
        changes=None if baseline is None else changes(baseline, pairs),
        baseline="" if baseline is None else shown(baseline.name or "the baseline"),
        matrix=matrix(pairs, results.models, pages, shown_names),
        cases=tuple(view for _, view in worst_first),
        engines=tuple(sorted({view.engine for view in views})),
        systems=tuple(dict.fromkeys(view.system for view in views)),
        groups=groups,
        scene=groups[0].scene if len(groups) == 1 else None,
        code=content.code,
        packs=content.packs(),
    )


def _names(results: Results, systems: Mapping[str, SystemResult]) -> dict[str, tuple[str, str]]:
    """Return the system's name and its displayed name, by folder in the order of the run."""
    folders = dict.fromkeys([*systems, *(case.folder for case in results.cases)])
    names = {case.folder: case.system for case in results.cases}
    names |= {folder: system.name for folder, system in systems.items()}
    times = Counter(names.values())
    return {
        folder: (name, shown(name if times[name] == 1 else f"{name} in {folder}"))
        for folder, name in ((folder, names[folder]) for folder in folders)
    }


def _groups(
    results: Results,
    pages: Mapping[str, str],
    names: Mapping[str, str],
    pairs: Sequence[Pair],
    diagnoses: Mapping[ModelKey, DiagnosisView],
    content: Content,
) -> tuple[FolderView, ...]:
    cases: dict[str, list[Pair]] = {folder: [] for folder in pages}
    for case, view in pairs:
        cases[case.folder].append((case, view))
    abouts = {
        system.folder: system_view(
            system,
            [model for model in results.models if model.folder == system.folder],
            content.system_pack(system.folder),
        )
        for system in results.systems
    }
    return tuple(
        FolderView(
            id=page,
            name=names[folder],
            models=_model_groups(cases[folder], diagnoses),
            about=abouts.get(folder),
            scene=_worst_scene(cases[folder]),
            packs=content.folder_packs(folder),
        )
        for folder, page in pages.items()
    )


def _worst_scene(pairs: Sequence[Pair]) -> SceneView | None:
    """Return the scene of the worst case with errors by state."""
    worst_first = sorted(pairs, key=lambda pair: severity(pair[0]))
    scenes = [view.scene for _, view in worst_first if view.scene is not None]
    return next((one for one in scenes if one.states), scenes[0] if scenes else None)


class _Ids:
    """Unique ids: a repeated one gets a number."""

    def __init__(self) -> None:
        self._given: Counter[str] = Counter()

    def new(self, wanted: str) -> str:
        self._given[wanted] += 1
        count = self._given[wanted]
        # Slugs contain no equals sign.
        return wanted if count == 1 else f"{wanted}={count}"


def _views(
    results: Results, systems: Mapping[str, SystemResult], ids: _Ids, content: Content
) -> list[CaseView]:
    scenarios = {
        (folder, scenario.name): scenario
        for folder, system in systems.items()
        for scenario in system.scenarios
    }
    models = {model.key: model for model in results.models}
    return [
        case_view(
            case,
            ids.new(f"case-{slug(case.system, case.model, case.engine, case.scenario)}"),
            content.case_pack(place),
            content.scene(place),
            scenarios.get((case.folder, case.scenario)),
            models.get(case.key),
        )
        for place, case in enumerate(results.cases)
    ]


def _diagnoses(
    models: Sequence[Model], pairs: Sequence[Pair], ids: _Ids, content: Content
) -> dict[ModelKey, DiagnosisView]:
    """Return diagnoses of the models with a difference or an audit finding."""
    differing: dict[ModelKey, list[tuple[str, str]]] = {}
    for case, view in pairs:
        if case.outcome is Outcome.DIFFERS:
            differing.setdefault(case.key, []).append((view.id, view.scenario))
    views = {}
    for place, model in enumerate(models):
        if model.diagnosis is not None or model.findings:
            name = slug(model.system, model.model, model.engine)
            views[model.key] = diagnosis_view(
                model,
                ids.new(f"diagnosis-{name}"),
                content.diagnosis_pack(place),
                differing.get(model.key, ()),
            )
    return views


MAX_RELATED = 12
"""Maximum number of links to other cases; a longer row does not help."""


def _model_groups(
    pairs: Sequence[Pair], diagnoses: Mapping[ModelKey, DiagnosisView]
) -> tuple[ModelGroup, ...]:
    rows: dict[ModelKey, list[Pair]] = {}
    same: dict[str, list[CaseView]] = {}
    for case, view in pairs:
        rows.setdefault(case.key, []).append((case, view))
        same.setdefault(case.scenario, []).append(view)
    groups = []
    for key, mine in rows.items():
        cases = []
        for case, view in mine:
            engines = [v for v in same[case.scenario] if v is not view][:MAX_RELATED]
            scenarios = [v for _, v in mine if v is not view][:MAX_RELATED]
            links = RelatedCase(
                engines=tuple((v.id, f"{v.symbol} {v.engine}, {v.model}") for v in engines),
                scenarios=tuple((v.id, f"{v.symbol} {v.scenario}") for v in scenarios),
            )
            cases.append((view, links))
        groups.append(
            ModelGroup(
                model=mine[0][1].model,
                engine=mine[0][1].engine,
                scene=_worst_scene(mine),
                diagnosis=diagnoses.get(key),
                cases=tuple(cases),
            )
        )
    return tuple(groups)
