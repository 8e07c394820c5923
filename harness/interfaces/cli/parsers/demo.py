"""The arguments of `crosscheck demo`."""

from __future__ import annotations

import argparse

from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.help import CommandHelp
from physics_crosscheck.harness.interfaces.cli.parsers import run

ABOUT = CommandHelp(
    description="Check the six built-in example systems in every engine.\n"
    "Write results.json and the report index.html.",
    examples={
        "Check all of them": "crosscheck demo",
        "Check the driven cases in MuJoCo": "crosscheck demo -k driven --engine mujoco",
    },
    exit_codes=run.ABOUT.exit_codes,
)


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments: those of `run` that make sense for the built-in systems."""
    arguments.engine(command)
    arguments.words(command)
    arguments.resolution_of(command)
    run.engines_required(command)
    run.output(command)
    arguments.cache(command)
    arguments.baseline(command)
    arguments.limits(command)
    arguments.jobs(command)
    arguments.scheduler(command)
    command.set_defaults(
        folders=[],
        last_failed=False,
        standalone=False,
        resume=False,
        watch=False,
        history=False,
        strict=False,
        floating=False,
        motion=0.0,
        chosen_model="",
    )
