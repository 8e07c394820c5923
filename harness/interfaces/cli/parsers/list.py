"""The arguments of `crosscheck list`."""

from __future__ import annotations

import argparse

from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.help import INTERRUPTED, CommandHelp

ABOUT = CommandHelp(
    description="List the cases that `crosscheck run` would check.\n"
    "Each case has a name: SYSTEM/MODEL/SCENARIO [ENGINE]. Nothing runs.",
    examples={
        "List the cases of a folder and of a robot file": "crosscheck list my_arm robot.urdf",
        "List the driven cases in MuJoCo": "crosscheck list -k driven --engine mujoco",
    },
    exit_codes={
        "0": "The cases were listed.",
        "2": "Wrong usage, an unknown target, or no such case.",
        **INTERRUPTED,
    },
)


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    arguments.targets(command, required=False, default=arguments.BELOW)
    arguments.engine(command)
    arguments.words(command)
    arguments.robot_options(command)
    arguments.output_format(command, "text", "json")
