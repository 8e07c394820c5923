"""The arguments of `crosscheck review`."""

from __future__ import annotations

import argparse

from physics_crosscheck.harness.interfaces.cli.help import INTERRUPTED, CommandHelp
from physics_crosscheck.harness.interfaces.cli.parsers.gate import add_selection

ABOUT = CommandHelp(
    description="Show each change since the baseline and ask you to accept or reject it.\n"
    "Accepted results go into the baseline. Needs a terminal.",
    examples={
        "Review all changes": "crosscheck review",
        "Review one folder, with causes": "crosscheck review my_arm --diagnose",
    },
    exit_codes={
        "0": "Every change was accepted, or nothing had changed.",
        "1": "A change was rejected or left undecided.",
        "2": "Wrong usage, an unknown folder, or no terminal.",
        "3": "A case could not run, or the baseline could not be read or written.",
        **INTERRUPTED,
    },
)


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_selection(command)
