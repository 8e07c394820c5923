"""Changes since the acceptance, found from hashes and versions without running anything."""

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from physics_crosscheck.harness.documents.expanded import source_of
from physics_crosscheck.harness.engines.registry import engines_reading, engines_to_run
from physics_crosscheck.harness.modelfiles.code_reads import UNKNOWN
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.records.baseline import AcceptedCase, RobotOptions
from physics_crosscheck.harness.records.case import CaseId
from .file import SystemBaseline
from .fingerprint import (
    Dependencies,
    FolderFiles,
    ModelFiles,
    as_now,
    dependencies,
    folder_files,
    robot_file,
)


def location(folder: Path, baseline: Path) -> str:
    """Return the name of a system folder in a baseline: its relative path, or its package name."""
    folder = source_of(folder)
    home = builtin().resolve()
    if folder.resolve().parent == home and home.parent.name == "harness":
        return f"builtin:{folder.name}"
    return Path(os.path.relpath(folder.resolve(), baseline.resolve())).as_posix()


def robot_name(file: Path, baseline: Path) -> str:
    """Return the name of a robot file in a baseline: its path from their common folder.

    One of several models of `world.sdf` is named `world.MODEL.sdf`.
    """
    *parts, name = location(file, baseline).split("/")
    return "/".join(
        [*(part for part in parts if part != ".."), file.name if _of_several(file) else name]
    )


def _of_several(file: Path) -> bool:
    """Return whether a file is the copy of one of several models."""
    return file.suffix == ".sdf" and file.stem != source_of(file).stem


def robot_options(file: Path, *, floating: bool | None, model: str) -> RobotOptions:
    """Return the relevant options: floating for URDF, the model for SDFormat."""
    has_models = file.suffix == ".sdf" and not _of_several(file)
    return RobotOptions(
        floating=floating if file.suffix == ".urdf" else None, model=model if has_models else ""
    )


def scan_target(
    target: Path,
    place: Path,
    baseline: Mapping[str, SystemBaseline],
    only: Sequence[str] = (),
    robot: RobotOptions | None = None,
) -> tuple[FolderFiles, SystemBaseline | None]:
    """Hash a system folder or a robot file, and find its baseline.

    Args:
        target: the folder or the file.
        place: folder of the baseline.
        baseline: systems of the baseline, by name.
        only: engines to run besides the accepted ones; if none was accepted, all installed ones
            run.
        robot: options for reading a robot file; None: as accepted.

    Raises:
        OSError: for an unreadable file.
    """
    accepted = match(target, place, baseline)
    if target.is_dir():
        return folder_files(target, place), accepted
    if robot is None:
        robot = RobotOptions() if accepted is None or accepted.robot is None else accepted.robot
    wanted = {case.engine for case in accepted.cases} if accepted else set()
    wanted |= set(only) if accepted else {each.name for each in engines_to_run(target.suffix)}
    engines = tuple(each.name for each in engines_reading(target.suffix) if each.name in wanted)
    return robot_file(target, engines, robot), accepted


def match(
    target: Path, place: Path, baseline: Mapping[str, SystemBaseline]
) -> SystemBaseline | None:
    """Find the baseline of a target by its path, or by its name if it moved and the name is
    unique.
    """
    if not target.is_dir():
        named_so = baseline.get(robot_name(target, place))
        return None if named_so is None or named_so.robot is None else named_so
    here = location(target, place)
    for candidate in baseline.values():
        if candidate.declared.folder == here:
            return candidate
    named = [
        candidate
        for candidate in baseline.values()
        if candidate.robot is None and candidate.declared.folder.rpartition("/")[2] == target.name
    ]
    return named[0] if len(named) == 1 else None


def stale_models(
    scan: FolderFiles,
    accepted: SystemBaseline | None,
    versions: Mapping[str, str | None],
    resolution: float,
) -> Iterator[tuple[str, str]]:
    """Yield each model file with each engine in which a dependency of its cases changed."""
    for model in scan.models:
        for engine in model.engines:
            if stale(scan, model, engine, accepted, versions, resolution):
                yield model.model, engine


def stale(
    scan: FolderFiles,
    model: ModelFiles,
    engine: str,
    accepted: SystemBaseline | None,
    versions: Mapping[str, str | None],
    resolution: float,
) -> bool:
    """Return whether any dependency of a model's cases in an engine changed."""
    if accepted is None or accepted.robot != scan.robot:
        return True
    if accepted.declared.declared != scan.system or not accepted.declared.scenarios:
        return True
    ids = (
        CaseId(system=accepted.system, model=model.model, scenario=scenario, engine=engine)
        for scenario in accepted.declared.scenarios
    )
    return not all(
        _as_accepted(accepted.cases.get(case), model, versions, resolution) for case in ids
    )


def _as_accepted(
    entry: AcceptedCase | None,
    model: ModelFiles,
    versions: Mapping[str, str | None],
    resolution: float,
) -> bool:
    """Return whether the dependencies of a case are as accepted."""
    if entry is None or UNKNOWN in entry.files.values():
        return False
    now = dependencies(as_now(model, entry.files), entry.engine, versions, resolution)
    return now == Dependencies(
        files=entry.files,
        engine_version=entry.engine_version,
        resolution=entry.resolution,
        numerics=entry.numerics,
    )
