"""The arguments of `crosscheck run`."""

from __future__ import annotations

import argparse

from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.help import INTERRUPTED, CommandHelp, group

ABOUT = CommandHelp(
    description="Check model files against their equations of motion, in every engine.\n"
    "Write results.json and the report index.html.",
    examples={
        "Check one robot file": "crosscheck run robot.urdf",
        "Check a folder in MuJoCo, and reuse results": "crosscheck run my_arm --engine mujoco"
        " --cache .cache",
    },
    exit_codes={
        "0": "Every case agrees, or its difference is accepted.",
        "1": "A case differs or is unresolved, or a number in a file is wrong.",
        "2": "Wrong usage, an unknown target, or a folder that is in use.",
        "3": "A check could not run, nothing was tested, or --strict or --require-engines fails.",
        **INTERRUPTED,
    },
)


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    arguments.targets(command, required=False, default=arguments.BELOW)
    arguments.engine(command)
    arguments.words(command)
    group(command, "Selection").add_argument(
        "--last-failed",
        action="store_true",
        help="Run only cases that did not pass in the last run",
    )
    arguments.robot_options(command)
    arguments.motion(command)
    arguments.resolution_of(command)
    arguments.strict(command)
    engines_required(command)
    output(command)
    group(command, "Output").add_argument(
        "--history",
        action="store_true",
        help="Record each run in DIR/history for the report's plots",
    )
    group(command, "Output").add_argument(
        "--watch",
        action="store_true",
        help="Rerun affected models when a file is saved; Ctrl-C ends",
    )
    arguments.cache(command)
    group(command, "Caching").add_argument(
        "--resume",
        action="store_true",
        help="Resume an interrupted run; cases whose files changed run again",
    )
    arguments.baseline(command)
    arguments.limits(command)
    arguments.jobs(command)
    arguments.scheduler(command)


def engines_required(command: argparse.ArgumentParser) -> None:
    """Declare whether a missing engine counts as a failure."""
    group(command, "Checks").add_argument(
        "--require-engines",
        action="store_true",
        help="Fail if a default engine is not installed",
    )


def output(command: argparse.ArgumentParser) -> None:
    """Declare the output folder and formats."""
    arguments.out(command, "reports")
    arguments.output_format(command, "text", "json", "github", "sarif")
    group(command, "Output").add_argument(
        "--details",
        action="store_true",
        help="Print errors, coverage, linearizations and single steps too",
    )
    verbosity = group(command, "Output").add_mutually_exclusive_group()
    verbosity.add_argument(
        "-q", "--quiet", action="store_true", help="Print only problems and the summary"
    )
    verbosity.add_argument(
        "-v",
        "--verbose",
        action="store_true",
        help="Print a line for each finished case, and missing engines",
    )
