"""The arguments of `crosscheck sweep`."""

from __future__ import annotations

import argparse
from pathlib import Path

from physics_crosscheck.harness.cli import arguments

DESIGNS = ("latin", "sobol", "random")
"""Those of `harness.sweep.draws` that take a number of draws; to import them takes sympy."""


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    arguments.folders(command, some=False)
    arguments.alone(command)
    command.add_argument(
        "--vary",
        action=arguments.Gathered,
        default=[],
        metavar="NAME=LOW:HIGH[:log]",
        help="draw a constant, or a number of a robot's file by its address, from a range"
        " (x0.8:x1.25: multiples; * in a name: anything), or NAME=V1,V2 from a list; repeatable",
    )
    command.add_argument(
        "--draws",
        type=arguments.positive,
        default=None,
        metavar="N",
        help="draws of the constants (every combination of listed values)",
    )
    command.add_argument("--seed", type=int, default=0, metavar="S", help="of the draws (0)")
    command.add_argument(
        "--design",
        choices=DESIGNS,
        default=DESIGNS[0],
        help="how draws are spread over the ranges (latin)",
    )
    command.add_argument(
        "--step",
        type=_steps,
        default=(),
        metavar="H1,H2",
        help="shipped steps to try, seconds (each model's own)",
    )
    for name, of in (("integrator", "integrators"), ("scenario", "scenarios")):
        command.add_argument(
            f"--{name}",
            action=arguments.Gathered,
            default=[],
            metavar="NAME",
            help=f"{of} to try; repeatable ({'each model’s own' if of[0] == 'i' else 'all'})",
        )
    arguments.engine(command)
    command.add_argument(
        "--versions",
        nargs="+",
        default=[],
        metavar="NAME VERSION",
        help="only this engine, in each of these versions of it: the same cases, each version's"
        " rows in a folder of --out, and what is another; of one that is installed already:"
        " VERSION=path/to/environment",
    )
    command.add_argument("--under", nargs=2, default=[], help=argparse.SUPPRESS)
    arguments.environments(command)
    arguments.resolution_of(command)
    arguments.limits(command)
    arguments.jobs(command, "two")
    arguments.scheduler(command)
    command.add_argument(
        "--out",
        type=Path,
        default=Path("reports/sweep"),
        metavar="DIR",
        help="where rows, plan and page go; what is there is gone on with (reports/sweep)",
    )
    alone = command.add_mutually_exclusive_group()
    alone.add_argument(
        "--only", type=int, default=None, metavar="INDEX", help="run this case alone, and print it"
    )
    alone.add_argument(
        "--summary", type=Path, default=None, metavar="DIR", help="tell again what is in DIR"
    )


def _steps(text: str) -> tuple[float, ...]:
    """Steps above zero, each once."""
    found = tuple(arguments.seconds(part) for part in text.split(","))
    if len(set(found)) < len(found):
        raise argparse.ArgumentTypeError(f"{text} names a step twice")
    return found
