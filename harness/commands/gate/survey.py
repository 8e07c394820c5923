"""State of the gate before a run: the baseline, the files and their changes."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import msgspec

from physics_crosscheck.harness.baseline.file import SystemBaseline
from physics_crosscheck.harness.baseline.fingerprint import FolderFiles, versions
from physics_crosscheck.harness.baseline.known import Accepted
from physics_crosscheck.harness.baseline.stale import (
    location,
    robot_name,
    robot_options,
    scan_target,
)
from physics_crosscheck.harness.baseline.store import read_baseline
from physics_crosscheck.harness.documents.expanded import source_of
from physics_crosscheck.harness.engines.registry import absent_extras
from physics_crosscheck.harness.modelfiles.folders import FolderError
from physics_crosscheck.harness.paths import DEFAULT_FOLDER
from physics_crosscheck.harness.planning.options import Options
from physics_crosscheck.harness.records.baseline import RobotOptions, Snapshot
from physics_crosscheck.harness.records.case import CaseId
from physics_crosscheck.harness.records.results import Results

ModelInEngine = tuple[str, str, str]
"""(folder, model file, engine)."""


@dataclass(frozen=True, kw_only=True)
class Survey(Accepted):
    """The accepted results, the present files, and the models to run.

    Attributes:
        every: whether to run unchanged models too.
    """

    every: bool

    @cached_property
    def chosen(self) -> frozenset[ModelInEngine]:
        """Models to run: changed ones, or all."""
        return frozenset(
            (folder, model, engine)
            for folder in self.folders
            for model, engine in self._to_run(folder)
            if self.includes(engine)
        )

    def _to_run(self, folder: str) -> Iterable[tuple[str, str]]:
        if not self.every:
            return self.stale_models(folder)
        scan, _ = self.folders[folder]
        return ((model.model, engine) for model in scan.models for engine in model.engines)

    @property
    def running(self) -> list[FolderFiles]:
        """Folders and robot files that must run, or that cannot run."""
        wanted = {folder for folder, _, _ in self.chosen}
        return [
            scan
            for folder, (scan, _) in self.folders.items()
            if folder in wanted or scan.broken or not scan.models
        ]

    def snapshot(self, folder: str, case: CaseId) -> Snapshot | None:
        """Return the accepted snapshot of a case; for a new case, that of its scenario."""
        accepted = self.folders[folder][1] or self.systems.get(case.system)
        if accepted is None:
            return None
        id_ = msgspec.structs.replace(case, system=accepted.system)
        if id_ in accepted.cases:
            return accepted.snapshot(id_)
        others = (other for other in accepted.cases if other.scenario == case.scenario)
        return next(filter(None, map(accepted.snapshot, others)), None)


def survey(targets: Sequence[Path], options: Options) -> Survey:
    """Read the baseline and hash the folders and robot files.

    Raises:
        BaselineError: for an invalid baseline.
        OSError: for an unreadable file.
    """
    place = options.baseline or DEFAULT_FOLDER
    systems = read_baseline(place)
    pairs = [_scan(target, place, systems, options) for target in targets]
    return Survey(
        place=place,
        systems=systems,
        folders={str(scan.folder): (scan, accepted) for scan, accepted in pairs},
        versions=versions(),
        resolution=options.resolution,
        engines=options.engines,
        absent=frozenset(absent_extras()),
        every=options.every,
    )


def _scan(
    target: Path, place: Path, baseline: Mapping[str, SystemBaseline], options: Options
) -> tuple[FolderFiles, SystemBaseline | None]:
    robot = robot_options(target, floating=options.floating, model=options.model)
    given = None if robot == RobotOptions() else robot
    return scan_target(target, place, baseline, options.engines, given)


def by_name(state: Survey, results: Results | None) -> dict[str, FolderFiles]:
    """Return the folders by the name of their system, as loaded or as accepted.

    A robot file is named by its path, not by the robot's name.

    Raises:
        FolderError: if two folders have one name.
    """
    loaded = {system.folder: system.name for system in results.systems} if results else {}
    names: dict[str, FolderFiles] = {}
    for scan, system_baseline in state.folders.values():
        if scan.robot is not None:
            name = robot_name(scan.folder, state.place)
        else:
            name = loaded.get(str(scan.folder)) or (
                system_baseline.system if system_baseline else scan.folder.name
            )
        if name in names:
            raise FolderError(
                f"{scan.folder} and {names[name].folder} both hold the system {name!r};"
                " a baseline keeps one system of a name"
            )
        names[name] = scan
    return names


def is_expected(system_baseline: SystemBaseline, options: Options, state: Survey) -> bool:
    """Return whether a system of the baseline should be among the given folders and robot files."""
    file = (state.place / system_baseline.declared.folder).resolve()
    if system_baseline.robot is not None and file.exists():
        # A model that its file no longer has is gone.
        return not options.model and file in {source_of(Path(p)).resolve() for p in state.folders}
    if options.parents is None:
        return True
    if system_baseline.robot is not None:
        return any(file.is_relative_to(path.resolve()) for path in options.parents)
    parent = system_baseline.declared.folder.rpartition("/")[0]
    return parent in {location(path, state.place) for path in options.parents}


def was_left_alone(
    scan: FolderFiles, system_baseline: SystemBaseline, case: CaseId, state: Survey
) -> bool:
    """Return whether an accepted case still exists and was not run because nothing changed."""
    if case.scenario not in system_baseline.declared.scenarios:
        return False
    here = any(m.model == case.model and case.engine in m.engines for m in scan.models)
    return here and (str(scan.folder), case.model, case.engine) not in state.chosen
