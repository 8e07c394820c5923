"""`crosscheck run`: every model of the folders against their equations."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from rich.console import Console

from harness.cli import arguments
from harness.cli.exit_codes import exit_code
from harness.files.folders import check_engines, system_folders
from harness.records.write import encoded, write_whole
from harness.report import write_report
from harness.run import Options, run
from harness.text.github import case_notes, commands
from harness.text.progress import Progress
from harness.text.table import print_results


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    arguments.folders(command, some=False)
    arguments.engine(command)
    arguments.limits(command)
    arguments.jobs(command)
    command.add_argument(
        "--out",
        type=Path,
        default=Path("reports"),
        metavar="DIR",
        help="where results.json and index.html go (reports)",
    )
    arguments.baseline(command)
    command.add_argument(
        "--require-engines", action="store_true", help="exit 3 where an engine is not installed"
    )


def main(options: argparse.Namespace) -> int:
    """Run, write results and report, print the table."""
    check_engines(options.engine)
    folders = system_folders(options.folders)
    wanted = Options(
        engines=tuple(options.engine),
        resolution=options.resolution,
        jobs=options.jobs,
        limit=options.time_limit,
        baseline=options.baseline,
    )
    with Progress() as progress:
        results = run(folders, wanted, progress).results
    write_whole(options.out / "results.json", encoded(results))
    write_report(options.out / "index.html", results)
    console = Console(soft_wrap=False, width=None if sys.stdout.isatty() else 160)
    print_results(console, results)
    print(f"{options.out / 'results.json'}  {options.out / 'index.html'}")
    for line in commands(case_notes(results), os.environ):
        print(line)
    return exit_code(results, options.require_engines)
