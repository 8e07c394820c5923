"""The arguments of `crosscheck accept`."""

from __future__ import annotations

import argparse

from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.help import INTERRUPTED, CommandHelp, group

ABOUT = CommandHelp(
    description="Accept the current results as the baseline, with a reason.\n"
    "Models that changed run first; the baseline folder gets the results.",
    examples={
        "Accept a robot file": "crosscheck accept robot.urdf --reason 'First baseline'",
        "Accept the cases of one model": "crosscheck accept --reason 'Mass fixed' 'arm/arm.urdf/*'",
    },
    exit_codes={
        "0": "The results were accepted, or nothing had changed.",
        "2": "Wrong usage, an unknown folder or case, or a run in CI.",
        "3": "A case could not run, or the baseline could not be read or written.",
        **INTERRUPTED,
    },
)


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    command.add_argument(
        "cases",
        nargs="*",
        metavar="TARGET",
        help="Folders, robot files or cases, e.g. 'arm/arm.urdf/*' [all]",
    )
    group(command, "Baseline").add_argument(
        "--reason", required=True, metavar="TEXT", help="Reason, stored in the baseline (required)"
    )
    group(command, "Selection").add_argument(
        "--folder",
        action=arguments.AppendAction,
        default=[],
        dest="folders",
        metavar="FOLDER",
        help="Folder or robot file; repeatable [those of the baseline]",
    )
    arguments.engine(command)
    arguments.floating(command, "as accepted")
    arguments.chosen_model(command, "as accepted")
    arguments.resolution_of(command)
    arguments.limits(command)
    arguments.jobs(command)
    arguments.baseline(command)
    group(command, "Output").add_argument(
        "-v", "--verbose", action="store_true", help="Print a line for each accepted case"
    )
