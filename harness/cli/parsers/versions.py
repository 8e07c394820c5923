"""The arguments of `crosscheck versions`."""

from __future__ import annotations

import argparse
from pathlib import Path

from physics_crosscheck.harness.cli import arguments


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    command.add_argument(
        "folders",
        nargs="*",
        metavar="FOLDER",
        help="system folders, and robots' files; none: built-in",
    )
    command.add_argument(
        "--engine",
        nargs="+",
        action="append",
        required=True,
        metavar="NAME VERSION",
        help="an engine and two versions of it or more, each held against the one before; of one"
        " that is installed already: VERSION=path/to/environment",
    )
    arguments.environments(command)
    command.add_argument(
        "--out",
        type=Path,
        default=Path("reports/versions"),
        metavar="DIR",
        help="where index.html and each version's results go (reports/versions)",
    )
    command.add_argument("--json", type=Path, metavar="FILE", help="write the record to a file")
    command.add_argument(
        "--diagnose",
        action="store_true",
        help="name the cause where a model differs, in each version's report; takes a while",
    )
    arguments.floating(command)
    arguments.resolution_of(command)
    arguments.limits(command)
    arguments.jobs(command)
