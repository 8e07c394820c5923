"""`crosscheck run --watch`: save a file, see what its models do now.

A model is run again where the content of a file that it is made of has changed: its own, its
sidecar, a mesh, `system.py`, anything in the folder that no other model names, or what `system.py`
has read or looked for elsewhere.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from physics_crosscheck.harness.baseline.fingerprint import BESIDE, folder_files
from physics_crosscheck.harness.interfaces.cli.targets import Targets
from physics_crosscheck.harness.modelfiles.choice import NamedModel
from physics_crosscheck.harness.modelfiles.folders import FolderError, NamedFolders
from physics_crosscheck.harness.modelfiles.parts import named_files
from physics_crosscheck.harness.modelfiles.path_states import UNREADABLE, states_now
from physics_crosscheck.harness.records.merged import merged
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.results.status import counted
from physics_crosscheck.harness.results.visible import visible

POLL = 0.25
"""Seconds between two looks at the files; looking at a hundred takes a millisecond."""

Place = tuple[str, str]
"""A folder and a model in it. Without a model: all of the folder, or a robot's file alone."""

Hashes = Mapping[Place, Mapping[str, str]]
"""Of the files that each is made of, by their paths; of what lies beside, by the folder's."""

Stamps = Mapping[str, tuple[int, int]]
"""When each file was written, and its size."""

Reads = Mapping[str, Mapping[str, str]]
"""What each folder's code read or looked for, by folder: states by name relative to it."""

MOST = 3
"""Files that are named, of those that changed."""


@dataclass(frozen=True)
class Ran:
    """What became of a run.

    Attributes:
        results: all that is known now.
        code: with which the command ends.
        stopped: whether it was stopped before its end.
        reads: states of what each folder's code has read, by name relative to it.
    """

    results: Results
    code: int
    stopped: bool
    reads: Reads


Run = Callable[[Targets, Callable[[Results], Results]], Ran]
"""Runs what is asked; what is written and returned is what the second makes of its results."""


def watch(wanted: Targets, run: Run) -> int:
    """Run all, then what changes, until it is stopped; returns the exit code of the last run."""
    before = _hashes(wanted)
    ran = run(wanted, lambda results: results)
    reads = dict(ran.reads)
    before = _with_reads(before, reads)  # as they were when they were read
    while not ran.stopped:
        files_watched = counted(len(_stamps(wanted, before)), "file")
        _say(f"watching {files_watched} for changes; press Ctrl-C to end")
        before, again, files = _wait(wanted, before, reads)
        part = _part(wanted, again)
        if not (part.folders or part.robots):
            continue
        if sys.stdout.isatty():
            print("\x1b[2J\x1b[H", end="", flush=True)
        names = ", ".join(files[:MOST]) + (f" and {len(files) - MOST} more" * (len(files) > MOST))
        _say(f"{time.strftime('%H:%M:%S')}  changed: {names}")
        try:
            ran = run(part, _with_others(ran.results, again))
            reads |= ran.reads
            before = _with_reads(before, ran.reads)
        except FolderError as error:
            _say(f"crosscheck: {error}")
    return ran.code


def _with_others(last: Results, again: set[Place]) -> Callable[[Results], Results]:
    """Results of what was run again, with the others' as they were."""
    whole = {folder for folder, model in again if not model}

    def found(now: Results) -> Results:
        def is_again(folder: str, model: str) -> bool:
            return folder in whole or (folder, model) in again

        return merged(last, now, is_again)

    return found


def _part(wanted: Targets, again: set[Place]) -> Targets:
    """Of what is wanted, that which changed."""
    whole = {folder for folder, model in again if not model}
    models = dict(wanted.choice.models)
    for folder in map(str, wanted.folders):
        if folder in whole:
            continue
        changed = {model for where, model in again if where == folder}
        named = models.get(folder)
        if named is None:
            named = tuple(NamedModel(folder=Path(folder), model=m) for m in sorted(changed))
        models[folder] = tuple(one for one in named if one.model in changed)
    folders = [f for f in wanted.folders if str(f) in whole or models.get(str(f))]
    robots = [file for file in wanted.robots if str(file) in whole]
    return Targets(NamedFolders(folders, {}), robots, replace(wanted.choice, models=models))


