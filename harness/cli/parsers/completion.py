"""The arguments of `crosscheck completion`."""

from __future__ import annotations

import argparse

from physics_crosscheck.harness.cli.completion import SHELLS


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    command.add_argument("shell", choices=SHELLS, help="whose script is printed")
