"""The arguments of `crosscheck versions`."""

from __future__ import annotations

import argparse

from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.help import INTERRUPTED, CommandHelp, group

ABOUT = CommandHelp(
    description="Run the same models in several versions of an engine and compare them.\n"
    "Each version gets its own environment. Write index.html.",
    examples={
        "Compare two versions of MuJoCo": "crosscheck versions arm.urdf"
        " --engine mujoco 3.3.7 3.4.0",
        "Use an environment of your own": "crosscheck versions --engine mujoco 3.3.7 3.4.0=env",
    },
    exit_codes={
        "0": "Nothing changed between the versions.",
        "1": "A case changed.",
        "2": "Wrong usage, or an unknown target.",
        "3": "A version could not be installed, or a case could not be compared.",
        **INTERRUPTED,
    },
)


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    arguments.targets(command, required=False, kinds="System folders and robot files")
    group(command, "Selection").add_argument(
        "--engine",
        nargs="+",
        action="append",
        required=True,
        metavar=("NAME", "VERSION"),
        help="Engine and at least two versions, as VERSION or VERSION=ENVIRONMENT (required)",
    )
    arguments.floating(command)
    arguments.resolution_of(command)
    arguments.diagnose(command)
    arguments.out(command, "reports/versions")
    arguments.json_file(command)
    arguments.environments(command)
    arguments.limits(command)
    arguments.jobs(command)
