"""The arguments of `crosscheck list`."""

from __future__ import annotations

import argparse

from physics_crosscheck.harness.cli import arguments


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    arguments.folders(command, some=False)
    arguments.engine(command)
    arguments.words(command)
    command.add_argument(
        "--format", choices=("text", "json"), default="text", help="what is printed (text)"
    )
