"""The arguments of `crosscheck audit`."""

from __future__ import annotations

import argparse

from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.help import INTERRUPTED, CommandHelp

ABOUT = CommandHelp(
    description="Check the numbers of model files and engines without running motions.\n"
    "Print each wrong number with its file and line.",
    examples={
        "Audit every model of a folder, and a robot file": "crosscheck audit my_arm robot.urdf",
        "Audit one model in one engine": "crosscheck audit my_arm/arm.xml --engine mujoco",
    },
    exit_codes={
        "0": "No number is wrong.",
        "1": "A number is wrong.",
        "2": "Wrong usage, or an unknown target.",
        "3": "An audit failed, or no engine of the models is installed.",
        **INTERRUPTED,
    },
)


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    arguments.targets(command, required=True)
    arguments.engine(command)
    arguments.robot_options(command)
    arguments.limits(command)
    arguments.jobs(command)
    arguments.cache(command)
