"""The arguments of `crosscheck accept`."""

from __future__ import annotations

import argparse

from physics_crosscheck.harness.cli import arguments


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    command.add_argument(
        "cases",
        nargs="*",
        metavar="CASE",
        help="cases to accept, such as 'drum_pendulum/robot.urdf/*'; none: all",
    )
    command.add_argument(
        "--reason", required=True, metavar="TEXT", help="why this is right; kept in the baseline"
    )
    command.add_argument(
        "--folder",
        action="append",
        default=[],
        dest="folders",
        metavar="FOLDER",
        help="system folder; repeatable; none: those of the baseline",
    )
    arguments.engine(command)
    arguments.resolution_of(command)
    arguments.limits(command)
    arguments.jobs(command)
    arguments.baseline(command)
