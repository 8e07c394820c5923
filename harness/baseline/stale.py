"""What changed since it was accepted, by hashes and versions alone: nothing is run."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from physics_crosscheck.harness.baseline.file import SystemBaseline
from physics_crosscheck.harness.baseline.fingerprint import (
    Dependencies,
    FolderFiles,
    ModelFiles,
    as_now,
    dependencies,
)
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.path_states import UNREADABLE
from physics_crosscheck.harness.records.baseline import AcceptedCase
from physics_crosscheck.harness.records.case import CaseId


def location(folder: Path, baseline: Path) -> str:
    """How a baseline names a system's folder: relative to itself; an installed one by its name."""
    home = builtin().resolve()
    if folder.resolve().parent == home and home.parent.name == "harness":
        return f"builtin:{folder.name}"
    return Path(os.path.relpath(folder.resolve(), baseline.resolve())).as_posix()


def match(
    folder: Path, place: Path, baseline: Mapping[str, SystemBaseline]
) -> SystemBaseline | None:
    """The baseline of a folder: by its place; moved, by its name where that is unique."""
    here = location(folder, place)
    for one in baseline.values():
        if one.declared.folder == here:
            return one
    named = [b for b in baseline.values() if b.declared.folder.rpartition("/")[2] == folder.name]
    return named[0] if len(named) == 1 else None


def stale(
    scan: FolderFiles,
    model: ModelFiles,
    engine: str,
    one: SystemBaseline | None,
    versions: Mapping[str, str | None],
    resolution: float,
) -> bool:
    """Whether anything that the cases of a model in an engine depend on is not as accepted."""
    if one is None or one.declared.declared != scan.system or not one.declared.scenarios:
        return True
    ids = (
        CaseId(system=one.system, model=model.model, scenario=scenario, engine=engine)
        for scenario in one.declared.scenarios
    )
    return not all(_as_accepted(one.cases.get(case), model, versions, resolution) for case in ids)


def _as_accepted(
    entry: AcceptedCase | None,
    model: ModelFiles,
    versions: Mapping[str, str | None],
    resolution: float,
) -> bool:
    """Whether what a case depends on is what it was when it was accepted."""
    if entry is None or UNREADABLE in entry.files.values():
        return False
    now = dependencies(as_now(model, entry.files), entry.engine, versions, resolution)
    return now == Dependencies(
        files=entry.files,
        engine_version=entry.engine_version,
        resolution=entry.resolution,
        numerics=entry.numerics,
    )
