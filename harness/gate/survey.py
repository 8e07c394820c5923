"""Options of the gate, and its state before a run: the baseline, the files and their changes."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from physics_crosscheck.harness.baseline.file import SystemBaseline
from physics_crosscheck.harness.baseline.fingerprint import FolderFiles, versions
from physics_crosscheck.harness.baseline.stale import (
    location,
    robot_name,
    robot_options,
    scan_target,
    stale_models,
)
from physics_crosscheck.harness.baseline.store import read_baseline
from physics_crosscheck.harness.engines.registry import absent_extras
from physics_crosscheck.harness.jobs.limits import Limits
from physics_crosscheck.harness.modelfiles.folders import FolderError
from physics_crosscheck.harness.records.baseline import RobotOptions, Snapshot
from physics_crosscheck.harness.records.case import CaseId
from physics_crosscheck.harness.records.results import Results

ModelInEngine = tuple[str, str, str]
"""(folder, model file, engine)."""


@dataclass(frozen=True, kw_only=True)
class GateOptions:
    """Options of the gate.

    Attributes:
        baseline: folder of the accepted baseline.
        engines: engines to run; empty: all.
        every: whether to run unchanged cases too.
        diagnose: whether to find the cause of each difference, which takes longer.
        resolution, jobs, limits: as in `harness.run.Options`.
        thorough: whether every check of a case runs.
        floating, model: the same for robot files; default: as accepted.
        parents: folders whose systems are all given, so that a missing system counts as gone; None:
            expect every system of the baseline.
    """

    baseline: Path
    engines: tuple[str, ...] = ()
    every: bool = False
    diagnose: bool = False
    resolution: float = 1e-9
    jobs: int = 0
    limits: Limits = field(default_factory=Limits)
    floating: bool = False
    model: str = ""
    parents: tuple[Path, ...] | None = None
    thorough: bool = False

    def left_out(self, engines: Collection[str]) -> frozenset[str]:
        """Return the engines to ignore: not requested, or of extras that are not installed."""
        wanted = set(self.engines or engines) - set(absent_extras())
        return frozenset(engines) - wanted


@dataclass(frozen=True, kw_only=True)
class Survey:
    """The present files and the accepted results.

    Attributes:
        baseline: accepted results, by name of the system.
        versions: versions of the engines.
        scans: files of each folder and robot file.
        matched: accepted results of each of them.
        left_out: engines to ignore.
        chosen: models to run.
    """

    baseline: Mapping[str, SystemBaseline] = field(repr=False)
    versions: Mapping[str, str | None]
    scans: tuple[FolderFiles, ...] = field(repr=False)
    matched: Mapping[Path, SystemBaseline | None] = field(repr=False)
    left_out: frozenset[str]
    chosen: frozenset[ModelInEngine]

    @property
    def running(self) -> list[FolderFiles]:
        """Folders and robot files that must run, or that cannot run."""
        wanted = {folder for folder, _, _ in self.chosen}
        return [
            scan
            for scan in self.scans
            if str(scan.folder) in wanted or scan.broken or not scan.models
        ]

    def snapshot(self, folder: str, case: CaseId) -> Snapshot | None:
        """Return the accepted snapshot of a case; for a new case, that of its scenario."""
        accepted = self.matched.get(Path(folder)) or self.baseline.get(case.system)
        if accepted is None:
            return None
        id_ = msgspec.structs.replace(case, system=accepted.system)
        if id_ in accepted.cases:
            return accepted.snapshot(id_)
        others = (other for other in accepted.cases if other.scenario == case.scenario)
        return next(filter(None, map(accepted.snapshot, others)), None)


def survey(targets: Sequence[Path], options: GateOptions) -> Survey:
    """Read the baseline and hash the folders and robot files.

    Raises:
        BaselineError: for an invalid baseline.
        OSError: for an unreadable file.
    """
    baseline = read_baseline(options.baseline)
    engine_versions = versions()
    pairs = [_scan(target, baseline, options) for target in targets]
    scans = tuple(scan for scan, _ in pairs)
    matched = {scan.folder: system_baseline for scan, system_baseline in pairs}
    accepted = {
        case.engine for system_baseline in baseline.values() for case in system_baseline.cases
    }
    declared = {name for scan in scans for model in scan.models for name in model.engines}
    left_out = options.left_out(accepted | declared)
    chosen = frozenset(
        (str(scan.folder), model, engine)
        for scan in scans
        for model, engine in _to_run(scan, matched[scan.folder], engine_versions, options)
        if engine not in left_out
    )
    return Survey(
        baseline=baseline,
        versions=engine_versions,
        scans=scans,
        matched=matched,
        left_out=left_out,
        chosen=chosen,
    )


def _scan(
    target: Path, baseline: Mapping[str, SystemBaseline], options: GateOptions
) -> tuple[FolderFiles, SystemBaseline | None]:
    robot = robot_options(target, floating=options.floating, model=options.model)
    given = None if robot == RobotOptions() else robot
    return scan_target(target, options.baseline, baseline, options.engines, given)


def _to_run(
    scan: FolderFiles,
    accepted: SystemBaseline | None,
    versions: Mapping[str, str | None],
    options: GateOptions,
) -> Iterable[tuple[str, str]]:
    """Return the models of a folder, in any engine, that must run: changed ones, or all."""
    if options.every:
        return ((model.model, engine) for model in scan.models for engine in model.engines)
    return stale_models(scan, accepted, versions, options.resolution)


def by_name(state: Survey, results: Results | None, baseline: Path) -> dict[str, FolderFiles]:
    """Return the folders by the name of their system, as loaded or as accepted.

    A robot file is named by its path, not by the robot's name.

    Raises:
        FolderError: if two folders have one name.
    """
    loaded = {system.folder: system.name for system in results.systems} if results else {}
    names: dict[str, FolderFiles] = {}
    for scan in state.scans:
        system_baseline = state.matched[scan.folder]
        if scan.robot is not None:
            name = robot_name(scan.folder, baseline)
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


def is_expected(system_baseline: SystemBaseline, options: GateOptions) -> bool:
    """Return whether a system of the baseline should be among the given folders and robot files."""
    file = (options.baseline / system_baseline.declared.folder).resolve()
    if system_baseline.robot is not None and file.exists():
        return False
    if options.parents is None:
        return True
    if system_baseline.robot is not None:
        return any(file.is_relative_to(path.resolve()) for path in options.parents)
    parent = system_baseline.declared.folder.rpartition("/")[0]
    return parent in {location(path, options.baseline) for path in options.parents}


def was_left_alone(
    scan: FolderFiles, system_baseline: SystemBaseline, case: CaseId, state: Survey
) -> bool:
    """Return whether an accepted case still exists and was not run because nothing changed."""
    if case.scenario not in system_baseline.declared.scenarios:
        return False
    here = any(m.model == case.model and case.engine in m.engines for m in scan.models)
    return here and (str(scan.folder), case.model, case.engine) not in state.chosen
