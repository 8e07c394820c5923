"""A run against the accepted baseline: known differences, and what changed.

A known difference is a case that doesn't agree and was accepted so with a reason. It passes where
cases are counted, and is shown as that, as long as it is the same: the outcome, and the model's and
the equations' motion on the accepted track.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from harness.baseline.changes import Status, is_known
from harness.baseline.classify import judge, unaccepted
from harness.baseline.fingerprint import FolderFiles, folder_files
from harness.baseline.snapshot import Snapshot, snapshot_from
from harness.baseline.stale import match, touched
from harness.baseline.store import SystemBaseline, case_key, read_baseline
from harness.engines.registry import engines

Record = dict[str, Any]


@dataclass(frozen=True)
class Accepted:
    """What was accepted of some folders, and what they are now.

    Attributes:
        place: the baseline's folder.
        systems: the baseline, by name.
        folders: each folder's files, with what was accepted of it.
        versions: of the engines.
        resolution: of the run.
        engines: those that run; none: all.
        tracks: of the cases that a run is to measure, by case id: known differences, and those that
            something changed of.
    """

    place: Path
    systems: Mapping[str, SystemBaseline] = field(repr=False)
    folders: Mapping[str, tuple[FolderFiles, SystemBaseline | None]] = field(repr=False)
    versions: Mapping[str, str | None]
    resolution: float
    engines: tuple[str, ...]
    tracks: Mapping[str, Snapshot] = field(repr=False)

    @property
    def known(self) -> frozenset[str]:
        """Case ids of the known differences."""
        return frozenset(f"{name}/{key}" for name, one in self.systems.items() for key in one.known)


def accepted(
    place: Path | None, folders: Sequence[Path], resolution: float, only: tuple[str, ...] = ()
) -> Accepted | None:
    """Read a baseline for a run of some folders; None where nothing was accepted.

    Raises:
        BaselineError: for a baseline that can't be believed.
        OSError: for a file that can't be read.
    """
    systems = {} if place is None else read_baseline(place)
    if place is None or not systems:
        return None
    versions = {name: engine.version() for name, engine in engines().items()}
    found: dict[str, tuple[FolderFiles, SystemBaseline | None]] = {}
    tracks: dict[str, Snapshot] = {}
    for folder in folders:
        scan = folder_files(folder, place)
        one = match(folder, place, systems)
        found[str(folder)] = scan, one
        if one is None:
            continue
        stale = {
            (model.model, engine)
            for model in scan.models
            for engine in model.engines
            if touched(scan, model, engine, one, versions, resolution)
        }
        for key, entry in one.cases.items():
            model, engine = key.split("/")[0], key.rsplit("[", 1)[1].rstrip("]")
            if key in one.known or (model, engine) in stale:
                tracks[f"{one.system}/{key}"] = snapshot_from(one.tracks[entry["track"]])
    return Accepted(place, systems, found, versions, resolution, only, tracks)


def mark_known(cases: Sequence[Record], found: Accepted | None) -> None:
    """Give every case that is a known difference the reason it was accepted with, `accepted`.

    One that was accepted and has changed since is told so in its own reason.
    """
    if found is None:
        return
    for case in cases:
        measured = case.get("measured")
        one = found.systems.get(case["system"])
        entry = one and one.known.get(case_key(case["model"], case["scenario"], case["engine"]))
        if not one or not entry or measured is None or case["outcome"] == "AGREES":
            continue
        if case["outcome"] in ("FAILED", "ABSENT"):
            continue
        changed = is_known(entry, one.tracks[entry["track"]], case)
        if changed:
            case["reason"] += (
                f"; a known difference was accepted here ({entry['reason']}), but {changed}"
            )
        else:
            case["accepted"] = entry["reason"]


def since(cases: Sequence[Record], found: Accepted | None) -> Record | None:
    """What changed since the baseline, as results.json has it; None without a baseline."""
    if found is None:
        return None
    changes = [change for case in cases if (change := _change(case, found))]
    seen = {(c["system"], case_key(c["model"], c["scenario"], c["engine"])) for c in cases}
    failed = {c["system"] for c in cases if c["scenario"] == "-"}
    for _, one in found.folders.values():
        if one is None or one.system in failed:
            continue
        for key in one.cases:
            model, rest = key.split("/", 1)
            scenario, engine = rest.rstrip("]").rsplit(" [", 1)
            if (one.system, key) not in seen and (not found.engines or engine in found.engines):
                changes.append(
                    {
                        "system": one.system,
                        "model": model,
                        "engine": engine,
                        "scenario": scenario,
                        "kind": "missing",
                        "message": "it was accepted, and there is no such case now",
                    }
                )
    order = ["regression", "missing", "change", "new", "improvement"]
    changes.sort(key=lambda change: order.index(change["kind"]))
    return {"name": found.place.as_posix(), "changes": changes}


def _change(case: Record, found: Accepted) -> Record | None:
    """What became of one case; None where it is as it was accepted."""
    where = {name: case[name] for name in ("system", "model", "engine", "scenario")}
    one = found.systems.get(case["system"])
    key = case_key(case["model"], case["scenario"], case["engine"])
    entry = one.cases.get(key) if one else None
    if entry is None:
        return {**where, "kind": "new", "message": unaccepted(case)}
    ran = case["outcome"] not in ("FAILED", "ABSENT")
    if ran and case.get("measured") is None:
        return None
    scan, _ = found.folders[case["folder"]]
    change = judge(case["system"], case, scan, one, found.versions, found.resolution)
    if change.status in (Status.SAME, Status.KNOWN, Status.WITHIN):
        return None
    worse = (
        case["outcome"] != "AGREES"
        or change.status is Status.NOT_RUN
        or (case["raw_error"] or 0) > (entry["raw_error"] or 0)
    )
    kind = "change" if not worse else "regression"
    if change.status is Status.IMPROVED:
        kind = "improvement"
    return {**where, "kind": kind, "message": "; ".join(change.told)}
