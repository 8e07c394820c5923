"""The arguments of `crosscheck new`."""

from __future__ import annotations

import argparse
from pathlib import Path

from physics_crosscheck.harness.cli import arguments


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    command.add_argument("name", metavar="NAME", help="the folder to write, and the system's name")
    command.add_argument(
        "--from",
        dest="model",
        type=Path,
        default=None,
        metavar="model.urdf|model.xml",
        help="fill it in from this model file",
    )
    command.add_argument(
        "--floating",
        action="store_true",
        help="the root link of the URDF moves freely; else it is fixed",
    )
    arguments.chosen_model(command)
