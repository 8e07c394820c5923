"""Accept present results as the baseline: what a model does from now on, and why that is right."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from harness.baseline.changes import Change, Status
from harness.baseline.fingerprint import FolderFiles, digest_of
from harness.baseline.snapshot import snapshot_key
from harness.baseline.stale import location
from harness.baseline.store import Entry, SystemBaseline, write_baseline
from harness.files.folders import FolderError
from harness.gate.gate import GateResult
from harness.numerics.version import VERSION


class AcceptError(ValueError):
    """What can't be accepted; the message says why, and that nothing was written."""


@dataclass(frozen=True)
class Accepted:
    """What was written.

    Attributes:
        files: baseline files that changed.
        cases: ids of cases whose entry is new or says something else.
        left: ids of those asked for whose engine is absent: theirs are as they were.
    """

    files: tuple[Path, ...]
    cases: tuple[str, ...]
    left: tuple[str, ...]


def accept(
    found: GateResult, patterns: Sequence[str], reason: str, baseline: Path, resolution: float
) -> Accepted:
    """Write what a gate found into the baseline: the cases that match; all, without patterns.

    An entry whose motion did not move keeps its numbers and its reason, so that the difference
    under review is what changed. One named by a pattern takes the reason given.

    Raises:
        AcceptError: for a case that failed, or a file that changed meanwhile; nothing was written.
        FolderError: for a pattern that matches nothing; nothing was written.
        OSError: as the file system has it; nothing was written then either.
    """
    for pattern in patterns:
        if not any(_matches(change, pattern) for change in found.changes):
            known = sorted(c.case for c in found.changes)[:8]
            raise FolderError(f"no case matches {pattern!r}; there are {', '.join(known)}, ...")
    chosen = [c for c in found.changes if not patterns or any(_matches(c, p) for p in patterns)]
    failed = [c for c in chosen if c.status is Status.NOT_RUN and not _absent(c)]
    if failed:
        raise AcceptError(
            f"{failed[0].case} can't be accepted: {failed[0].told[0]}; nothing was written"
            + (f" ({len(failed) - 1} more like it)" if len(failed) > 1 else "")
        )
    systems = dict(found.baseline)
    told: list[str] = []
    texts: dict[tuple[str, str], bytes] = {}
    for change in chosen:
        if change.status is Status.NOT_RUN:
            continue
        one = systems.get(change.system) or _empty(change.system)
        cases, tracks = dict(one.cases), dict(one.tracks)
        old = cases.get(change.key)
        if change.status is Status.GONE:
            del cases[change.key]
        elif change.record is None:
            if patterns and old is not None:
                cases[change.key] = old | {"reason": reason}
        else:
            cases[change.key], new = _entry(change, reason, resolution, bool(patterns))
            tracks |= new
        if cases.get(change.key) != old:
            told.append(change.case)
        systems[change.system] = replace(one, cases=cases, tracks=tracks)
    touched = {c.system for c in chosen if c.status is not Status.NOT_RUN}
    for name in touched:
        scan = found.folders.get(name)
        if scan is not None:
            systems[name] = _headed(systems[name], scan, found.results, baseline)
            mine = [c for c in chosen if c.system == name and c.record is not None]
            texts |= _texts(scan, mine)
    files = write_baseline(baseline, [systems[name] for name in sorted(touched)], texts)
    left = tuple(change.case for change in chosen if _absent(change))
    return Accepted(tuple(files), tuple(told), left)


def summary_of(record: Mapping[str, Any]) -> str:
    """An entry in one line, for who reviews it."""

    def short(value: float | None, form: str) -> str:
        return "unknown" if value is None else format(value, form)

    return (
        f"{record['outcome']}, E {short(record['discrepancy'], '.0e')}"
        f" U {short(record['uncertainty'], '.0e')}; raw error {short(record['raw_error'], '.2%')}"
        f" at {short(record['shipped_step'], 'g')} s, {record['integrator']}"
    )


def _matches(change: Change, pattern: str) -> bool:
    """Whether a case's id is meant: `*` and `?` stand for anything, brackets for themselves."""
    pattern = pattern.replace("[", "[[]")
    return fnmatchcase(change.case, pattern) or fnmatchcase(change.case, f"{pattern} [[]*]")


def _absent(change: Change) -> bool:
    return change.record is not None and change.record["outcome"] == "ABSENT"


def _empty(system: str) -> SystemBaseline:
    return SystemBaseline(system, "", "", (), {}, {}, {})


def _entry(
    change: Change, reason: str, resolution: float, named: bool
) -> tuple[Entry, dict[str, Mapping[str, Any]]]:
    """What is accepted of a case, with the track that it refers to where that is a new one."""
    assert change.record is not None  # it was run
    record, measured = change.record, change.record["measured"]
    track = measured["track"]
    depends = {
        "files": dict(change.files),
        "engine": change.engine,
        "resolution": resolution,
        "numerics": VERSION,
        "shipped_step": record["shipped_step"],
        "integrator": record["integrator"],
        "claimed_order": record["claimed_order"],
    }
    unmoved = change.status in (Status.SAME, Status.WITHIN, Status.KNOWN)
    if unmoved and change.entry is not None:
        entry = dict(change.entry) | depends
        if named:
            entry["reason"] = reason
        return entry | {"summary": summary_of(entry)}, {}
    key = snapshot_key(track)
    entry = depends | {
        "reason": reason,
        "outcome": record["outcome"],
        "why": record["reason"],
        "discrepancy": record["discrepancy"],
        "uncertainty": record["uncertainty"],
        "component": record["component"],
        "constants": measured["constants"],
        "raw_error": record["raw_error"],
        "raw_order": record["raw_order"],
        "order": record["order"],
        "track": key,
        "end": measured["end"],
        "end_uncertainty": measured["uncertainty"],
    }
    return entry | {"summary": summary_of(entry)}, {key: track}


def _headed(
    one: SystemBaseline, scan: FolderFiles, results: Mapping[str, Any] | None, baseline: Path
) -> SystemBaseline:
    """With what the declaration says now, where it was loaded."""
    one = replace(one, folder=location(scan.folder, baseline))
    for record in (results or {"systems": ()})["systems"]:
        if record["folder"] == str(scan.folder):
            return replace(
                one,
                declared=scan.system,
                scenarios=tuple(s["name"] for s in record["scenarios"]),
                constants={c["name"]: c["value"] for c in record["constants"]},
            )
    return one


def _texts(scan: FolderFiles, changes: Sequence[Change]) -> dict[tuple[str, str], bytes]:
    """The texts of the models accepted.

    Raises:
        AcceptError: for one that is not what was run.
    """
    texts = {}
    for change in changes:
        model = change.key.split("/", 1)[0]
        for name in (model, f"{model}.toml", "system.py"):
            data = (scan.folder / name).read_bytes()
            if digest_of(data) != change.files[name]:
                raise AcceptError(f"{scan.folder / name}: changed while it was run; accept again")
            texts[change.system, name] = data
    return texts
