"""The arguments of `crosscheck engines`."""

from __future__ import annotations

import argparse

from physics_crosscheck.harness.interfaces.cli.help import CommandHelp, group

ABOUT = CommandHelp(
    description="List the physics engines: version, file formats and capabilities.\n"
    "For an engine that is missing, print the command that installs it.",
    examples={
        "List all engines": "crosscheck engines",
        "Test the adapter of your own engine": "crosscheck engines --conformance my_engine",
    },
    exit_codes={
        "0": "The engines were listed, or the adapter passed every test.",
        "1": "The adapter failed a conformance test.",
        "2": "Wrong usage, or an engine that is not installed.",
    },
)


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    group(command, "Checks").add_argument(
        "--conformance",
        metavar="NAME",
        help="Test this engine's adapter against the protocol, on its own samples",
    )
