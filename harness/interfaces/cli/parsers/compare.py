"""The arguments of `crosscheck compare`."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.help import INTERRUPTED, CommandHelp, group

ABOUT = CommandHelp(
    description="Compare two model files of one mechanism, without declared equations.\n"
    "Print whether they move alike, and the numbers that differ.",
    examples={
        "Compare two files": "crosscheck compare robot.urdf robot.xml",
        "Compare one file in two engines": "crosscheck compare a.urdf a.urdf --engine-b pybullet",
    },
    exit_codes={
        "0": "The models agree.",
        "1": "They differ, the result is unresolved, or --strict was not met.",
        "2": "Wrong usage, or joints that cannot be paired.",
        "3": "A model could not be read or run, or an engine is not installed.",
        **INTERRUPTED,
    },
)


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    command.add_argument("a", type=Path, metavar="A", help="First model file")
    command.add_argument("b", type=Path, metavar="B", help="Second model file")
    selection = group(command, "Selection")
    selection.add_argument("--engine", metavar="NAME", help="Engine of both models")
    selection.add_argument("--engine-a", metavar="NAME", help="Engine of A")
    selection.add_argument("--engine-b", metavar="NAME", help="Engine of B")
    comparison = group(command, "Comparison")
    comparison.add_argument(
        "--joints",
        default="",
        metavar="A=B,...",
        help="Pair joints of A and B, e.g. hip=j1,knee=-j2 [by name]",
    )
    comparison.add_argument(
        "--map",
        type=Path,
        metavar="FILE",
        help="TOML file: [joints] gives joints of B as expressions of A's",
    )
    comparison.add_argument(
        "--start",
        action="append",
        default=[],
        type=_start,
        metavar="JOINT=VALUE,...",
        help="Start state, e.g. j=1,j_dot=0; repeatable [drawn within joint limits]",
    )
    comparison.add_argument(
        "--include-constraints",
        action="store_true",
        help="Include contacts, joint limits, dry friction and couplings",
    )
    arguments.floating(command)
    arguments.resolution_of(command)
    arguments.strict(command)
    arguments.json_file(command)
    arguments.limits(command)


def _start(text: str) -> dict[str, float]:
    """Return the values of a start state, by coordinate."""
    state = {}
    for part in text.split(","):
        name, _, value = part.partition("=")
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise argparse.ArgumentTypeError(f"must look like theta=1.5, not {part!r}")
        state[name.strip()] = number
    return state
