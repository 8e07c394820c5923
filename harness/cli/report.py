"""`crosscheck report`: HTML from results, without running anything."""

from __future__ import annotations

import argparse
from pathlib import Path

from harness.cli.exit_codes import AGREE
from harness.records.read import read_results
from harness.report import write_report


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    command.add_argument(
        "results",
        nargs="?",
        type=Path,
        default=Path("reports/results.json"),
        metavar="RESULTS.json",
    )
    command.add_argument("--out", type=Path, default=None, metavar="DIR", help="beside the results")


def main(options: argparse.Namespace) -> int:
    """Write index.html."""
    results = read_results(options.results)
    out = (options.out or options.results.parent) / "index.html"
    write_report(out, results)
    print(out)
    return AGREE
