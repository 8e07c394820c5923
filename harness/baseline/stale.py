"""What changed since it was accepted, by hashes and versions alone: nothing is run."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from harness.baseline.fingerprint import FolderFiles, ModelFiles
from harness.baseline.store import Entry, SystemBaseline, case_key
from harness.files.folders import builtin
from harness.numerics.version import VERSION


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
        if one.folder == here:
            return one
    named = [b for b in baseline.values() if b.folder.rpartition("/")[2] == folder.name]
    return named[0] if len(named) == 1 else None


def touched(
    scan: FolderFiles,
    model: ModelFiles,
    engine: str,
    one: SystemBaseline | None,
    versions: Mapping[str, str | None],
    resolution: float,
) -> bool:
    """Whether anything that the cases of a model in an engine depend on is not as accepted."""
    if one is None or one.declared != scan.system or not one.scenarios:
        return True
    for scenario in one.scenarios:
        entry = one.cases.get(case_key(model.model, scenario, engine))
        if entry is None or not as_accepted(entry, model.hashes, engine, versions, resolution):
            return True
    return False


def as_accepted(
    entry: Entry,
    hashes: Mapping[str, str],
    engine: str,
    versions: Mapping[str, str | None],
    resolution: float,
) -> bool:
    """Whether what a case depends on is what it was when it was accepted."""
    return bool(
        entry["files"] == hashes
        and entry["engine"] == f"{engine} {versions.get(engine)}"
        and entry["resolution"] == resolution
        and entry["numerics"] == VERSION
    )
