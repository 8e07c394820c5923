"""`crosscheck run`: compare models with their equations, and print the verdict.

`crosscheck run --watch`: run again when a file changes; the cache reuses all other results.
"""

import argparse
import contextlib
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.baseline.fingerprint import always_lines
from physics_crosscheck.harness.documents.expanded import source_of, with_sources
from physics_crosscheck.harness.jobs.stop import asking
from physics_crosscheck.harness.modelfiles.code_reads import states_now
from physics_crosscheck.harness.modelfiles.folders import (
    FolderError,
    builtin,
    check_engines,
    system_folders,
)
from physics_crosscheck.harness.modelfiles.model_files import absent_engine_lines, unread_lines
from physics_crosscheck.harness.modelfiles.parts import named_files
from physics_crosscheck.harness.modelfiles.robot_targets import models_below
from physics_crosscheck.harness.records.hold import locked
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.records.write import encoded, write_whole
from physics_crosscheck.harness.render.html import write_report
from physics_crosscheck.harness.render.terminal.console import terminal
from physics_crosscheck.harness.render.terminal.progress import Progress
from physics_crosscheck.harness.render.terminal.table import print_results
from physics_crosscheck.harness.results.coverage import left_out, refused
from physics_crosscheck.harness.results.github import (
    advice,
    commands,
    harmless_json,
    plain_line,
    print_commands,
    run_notes,
)
from physics_crosscheck.harness.results.ignored import CodeFilter
from physics_crosscheck.harness.results.sarif import sarif
from physics_crosscheck.harness.results.status import counted
from physics_crosscheck.harness.results.visible import visible
from physics_crosscheck.harness.run import Options, run
from .exit_codes import AGREE, DIFFER, FAIL, SIGNALLED
from .report import check_page
from .targets import Targets, run_options, select_targets, warn_unknown, with_unknown

