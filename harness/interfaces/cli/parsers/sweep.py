"""The arguments of `crosscheck sweep`."""

from __future__ import annotations

import argparse
from pathlib import Path

from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.help import INTERRUPTED, CommandHelp, group

DESIGNS = ("latin", "sobol", "random")
"""Designs of `harness.extras.sweep.draws` with a number of draws; importing them needs sympy."""

ABOUT = CommandHelp(
    description="Check many variants of models: parameters, time steps, integrators, engines.\n"
    "Write a row for each case, a summary and index.html; rerun to resume.",
    examples={
        "Draw a stiffness 100 times": "crosscheck sweep my_arm --vary k=20:200 --draws 100",
        "Try two time steps of a robot file": "crosscheck sweep arm.urdf --step 0.001,0.002",
    },
    exit_codes={
        "0": "Every case agrees.",
        "1": "A case differs or is unresolved; with --versions, a case changed.",
        "2": "Wrong usage, an unknown target, or a name that nothing matches.",
        "3": "A case failed, or rows are damaged.",
        **INTERRUPTED,
    },
)


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    arguments.targets(command, required=False)
    arguments.standalone(command)
    _add_variants(command)
    arguments.engine(command)
    group(command, "Selection").add_argument(
        "--scenario",
        action=arguments.AppendAction,
        default=[],
        metavar="NAME",
        help="Scenario to run; repeatable [all]",
    )
    arguments.environments(command)
    arguments.resolution_of(command)
    arguments.limits(command)
    arguments.jobs(command, "2")
    arguments.scheduler(command)
    arguments.out(command, "reports/sweep")
    either = group(command, "Output").add_mutually_exclusive_group()
    either.add_argument(
        "--only", type=int, default=None, metavar="INDEX", help="Run and print only this case"
    )
    either.add_argument(
        "--summary",
        type=Path,
        default=None,
        metavar="DIR",
        help="Summarize the rows in DIR without running anything",
    )


def _add_variants(command: argparse.ArgumentParser) -> None:
    variants = group(command, "Variants")
    variants.add_argument(
        "--vary",
        action=arguments.AppendAction,
        default=[],
        metavar="NAME=VALUES",
        help="Vary a number: LOW:HIGH[:log], x0.8:x1.25 (factors) or V1,V2; repeatable",
    )
    variants.add_argument(
        "--draws",
        type=arguments.positive,
        default=None,
        metavar="N",
        help="Number of draws [all combinations of listed values]",
    )
    variants.add_argument(
        "--seed", type=int, default=0, metavar="N", help="Random seed of the draws [0]"
    )
    variants.add_argument(
        "--design",
        choices=DESIGNS,
        default=DESIGNS[0],
        help=f"Sampling design of the draws [{DESIGNS[0]}]",
    )
    variants.add_argument(
        "--step",
        type=_steps,
        default=(),
        metavar="SECONDS,...",
        help="Time steps to try, in seconds [each model's own]",
    )
    variants.add_argument(
        "--integrator",
        action=arguments.AppendAction,
        default=[],
        metavar="NAME",
        help="Integrator to try; repeatable [each model's own]",
    )
    variants.add_argument(
        "--versions",
        nargs="+",
        default=[],
        metavar=("NAME", "VERSION"),
        help="Engine and versions to try, as VERSION or VERSION=ENVIRONMENT",
    )
    variants.add_argument("--under", nargs=2, default=[], help=argparse.SUPPRESS)


def _steps(text: str) -> tuple[float, ...]:
    """Return time steps above zero, each once."""
    steps = tuple(arguments.seconds(part) for part in text.split(","))
    if len(set(steps)) < len(steps):
        raise argparse.ArgumentTypeError(f"must name each time step once, not {text}")
    return steps
