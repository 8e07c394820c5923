"""The arguments of `crosscheck audit`."""

from __future__ import annotations

import argparse

from physics_crosscheck.harness.cli import arguments


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    arguments.folders(command, some=True)
    arguments.engine(command)
    arguments.limits(command)
    arguments.jobs(command)
    arguments.cache(command)