POLL = 0.25
"""Seconds between two scans of the files; scanning a hundred takes a millisecond."""

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
        code: exit code of the command.
        stopped: whether it was interrupted.
        reads: states of files that each folder's code has read, by name relative to it.
    """

    code: int
    stopped: bool
    reads: Reads


def watch(wanted: Targets, run: Callable[[], Ran]) -> int:
    """Run all, and again after each change, until interrupted; return the last exit code."""
    before = _states(_watched(wanted, {}))
    ran = run()
    while not ran.stopped:
        before = {**_states(_watched(wanted, ran.reads)), **before}
        files_watched = counted(len(_stamps(before)), "file")
        _print_line(f"watching {files_watched} for changes; press Ctrl-C to end")
        before, files = _wait(wanted, before, ran.reads)
        if sys.stdout.isatty():
            print("\x1b[2J\x1b[H", end="", flush=True)
        names = ", ".join(files[:MAX_NAMED_FILES]) + (
            f" and {len(files) - MAX_NAMED_FILES} more" * (len(files) > MAX_NAMED_FILES)
        )
        _print_line(f"{time.strftime('%H:%M:%S')}  changed: {names}")
        try:
            ran = run()
        except FolderError as error:
            _print_line(f"crosscheck: {error}")
    return ran.code


def _wait(
    wanted: Targets, before: Mapping[str, str], reads: Reads
) -> tuple[Mapping[str, str], list[str]]:
    """Wait until the content of a file changes; return the states and the changed files.

    A file must stay unchanged for a moment, so that a partly written one is not used.
    """
    stamps: Stamps = {}  # the first scan finds changes during the run
    while True:
        time.sleep(POLL)
        paths = _watched(wanted, reads)
        now = _stamps(paths)
        if now == stamps:
            continue
        time.sleep(POLL)
        if now != _stamps(_watched(wanted, reads)):
            continue
        stamps, states = now, _states(paths)
        every = sorted({**before, **states})
        if files := [path for path in every if before.get(path) != states.get(path)]:
            return states, files


def _watched(wanted: Targets, reads: Reads) -> set[str]:
    """Return the paths of all files of the targets, and those that code has read."""
    files = list(wanted.robots)
    for folder in wanted.folders:
        files += [path.with_suffix("") for path in folder.glob("*.toml")]
    paths = {*_inside(wanted.folders), *(path for file in files for path in _of_model(file))}
    read = {os.path.join(folder, name) for folder, states in reads.items() for name in states}
    return set(map(os.path.normpath, paths | read))


def _states(paths: Iterable[str]) -> Mapping[str, str]:
    return states_now(Path(), dict.fromkeys(paths, ""))


def _of_model(file: Path) -> list[str]:
    """Return the paths of a model file or its source, its sidecar, and the files that they name."""
    source, named = source_of(file), list[Path]()
    with contextlib.suppress(OSError):
        named += named_files(file)
        named += named_files(source) if source != file else ()
    return [str(source), f"{file}.toml", *map(str, named)]


def _stamps(paths: Iterable[str]) -> Stamps:
    """Return the stamps of those paths that exist."""
    stamps = {}
    for path in paths:
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
    check_engines(options.engines)
    if not (options.folders or options.last_failed):
        options.folders = models_below(Path())
    wanted = select_targets(options)
    if not (wanted.folders or wanted.robots):
        return AGREE
    if not options.watch:
        return _run(options, wanted).code
    if options.format != "text":
        raise FolderError(f"--watch prints text, not {options.format}; leave one of both out")
    with tempfile.TemporaryDirectory(prefix="crosscheck-") as cache:
        options.cache = options.cache or Path(cache)
        # Copies of sources, such as those of xacro, are written again.
        fixed = wanted if options.last_failed else None
        return watch(wanted, lambda: _run(options, fixed or select_targets(options)))


def demo(options: argparse.Namespace) -> int:
    """Run all built-in systems."""
    options.folders = [str(folder) for folder in system_folders([str(builtin())])]
    return main(options)


def _run(options: argparse.Namespace, wanted: Targets) -> Ran:
    """Run once, and write and print the results."""
    check_page(options.out / "index.html")
    warn_unknown(wanted.named)
    codes = CodeFilter(select=options.select, ignore=options.ignore)
    chosen = run_options(
        Options, options, choice=wanted.choice, strict=options.strict or options.exact
    )
    with locked(options.out, "run"), Progress(every=options.verbose) as progress:
        with asking() as stop:
            ran = run(wanted.folders, chosen, progress, stop, wanted.robots)
        if not (ran.results.cases or stop.requested or chosen.choice.everything):
            why = "no case has such a name, or its engine is not installed"
            raise FolderError(f"{why}; `crosscheck list` prints those that can be run")
        results = codes.results(with_sources(ran.results))
        progress.phase("writing the report")
        write_whole(options.out / "results.json", encoded(results))
        write_report(options.out / "index.html", results)
    _print(results, options)
    for line in codes.lines():
        print(f"crosscheck: {line}", file=sys.stderr)
    for line in always_lines(ran.reads):
        print(f"crosscheck: {line}", file=sys.stderr)
    _print_stopped(results, options)
    if chosen.cache is not None and chosen.cache.problem:
        print(f"crosscheck: {chosen.cache.problem}", file=sys.stderr)
    if options.verbose and chosen.choice.everything:
        _print_absent(absent_engine_lines(wanted.folders))
    for line in unread_lines(wanted.robots, chosen.engines):
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
    return Ran(code, bool(stop.requested), ran.reads)


def _print(results: Results, options: argparse.Namespace) -> None:
    if options.format == "json":
        print(harmless_json(encoded(results)), end="")
        return
    if options.format == "sarif":
        print(harmless_json(sarif(results)))
        return
    if options.format == "concise":
        print_commands(plain_line(note.concise) for note in [*run_notes(results), *advice(results)])
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


def _print_stopped(results: Results, options: argparse.Namespace) -> None:
    """Print the missing parts of an interrupted run, and how to resume it."""
    if results.stopped:
        what = f"stopped by {results.stopped}: {counted(len(results.cases), 'case')} done"
        how = "the same command runs the others"
        if options.cache is None:
            how = "with --cache DIR, the next run reuses what is done"
        print(f"crosscheck: {what}; {how}", file=sys.stderr)


def exit_code(results: Results, require_engines: bool) -> int:
    """Return the exit code of results.

    Results without cases fail; accepted differences pass. An audit or linearization that failed
    counts as a failure, and so does a robot file that every engine refuses. A refusal by one engine
    differs, unless the engine is optional or the refusal is accepted. A failure on an engine's own
    limit differs if another engine judges the file.
    """
    refused = {(case.folder, case.id) for case in results.refusals}
    counting = [case for case in results.cases if (case.folder, case.id) not in refused]
    outcomes = {case.outcome for case in counting if not case.accepted and case.kind != "no joint"}
    failed = [case for case in counting if case.outcome is Outcome.FAILED and not case.accepted]
    if not all(map(results.is_own_limit, failed)) or not results.cases or results.untested:
        return FAIL
    if any(case.outcome is Outcome.REFUSED and not results.judges(case) for case in counting):
        return FAIL
    if any(model.failures for model in results.models):
        return FAIL
    if require_engines and Outcome.ABSENT in outcomes:
        return FAIL
    if outcomes & {Outcome.DIFFERS, Outcome.UNRESOLVED, Outcome.REFUSED, Outcome.FAILED}:
        return DIFFER
    # An accepted difference includes the audit findings of its model.
    accepted = {(case.folder, case.id.of_model) for case in results.cases if case.accepted}
    models = [model for model in results.models if (model.folder, model.id) not in accepted]
    return AGREE if all(model.passes for model in models) else DIFFER
