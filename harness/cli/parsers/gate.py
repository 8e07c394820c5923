"""The arguments of `crosscheck gate`."""

from __future__ import annotations

import argparse
from pathlib import Path

from physics_crosscheck.harness.cli import arguments


def add_meant(command: argparse.ArgumentParser) -> None:
    """Declare what `meant` reads."""
    command.add_argument(
        "folders",
        nargs="*",
        metavar="FOLDER",
        help="system folders; none: those of the baseline, and beside them",
    )
    arguments.engine(command)
    arguments.resolution_of(command)
    arguments.limits(command)
    arguments.jobs(command)
    arguments.baseline(command)
    command.add_argument(
        "--diagnose",
        action="store_true",
        help="name the cause where a model differs; takes a while",
    )


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_meant(command)
    command.add_argument(
        "--all", action="store_true", dest="every", help="run every case, changed or not"
    )
    command.add_argument(
        "--out",
        type=Path,
        default=Path("reports/gate"),
        metavar="DIR",
        help="where gate.json and summary.md go (reports/gate)",
    )