def _wait(
    wanted: Targets, before: Hashes, reads: Reads
) -> tuple[Hashes, set[Place], Sequence[str]]:
    """Wait until the content of a file changes; returns what is made of others now, and those.

    A file that is being written is waited for: what counts is what stands still for a moment.
    """
    stamps: Stamps = {}  # what changed while it was run is found at the first look
    while True:
        time.sleep(POLL)
        now = _stamps(wanted, before)
        if now == stamps:
            continue
        time.sleep(POLL)
        if now != _stamps(wanted, before):
            continue
        found = _with_reads(_hashes(wanted), _now(reads))
        again = {key for key in {*before, *found} if before.get(key) != found.get(key)}
        if again:
            return found, again, list(dict.fromkeys(_changed(before, found, again)))
        before, stamps = found, now


def _changed(before: Hashes, now: Hashes, again: set[Place]) -> Iterator[str]:
    """Paths of what changed."""
    for place in sorted(again):
        old, new = before.get(place, {}), now.get(place, {})
        yield from (name for name in sorted({*old, *new}) if old.get(name) != new.get(name))


def _hashes(wanted: Targets) -> Hashes:
    """Of all that is wanted; under no model's name, what can't be read in a folder."""
    found: dict[Place, Mapping[str, str]] = {}
    for folder in wanted.folders:
        whole = str(folder), ""
        try:
            scan = folder_files(folder)
        except OSError as error:  # a file on its way, or gone
            found[whole] = {str(error.filename or folder): UNREADABLE}
            continue
        for one in scan.models:
            found[str(folder), one.model] = {
                str(folder) if name == BESIDE else os.path.normpath(folder / name): value
                for name, value in one.hashes.items()
            }
        if scan.broken or not scan.models:
            found[whole] = {str(folder): "\n".join((scan.system, *scan.broken))}
    for file in wanted.robots:
        found[str(file), ""] = states_now(Path(), dict.fromkeys(_of_robot(file), ""))
    return found


def _now(reads: Reads) -> Reads:
    return {folder: states_now(Path(folder), known) for folder, known in reads.items()}


def _with_reads(hashes: Hashes, reads: Reads) -> Hashes:
    """With what the code of folders has read: a change of that is one of all models."""
    found = dict(hashes)
    for folder, states in reads.items():
        named = {os.path.normpath(Path(folder, name)): states[name] for name in states}
        if named:
            found[folder, ""] = {**found.get((folder, ""), {}), **named}
    return found


def _of_robot(file: Path) -> list[str]:
    """A robot's file, its sidecar, and the files that it names."""
    try:
        named = named_files(file)
    except OSError:
        named = ()
    return [str(file), f"{file}.toml", *map(str, named)]


def _stamps(wanted: Targets, hashes: Hashes) -> Stamps:
    """Of all files in the folders, and of all else that is hashed."""
    found = {}
    for path in {*_inside(wanted.folders), *(name for names in hashes.values() for name in names)}:
        try:
            status = os.stat(path)
        except OSError:
            continue
        found[path] = status.st_mtime_ns, status.st_size
    return found


def _inside(places: Sequence[Path]) -> Iterator[str]:
    """Files in folders and below, but hidden ones and caches."""
    for place in places:
        for base, folders, names in os.walk(place, followlinks=True):
            folders[:] = [f for f in folders if not f.startswith((".", "__pycache__"))]
            yield from (os.path.join(base, n) for n in names if not n.startswith("."))


def _say(line: str) -> None:
    print(visible(line), file=sys.stderr, flush=True)
