"""The arguments of `crosscheck compare`."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from physics_crosscheck.harness.cli import arguments


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    command.add_argument("a", type=Path, metavar="A", help="a model file")
    command.add_argument("b", type=Path, metavar="B", help="another, or the same before an edit")
    command.add_argument("--engine", metavar="NAME", help="engine of both")
    command.add_argument("--engine-a", metavar="NAME", help="engine of A")
    command.add_argument("--engine-b", metavar="NAME", help="engine of B")
    command.add_argument(
        "--joints",
        default="",
        metavar="a=b,...",
        help="joints of A by those of B, as hip=j1,knee=-j2",
    )
    command.add_argument(
        "--map", type=Path, metavar="FILE", help="TOML, [joints]: those of B as expressions of A's"
    )
    command.add_argument(
        "--start",
        action="append",
        default=[],
        type=_start,
        metavar="j=1,...",
        help="a state to start from, j=1,j_dot=0; repeatable",
    )
    command.add_argument(
        "--as-shipped",
        action="store_true",
        help="with contacts, limits, dry friction and couplings, which are left out otherwise",
    )
    command.add_argument(
        "--strict",
        action="store_true",
        help="exit 1 where the files differ, or may differ, in what no run shows",
    )
    arguments.floating(command)
    command.add_argument("--json", type=Path, metavar="FILE", help="write the record to a file")
    arguments.resolution_of(command)
    arguments.limits(command)


def _start(text: str) -> dict[str, float]:
    state = {}
    for part in text.split(","):
        name, _, value = part.partition("=")
        try:
            number = float(value)
        except ValueError:
            raise argparse.ArgumentTypeError(f"{part!r} is not like theta=1.5") from None
        if not math.isfinite(number):
            raise argparse.ArgumentTypeError(f"{part!r} is no state to start from")
        state[name.strip()] = number
    return state
