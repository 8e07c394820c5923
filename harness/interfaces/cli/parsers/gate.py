"""The arguments of `crosscheck gate`."""

from __future__ import annotations

import argparse

from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.help import INTERRUPTED, CommandHelp, group

ABOUT = CommandHelp(
    description="Run the models that changed and compare them with the accepted baseline.\n"
    "Write gate.json and summary.md. Made for CI.",
    examples={
        "Check what changed since the baseline": "crosscheck gate",
        "Run every case of one folder": "crosscheck gate my_arm --all",
    },
    exit_codes={
        "0": "Every case is as accepted.",
        "1": "A case changed, is new, or is missing.",
        "2": "Wrong usage, or an unknown folder.",
        "3": "A case could not run, nothing ran, or the baseline is unreadable.",
        **INTERRUPTED,
    },
)


def add_selection(command: argparse.ArgumentParser) -> None:
    """Declare the arguments that select cases, for `gate` and `review`."""
    arguments.folders(
        command,
        required=False,
        kinds="Folders and robot files",
        default="those of the baseline",
    )
    arguments.engine(command)
    arguments.resolution_of(command)
    arguments.limits(command)
    arguments.jobs(command)
    arguments.baseline(command)
    arguments.diagnose(command)


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_selection(command)
    group(command, "Selection").add_argument(
        "--all", action="store_true", dest="every", help="Run every case, changed or not"
    )
    arguments.out(command, "reports/gate")
