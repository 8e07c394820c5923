"""The arguments of `crosscheck report`."""

from __future__ import annotations

import argparse
from pathlib import Path

from physics_crosscheck.harness.interfaces.cli.help import CommandHelp, group

ABOUT = CommandHelp(
    description="Create the HTML report of a finished run, or compare two runs.\n"
    "Write index.html for one run, changes.html for two. Nothing runs.",
    examples={
        "Create the report of the last run": "crosscheck report",
        "Compare two runs, the earlier one first": "crosscheck report old/ new/",
    },
    exit_codes={
        "0": "The page was written; of two runs, nothing changed.",
        "1": "The two runs differ.",
        "2": "Wrong usage, unreadable results, or a page by another program.",
        "3": "The page could not be written.",
    },
)


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    command.add_argument(
        "results",
        nargs="*",
        type=Path,
        metavar="RESULTS",
        help="One or two results.json files, or their folders [reports]",
    )
    group(command, "Output").add_argument(
        "--out", type=Path, default=None, metavar="DIR", help="Folder for output files [RESULTS]"
    )
    group(command, "Output").add_argument(
        "--badge",
        type=Path,
        default=None,
        metavar="FILE",
        help="Also write a badge: .svg image or .json for shields.io",
    )
