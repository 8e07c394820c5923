"""`crosscheck run`: compare models with their equations, and print the verdict.

`crosscheck run --watch`: run models again when their files change.

A model runs again if the content of one of its files changes: the model file, its sidecar, a mesh,
`system.py`, any file in the folder that no other model names, or a file elsewhere that `system.py`
has read or looked for.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from physics_crosscheck.harness.baseline.fingerprint import OTHER_FILES, always_lines, folder_files
from physics_crosscheck.harness.documents.expanded import with_sources
from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.exit_codes import AGREE, DIFFER, FAIL, SIGNALLED
from physics_crosscheck.harness.interfaces.cli.report import check_page
from physics_crosscheck.harness.interfaces.cli.targets import (
    Targets,
    select_targets,
    warn_unknown,
    with_unknown,
)
from physics_crosscheck.harness.jobs.stop import asking
from physics_crosscheck.harness.modelfiles.choice import NamedModel
from physics_crosscheck.harness.modelfiles.folders import (
    FolderError,
    NamedFolders,
    builtin,
    check_engines,
    system_folders,
)
from physics_crosscheck.harness.modelfiles.model_files import absent_engine_lines, unread_lines
from physics_crosscheck.harness.modelfiles.parts import named_files
from physics_crosscheck.harness.modelfiles.path_states import UNKNOWN, states_now
from physics_crosscheck.harness.modelfiles.robot_targets import models_below
from physics_crosscheck.harness.planning.cache import Cache
from physics_crosscheck.harness.records.journal import Journal, journal
from physics_crosscheck.harness.records.merged import merged
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.records.write import encoded, write_whole
from physics_crosscheck.harness.render.html import write_report
from physics_crosscheck.harness.render.terminal.console import terminal
from physics_crosscheck.harness.render.terminal.progress import Progress
from physics_crosscheck.harness.render.terminal.table import print_results
from physics_crosscheck.harness.results.coverage import left_out, refused
from physics_crosscheck.harness.results.github import (
    commands,
    harmless_json,
    print_commands,
    run_notes,
)
from physics_crosscheck.harness.results.sarif import sarif
from physics_crosscheck.harness.results.status import counted
from physics_crosscheck.harness.results.visible import visible
from physics_crosscheck.harness.run import Options, RunControl, run

POLL = 0.25
"""Seconds between two scans of the files; scanning a hundred takes a millisecond."""

Place = tuple[str, str]
"""A folder and a model in it. Without a model: the whole folder, or a robot file."""

Hashes = Mapping[Place, Mapping[str, str]]
"""Hashes of the files of each place, by path; of the folder's other files, by the folder's."""

Stamps = Mapping[str, tuple[int, int]]
"""Modification time and size of each file."""

Reads = Mapping[str, Mapping[str, str]]
"""Files that each folder's code read or looked for, by folder: states by relative name."""

MAX_NAMED_FILES = 3
"""Maximum number of changed files to name."""


@dataclass(frozen=True)
class Ran:
    """Result of a run.

    Attributes:
        results: all current results.
        code: exit code of the command.
        stopped: whether it was interrupted.
        reads: states of files that each folder's code has read, by name relative to it.
    """

    results: Results
    code: int
    stopped: bool
    reads: Reads


Run = Callable[[Targets, Callable[[Results], Results]], Ran]
"""Runs targets; the second argument transforms the results before they are written and returned."""


def watch(wanted: Targets, run: Run) -> int:
    """Run all, then what changes, until interrupted; return the exit code of the last run."""
    before = _hashes(wanted)
    ran = run(wanted, lambda results: results)
    reads = dict(ran.reads)
    before = _with_reads(before, reads)  # states at the time of reading
    while not ran.stopped:
        stamps = _stamps(wanted, before)
        files_watched = counted(len(stamps), "file")
        _print_line(f"watching {files_watched} for changes; press Ctrl-C to end")
        before, again, files = _wait(wanted, before, reads, stamps)
        part = _part(wanted, again)
        if not (part.folders or part.robots):
            continue
        if sys.stdout.isatty():
            print("\x1b[2J\x1b[H", end="", flush=True)
        names = ", ".join(files[:MAX_NAMED_FILES]) + (
            f" and {len(files) - MAX_NAMED_FILES} more" * (len(files) > MAX_NAMED_FILES)
        )
        _print_line(f"{time.strftime('%H:%M:%S')}  changed: {names}")
        try:
            ran = run(part, _with_others(ran.results, again))
            reads |= ran.reads
            before = _with_reads(before, ran.reads)
        except FolderError as error:
            _print_line(f"crosscheck: {error}")
    return ran.code


def _with_others(last: Results, again: set[Place]) -> Callable[[Results], Results]:
    """Return a function that merges new results with those of the unchanged models."""
    whole = {folder for folder, model in again if not model}

    def merge_results(now: Results) -> Results:
        def is_again(folder: str, model: str) -> bool:
            return folder in whole or (folder, model) in again

        return merged(last, now, is_again)

    return merge_results


