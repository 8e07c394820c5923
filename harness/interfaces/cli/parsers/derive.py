"""The arguments of `crosscheck derive`."""

from __future__ import annotations

import argparse

from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.help import INTERRUPTED, CommandHelp, group

ABOUT = CommandHelp(
    description="Print the equations of motion of system folders and robot files.\n"
    "Folders that declare energies have linearizations, modes and errata, too.",
    examples={
        "Print the equations of a robot file": "crosscheck derive robot.urdf",
        "Print those of a system folder as LaTeX": "crosscheck derive my_arm --latex",
    },
    exit_codes={
        "0": "All equations were printed.",
        "2": "Wrong usage, or an unknown target.",
        "3": "The equations of a target could not be derived.",
        **INTERRUPTED,
    },
)


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    arguments.targets(command, required=True)
    arguments.robot_options(command)
    arguments.limits(command)
    group(command, "Output").add_argument(
        "--latex", action="store_true", help="Print LaTeX instead of text"
    )
