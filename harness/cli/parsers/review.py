"""The arguments of `crosscheck review`."""

from __future__ import annotations

import argparse

from physics_crosscheck.harness.cli.parsers.gate import add_meant


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments: those of the gate."""
    add_meant(command)
