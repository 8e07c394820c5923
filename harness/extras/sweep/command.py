"""The command `crosscheck sweep`."""

import argparse
from pathlib import Path

from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.help import INTERRUPTED, Command, group, option

DESIGNS = ("latin", "sobol", "random")
"""Designs of `harness.extras.sweep.factors` with a number of draws; importing them needs sympy."""


def _steps(text: str) -> tuple[float, ...]:
    """Return time steps above zero, each once."""
    steps = tuple(arguments.seconds(part) for part in text.split(","))
    if len(set(steps)) < len(steps):
        raise argparse.ArgumentTypeError(f"must name each time step once, not {text}")
    return steps


def _single_case_or_summary(command: argparse.ArgumentParser) -> None:
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


_VARIANTS = (
    option(
        "Variants",
        "--vary",
        action=arguments.AppendAction,
        default=[],
        metavar="NAME=VALUES",
        help="Vary a number: LOW:HIGH[:log], x0.8:x1.25 (factors) or V1,V2; repeatable",
    ),
    option(
        "Variants",
        "--draws",
        dest="count",
        type=arguments.positive,
        default=None,
        metavar="N",
        help="Number of draws [all combinations of listed values]",
    ),
    option(
        "Variants", "--seed", type=int, default=0, metavar="N", help="Random seed of the draws [0]"
    ),
    option(
        "Variants",
        "--design",
        choices=DESIGNS,
        default=DESIGNS[0],
        help=f"Sampling design of the draws [{DESIGNS[0]}]",
    ),
    option(
        "Variants",
        "--step",
        dest="steps",
        type=_steps,
        default=(),
        metavar="SECONDS,...",
        help="Time steps to try, in seconds [each model's own]",
    ),
    option(
        "Variants",
        "--integrator",
        dest="integrators",
        action=arguments.AppendAction,
        default=[],
        metavar="NAME",
        help="Integrator to try; repeatable [each model's own]",
    ),
)

COMMAND = Command(
    group="Check models",
    purpose="Check variants: parameters, time steps, integrators, engines",
    description="Check many variants of models: parameters, time steps, integrators, engines.\n"
    "Write a row for each case, a summary and index.html; rerun to resume.",
    examples={
        "Draw a stiffness 100 times": "crosscheck sweep my_arm --vary k=20:200 --draws 100",
        "Try two time steps of a folder": "crosscheck sweep my_arm --step 0.001,0.002",
    },
    exit_codes={
        "0": "Every case agrees.",
        "1": "A case differs or is unresolved.",
        "2": "Wrong usage, an unknown target, or a name that nothing matches.",
        "3": "A case failed, or rows are damaged.",
        **INTERRUPTED,
    },
    options=(
        arguments.targets(required=False),
        arguments.STANDALONE,
        *_VARIANTS,
        arguments.ENGINE,
        option(
            "Selection",
            "--scenario",
            dest="scenarios",
            action=arguments.AppendAction,
            default=[],
            metavar="NAME",
            help="Scenario to run; repeatable [all]",
        ),
        arguments.RESOLUTION,
        arguments.THOROUGH,
        *arguments.limits(),
        arguments.jobs("2"),
        arguments.scheduler,
        arguments.out("reports/sweep"),
        _single_case_or_summary,
    ),
    function="physics_crosscheck.harness.extras.sweep.main:main",
)
