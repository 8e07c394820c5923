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
from harness.records.results import write_results
from harness.report import write_report
from harness.run import Options, run
from harness.text.github import case_notes, commands
from harness.text.progress import Watcher
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
        tuple(options.engine),
        options.resolution,
        options.jobs,
        options.time_limit,
        options.baseline,
    )
    with Watcher() as watcher:
        found = run(folders, wanted, watcher)
    write_results(options.out / "results.json", found)
    write_report(options.out / "index.html", found)
    console = Console(soft_wrap=False, width=None if sys.stdout.isatty() else 160)
    print_results(console, found)
    print(f"{options.out / 'results.json'}  {options.out / 'index.html'}")
    for line in commands(case_notes(found), os.environ):
        print(line)
    return exit_code(found, options.require_engines)
