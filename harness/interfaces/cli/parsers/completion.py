"""The arguments of `crosscheck completion`."""

from __future__ import annotations

import argparse

from physics_crosscheck.harness.interfaces.cli.completion import SHELLS
from physics_crosscheck.harness.interfaces.cli.help import CommandHelp

ABOUT = CommandHelp(
    description="Print a shell script that completes crosscheck commands with Tab.\n"
    "Add the matching example to the start-up file of your shell.",
    examples={
        "In ~/.bashrc": 'eval "$(crosscheck completion bash)"',
        "In ~/.config/fish/config.fish": "crosscheck completion fish | source",
    },
    exit_codes={"0": "The script was printed.", "2": "Wrong usage."},
)


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    command.add_argument(
        "shell", choices=SHELLS, metavar="SHELL", help=f"Shell: {', '.join(SHELLS)}"
    )
