"""The arguments of `crosscheck derive`."""

from __future__ import annotations

import argparse

from physics_crosscheck.harness.cli import arguments


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    arguments.folders(command, some=True, models=False)
    arguments.limits(command)
    command.add_argument("--latex", action="store_true", help="as LaTeX instead of text")
