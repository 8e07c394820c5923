"""The arguments of `crosscheck mutate`."""

from __future__ import annotations

import argparse
from pathlib import Path

from physics_crosscheck.harness.cli import arguments
from physics_crosscheck.harness.schedule.limits import FAULT_SECONDS


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    arguments.folders(command, some=True, models=False)
    arguments.engine(command)
    arguments.limits(command, FAULT_SECONDS)
    arguments.jobs(command, "two")
    command.add_argument("--json", type=Path, metavar="FILE", help="write every row there, as JSON")