def _part(wanted: Targets, again: set[Place]) -> Targets:
    """Return the targets that changed."""
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
    wanted: Targets, before: Hashes, reads: Reads, stamps: Stamps
) -> tuple[Hashes, set[Place], Sequence[str]]:
    """Wait until the content of a file changes; return the new hashes, changed places and files.

    A file must stay unchanged for a moment, so that a partly written one is not used.
    """
    is_first = True  # the first scan finds changes during the run
    while True:
        time.sleep(POLL)
        now = _stamps(wanted, before)
        if now == stamps and not is_first:
            continue
        time.sleep(POLL)
        if now != _stamps(wanted, before):
            continue
        hashes_now = _with_reads(_hashes(wanted), _now(reads))
        again = {key for key in {*before, *hashes_now} if before.get(key) != hashes_now.get(key)}
        if now != stamps or again:  # a change may concern a folder whose inputs are unknown
            again |= {key for key, files in hashes_now.items() if UNKNOWN in files.values()}
        if again:
            files = dict.fromkeys(_changed(before, hashes_now, again))
            moved = [os.path.relpath(p) for p in {**stamps, **now} if now.get(p) != stamps.get(p)]
            return hashes_now, again, list(files) or moved
        before, stamps, is_first = hashes_now, now, False


def _changed(before: Hashes, now: Hashes, again: set[Place]) -> Iterator[str]:
    """Yield the paths of changed files."""
    for place in sorted(again):
        old, new = before.get(place, {}), now.get(place, {})
        yield from (name for name in sorted({*old, *new}) if old.get(name) != new.get(name))


def _hashes(wanted: Targets) -> Hashes:
    """Return hashes of all targets; those of unreadable files have no model name."""
    hashes: dict[Place, Mapping[str, str]] = {}
    for folder in wanted.folders:
        whole = str(folder), ""
        try:
            scan = folder_files(folder)
        except OSError as error:  # being written, or deleted
            hashes[whole] = {str(error.filename or folder): UNKNOWN}
            continue
        for model_files in scan.models:
            hashes[str(folder), model_files.model] = {
                str(folder) if name == OTHER_FILES else os.path.normpath(folder / name): value
                for name, value in model_files.hashes.items()
            }
        if scan.broken or not scan.models:
            hashes[whole] = {str(folder): "\n".join((scan.system, *scan.broken))}
    for file in wanted.robots:
        hashes[str(file), ""] = states_now(Path(), dict.fromkeys(_of_robot(file), ""))
    return hashes


def _now(reads: Reads) -> Reads:
    return {folder: states_now(Path(folder), known) for folder, known in reads.items()}


def _with_reads(hashes: Hashes, reads: Reads) -> Hashes:
    """Add files that the code of folders has read: they affect all models of the folder."""
    extended = dict(hashes)
    for folder, states in reads.items():
        named = {os.path.normpath(Path(folder, name)): states[name] for name in states}
        if named:
            extended[folder, ""] = {**extended.get((folder, ""), {}), **named}
    return extended


def _of_robot(file: Path) -> list[str]:
    """Return the paths of a robot file, its sidecar, and the files that it names."""
    try:
        named = named_files(file)
    except OSError:
        named = ()
    return [str(file), f"{file}.toml", *map(str, named)]


def _stamps(wanted: Targets, hashes: Hashes) -> Stamps:
    """Return the stamps of all files in the folders, and of all other hashed files."""
    stamps = {}
    for path in {*_inside(wanted.folders), *(name for names in hashes.values() for name in names)}:
        try:
            status = os.stat(path)
        except OSError:
            continue
        stamps[path] = status.st_mtime_ns, status.st_size
    return stamps


def _inside(places: Sequence[Path]) -> Iterator[str]:
    """Yield the files in folders at any depth, except hidden ones and caches."""
    for place in places:
        for base, folders, names in os.walk(place, followlinks=True):
            folders[:] = [f for f in folders if not f.startswith((".", "__pycache__"))]
            yield from (os.path.join(base, n) for n in names if not n.startswith("."))


def _print_line(line: str) -> None:
    print(visible(line), file=sys.stderr, flush=True)


def main(options: argparse.Namespace) -> int:
    """Run, write results and report, print the verdict."""
    check_engines(options.engine)
    if not (options.folders or options.last_failed):
        options.folders = models_below(Path())
    wanted = select_targets(options)
    if not (wanted.folders or wanted.robots):
        return AGREE
    if not options.watch:
        return _run(options, wanted, lambda results: results).code
    if options.format != "text":
        raise FolderError(f"--watch prints text, not {options.format}; leave one of both out")
    return watch(wanted, partial(_run, options))


def demo(options: argparse.Namespace) -> int:
    """Run all built-in systems."""
    options.folders = [str(folder) for folder in system_folders([str(builtin())])]
    return main(options)


