"""`crosscheck report`: the HTML page of existing results."""

import argparse
from pathlib import Path

from physics_crosscheck.harness.modelfiles.folders import FolderError
from physics_crosscheck.harness.records.read import read_results
from physics_crosscheck.harness.render.html import is_own_page, write_report
from .exit_codes import AGREE


def main(options: argparse.Namespace) -> int:
    """Write index.html of a run.

    Raises:
        FolderError: for an existing page of another program.
        ResultsError: if results can't be read.
    """
    results: Path = options.results
    file = results / "results.json" if results.is_dir() else results
    page = (options.out or file.parent) / "index.html"
    check_page(page)
    write_report(page, read_results(file))
    print(f"Report: {page}")
    return AGREE


def check_page(page: Path) -> None:
    """Reject an existing page of another program before anything runs.

    Raises:
        FolderError: naming the page and the remedy.
        OSError: if the page can't be read.
    """
    if page.is_file() and not is_own_page(page):
        raise FolderError(
            f"{page}: crosscheck did not write this page and does not replace it; choose another"
            " folder with --out, or move the page"
        )
