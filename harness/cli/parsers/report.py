"""The arguments of `crosscheck report`."""

from __future__ import annotations

import argparse
from pathlib import Path


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    command.add_argument(
        "results",
        nargs="*",
        type=Path,
        metavar="RESULTS",
        help="results.json, or the folder that it lies in (reports); two, the earlier first: what"
        " moved from one to the other; exit code 1 where anything did",
    )
    command.add_argument(
        "--out", type=Path, default=None, metavar="DIR", help="beside the results, or the later"
    )
    command.add_argument(
        "--badge",
        type=Path,
        default=None,
        metavar="FILE",
        help="write a badge too: .svg is a picture, .json what shields.io draws one from",
    )
