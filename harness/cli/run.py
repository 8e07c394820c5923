"""`crosscheck run`: every model of the folders against their equations."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from harness.cli import arguments
from harness.cli.exit_codes import FAIL, SIGNALLED, exit_code
from harness.cli.missing import tell_missing, with_missing
from harness.files.folders import FolderError, NamedFolders, check_engines, named_folders
from harness.files.model_files import absent_lines
from harness.records.journal import Journal, journal
from harness.records.results import Results
from harness.records.write import encoded, write_whole
from harness.report import write_report
from harness.robots.named import NamedRobots, robot_files
from harness.run import Interruption, Options, run
from harness.schedule.stop import asking
from harness.text.coverage import left_out, refused
from harness.text.github import case_notes, commands
from harness.text.progress import Progress
from harness.text.table import print_results


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    arguments.folders(command, some=False)
    arguments.engine(command)
    arguments.resolution_of(command)
    arguments.limits(command)
    arguments.jobs(command)
    command.add_argument(
        "--out",
        type=Path,
        default=Path("reports"),
        metavar="DIR",
        help="where results.json and index.html go (reports)",
    )
    command.add_argument(
        "--resume",
        action="store_true",
        help="go on with a run that was stopped: what it did is kept, unless its files changed",
    )
    arguments.baseline(command)
    command.add_argument(
        "--require-engines", action="store_true", help="exit 3 where an engine is not installed"
    )
    command.add_argument(
        "--strict",
        action="store_true",
        help="exit 3 where a robot's file says what the check leaves out: limits, contacts, ...;"
        " or where one engine refuses it, whatever the others say",
    )
    command.add_argument(
        "--floating",
        action="store_true",
        help="the root link of a URDF that is given alone moves freely; else it is fixed",
    )


def main(options: argparse.Namespace) -> int:
    """Run, write results and report, print the table."""
    check_engines(options.engine)
    alone = robot_files(options.folders)
    robots = alone.files
    named = _named(alone)
    tell_missing(named)
    wanted = Options(
        engines=tuple(options.engine),
        resolution=options.resolution,
        jobs=options.jobs,
        limits=arguments.limits_of(options),
        baseline=options.baseline,
        floating=options.floating,
    )
    with journal(options.out, resume=options.resume) as done:
        with Progress() as progress, asking() as stop:
            asked = Interruption(stop, done)
            results = run(named.folders, wanted, progress, asked, robots).results
        write_whole(options.out / "results.json", encoded(results))
        write_report(options.out / "index.html", results)
        if not stop.asked:
            done.remove()
    _tell(results, options.out, robots)
    _tell_stopped(results, options.out, done)
    for line in absent_lines(named.folders):
        print(f"crosscheck: {line}", file=sys.stderr)
    if results.untested:
        print(f"crosscheck: {results.untested}", file=sys.stderr)
    code = with_missing(exit_code(results, options.require_engines), named)
    if options.strict and (left := [*left_out(results.models), *refused(results)]):
        print("\n".join(f"crosscheck: --strict: {line}" for line in left), file=sys.stderr)
        code = FAIL
    return SIGNALLED + stop.number if stop.asked else code


def _named(alone: NamedRobots) -> NamedFolders:
    """The folders that are named beside robots' files, and whatever name means nothing.

    Raises:
        FolderError: where nothing is left to run.
    """
    if alone.others or not (alone.files or alone.faults):
        named = named_folders(alone.others, beside=bool(alone.files or alone.faults))
    else:
        named = NamedFolders([], {})
    faults = {**alone.faults, **named.faults}
    if not alone.files and not named.folders:
        raise FolderError("; ".join(faults.values()))
    return NamedFolders(named.folders, faults)


def _tell(results: Results, out: Path, robots: Sequence[Path]) -> None:
    console = Console(soft_wrap=False, width=None if sys.stdout.isatty() else 160)
    for system in results.systems:
        if system.folder in {str(file) for file in robots}:
            print(f"{system.source}: {system.name}, {system.title}")
    print_results(console, results)
    print(f"{out / 'results.json'}  {out / 'index.html'}")
    for line in commands(case_notes(results), os.environ):
        print(line)


def _tell_stopped(results: Results, out: Path, done: Journal) -> None:
    """What is to be known of a run that did not end as it should."""
    if done.trouble:
        print(f"crosscheck: {done.trouble}; a stopped run could not go on here", file=sys.stderr)
    if results.stopped:
        said = f"stopped by {results.stopped}: {len(results.cases)} cases are done and kept"
        again = f"`crosscheck run --resume --out {out}`, with the same folders, goes on"
        print(f"crosscheck: {said}; {again}", file=sys.stderr)