def _run(options: argparse.Namespace, wanted: Targets, among: Callable[[Results], Results]) -> Ran:
    """Run once; `among` merges the results into those that stay, which are written together."""
    check_page(options.out / "index.html")
    warn_unknown(wanted.named)
    cache = None if options.cache is None else Cache(options.cache)
    run_options = Options(
        engines=tuple(options.engine),
        resolution=options.resolution,
        jobs=options.jobs,
        limits=arguments.limits_of(options),
        baseline=options.baseline,
        floating=options.floating,
        motion=options.motion,
        smooth=options.smooth,
        ideal=options.ideal,
        model=options.chosen_model,
        choice=wanted.choice,
        scheduler=options.scheduler,
        cache=cache,
        thorough=options.thorough,
    )
    with journal(options.out, resume=options.resume) as done:
        with Progress(every=options.verbose) as progress:
            with asking() as stop:
                control = RunControl(stop, done)
                ran = run(wanted.folders, run_options, progress, control, wanted.robots)
            results = ran.results
            if not (results.cases or stop.requested or run_options.choice.everything):
                done.remove()
                why = "no case has such a name, or its engine is not installed"
                raise FolderError(f"{why}; `crosscheck list` prints those that can be run")
            whole, results = among(results), with_sources(results)
            written = with_sources(whole)
            progress.phase("writing the report")
            write_whole(options.out / "results.json", encoded(written))
            write_report(options.out / "index.html", written)
        if not stop.requested:
            done.remove()
    _print(results, options)
    for line in always_lines(ran.reads):
        print(f"crosscheck: {line}", file=sys.stderr)
    _print_stopped(results, options.out, done)
    if cache is not None and cache.problem:
        print(f"crosscheck: {cache.problem}", file=sys.stderr)
    if options.verbose and run_options.choice.everything:
        _print_absent(absent_engine_lines(wanted.folders))
    for line in unread_lines(wanted.robots, run_options.engines):
        print(f"crosscheck: {line}", file=sys.stderr)
    if results.untested:
        print(f"crosscheck: {results.untested}", file=sys.stderr)
    code = with_unknown(exit_code(results, options.require_engines), wanted.named)
    if options.strict and (untested_parts := [*left_out(results.models), *refused(results)]):
        print(
            "\n".join(f"crosscheck: --strict: {line}" for line in untested_parts), file=sys.stderr
        )
        code = FAIL
    code = SIGNALLED + stop.number if stop.requested else code
    return Ran(whole, code, bool(stop.requested), ran.reads)


def _print(results: Results, options: argparse.Namespace) -> None:
    """Print results in the selected format."""
    if options.format == "json":
        print(harmless_json(encoded(results)), end="")
        return
    if options.format == "sarif":
        print(harmless_json(sarif(results)))
        return
    if options.format == "github":
        print_commands(note.command(Path.cwd()) for note in run_notes(results))
        return
    print_results(
        terminal(),
        results,
        quiet=options.quiet,
        details=options.details,
        report=options.out / "index.html",
    )
    print_commands(commands(run_notes(results), os.environ))


def _print_absent(lines: Sequence[str]) -> None:
    """Print in one line the named engines that are not installed."""
    if lines:
        names = ", ".join(line.partition(":")[0] for line in lines)
        how = "`crosscheck engines` prints how to install them"
        print(f"crosscheck: not installed: {names}; {how}", file=sys.stderr)


def _print_stopped(results: Results, out: Path, done: Journal) -> None:
    """Print the missing parts of an interrupted run, and how to resume it."""
    if done.problem:
        print(f"crosscheck: {done.problem}; a stopped run can't be resumed here", file=sys.stderr)
    if results.stopped:
        what = f"stopped by {results.stopped}: {counted(len(results.cases), 'case')} done and kept"
        how = f"`crosscheck run --resume --out {out}`, with the same folders, resumes the run"
        print(f"crosscheck: {what}; {how}", file=sys.stderr)


def exit_code(results: Results, require_engines: bool) -> int:
    """Return the exit code of results.

    Results without cases fail; accepted differences pass. An audit or linearization that failed
    counts as a failure, and so does a robot file that every engine refuses. A refusal by one engine
    differs, unless the engine is optional or the refusal is accepted.
    """
    refused = {(case.folder, case.id) for case in results.refusals}
    counting = [case for case in results.cases if (case.folder, case.id) not in refused]
    outcomes = {case.outcome for case in counting if not case.accepted}
    if Outcome.FAILED in outcomes or not results.cases or results.untested:
        return FAIL
    if any(case.outcome is Outcome.REFUSED and not results.judges(case) for case in counting):
        return FAIL
    if any(model.failures for model in results.models):
        return FAIL
    if require_engines and Outcome.ABSENT in outcomes:
        return FAIL
    if outcomes & {Outcome.DIFFERS, Outcome.UNRESOLVED, Outcome.REFUSED}:
        return DIFFER
    # An accepted difference includes the audit findings of its model.
    accepted = {(case.folder, case.id.of_model) for case in results.cases if case.accepted}
    models = [model for model in results.models if (model.folder, model.id) not in accepted]
    return AGREE if all(model.passes for model in models) else DIFFER
