"""The arguments of `crosscheck mutate`."""

from __future__ import annotations

import argparse

from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.help import INTERRUPTED, CommandHelp
from physics_crosscheck.harness.jobs.limits import FAULT_SECONDS

ABOUT = CommandHelp(
    description="Plant known faults in models and report which ones the checks detect.\n"
    "Your files stay as they are: every fault goes into a copy.",
    examples={
        "Plant faults in a robot file": "crosscheck mutate robot.urdf --engine mujoco",
        "Keep every result for a program": "crosscheck mutate my_arm --json faults.json",
    },
    exit_codes={
        "0": "Every fault that motions can show was detected.",
        "1": "A fault was missed, or a correct model was reported as wrong.",
        "2": "Wrong usage, or an unknown target.",
        "3": "A model was wrong before any fault, or no fault could be planted.",
        **INTERRUPTED,
    },
)


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    arguments.targets(command, required=True)
    arguments.engine(command)
    arguments.robot_options(command)
    arguments.limits(command, FAULT_SECONDS)
    arguments.jobs(command, "2")
    arguments.json_file(command)
