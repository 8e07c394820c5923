"""The arguments of `crosscheck derive`."""

from __future__ import annotations

import argparse

from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.help import INTERRUPTED, CommandHelp, group

ABOUT = CommandHelp(
    description="Print the equations of motion of systems, linearized, with their modes.\n"
    "Errors in published equations are listed where system.py quotes them.",
    examples={
        "Print the equations of a built-in system": "crosscheck derive free_pair",
        "Print them as LaTeX": "crosscheck derive my_arm --latex",
    },
    exit_codes={
        "0": "All equations were printed.",
        "2": "Wrong usage, or an unknown folder.",
        "3": "The equations of a folder could not be derived.",
        **INTERRUPTED,
    },
)


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    arguments.folders(command, required=True)
    arguments.limits(command)
    group(command, "Output").add_argument(
        "--latex", action="store_true", help="Print LaTeX instead of text"
    )
