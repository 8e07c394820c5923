"""The arguments of `crosscheck run`."""

from __future__ import annotations

import argparse
from pathlib import Path

from physics_crosscheck.harness.cli import arguments


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    arguments.folders(command, some=False)
    arguments.engine(command)
    arguments.words(command)
    command.add_argument(
        "--last-failed",
        action="store_true",
        help="only what did not agree in the last run, by DIR/results.json",
    )
    arguments.alone(command)
    arguments.resolution_of(command)
    arguments.limits(command)
    arguments.jobs(command)
    arguments.scheduler(command)
    command.add_argument(
        "--out",
        type=Path,
        default=Path("reports"),
        metavar="DIR",
        help="where results.json and index.html go (reports)",
    )
    command.add_argument(
        "--format",
        choices=("text", "json", "github", "sarif"),
        default="text",
        help="what is printed: a table, or results for a program (text)",
    )
    how_much = command.add_mutually_exclusive_group()
    how_much.add_argument(
        "-q", "--quiet", action="store_true", help="print what doesn't agree, and a summary"
    )
    how_much.add_argument(
        "-v", "--verbose", action="store_true", help="print a line for each case in a log"
    )
    arguments.cache(command)
    command.add_argument(
        "--resume",
        action="store_true",
        help="go on with a run that was stopped: what it did is kept, unless its files changed",
    )
    command.add_argument(
        "--watch",
        action="store_true",
        help="go on: when a file is saved, run the models again that are made of it; Ctrl-C ends",
    )
    command.add_argument(
        "--history",
        action="store_true",
        help="keep a line a case in DIR/history, for the page to draw; later runs go on with it",
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
    arguments.floating(command)
    arguments.chosen_model(command)
