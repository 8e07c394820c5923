"""What became of a case that was run, for the gate and for a run that knows a baseline alike."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from harness.baseline.changes import Change, Now, Status, compare
from harness.baseline.fingerprint import FolderFiles
from harness.baseline.store import SystemBaseline, case_key
from harness.numerics.version import VERSION


def unaccepted(case: Mapping[str, Any]) -> str:
    """What is said of a case that the baseline does not know."""
    return f"{case['outcome']}; nothing was accepted of it yet"


def judge(
    system: str,
    case: Mapping[str, Any],
    scan: FolderFiles,
    one: SystemBaseline | None,
    versions: Mapping[str, str | None],
    resolution: float,
    stale: bool = False,
) -> Change:
    """Hold a case against what was accepted of it.

    Args:
        system: its name, which the case may not know where its declaration can't be loaded.
        case: its record, with `measured`.
        scan: the files that it was run from.
        one: what was accepted of the system.
        versions: of the engines.
        resolution: of the run.
        stale: whether the files have changed since they were hashed.
    """
    engine = case["engine"]
    key = case_key(case["model"], case["scenario"], engine)
    measured = case.get("measured") or {"failed": "it was not measured"}
    entry = one.cases.get(key) if one else None
    files = next((m.hashes for m in scan.models if m.model == case["model"]), {})
    reason = ""
    if case["outcome"] in ("FAILED", "ABSENT"):
        reason = f"{case['outcome']}: {case['reason']}"
    elif stale:
        reason = "its files changed while it was run; run it again"
    elif "failed" in measured:
        reason = f"its motion could not be measured: {measured['failed']}"
    if reason:
        return Change(
            system, key, Status.NOT_RUN, (), (reason,), record=case, entry=entry, files=files
        )
    label = f"{engine} {versions[engine]}"
    if entry is None or one is None:
        told = (unaccepted(case),)
        return Change(system, key, Status.NEW, (), told, record=case, files=files, engine=label)
    now = Now(case, files, label, resolution, VERSION)
    return compare(system, key, entry, one.tracks[entry["track"]], now)
