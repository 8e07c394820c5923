"""`crosscheck report`: HTML of existing results; for two runs, the changes."""

from __future__ import annotations

import argparse
from pathlib import Path

from physics_crosscheck.harness.baseline.diff import diff_runs
from physics_crosscheck.harness.interfaces.cli.exit_codes import AGREE, DIFFER
from physics_crosscheck.harness.interfaces.cli.keeping import check_page
from physics_crosscheck.harness.modelfiles.folders import FolderError
from physics_crosscheck.harness.records.history import read_history
from physics_crosscheck.harness.records.read import read_results
from physics_crosscheck.harness.render.html import write_report
from physics_crosscheck.harness.render.html.badge import write_badge
from physics_crosscheck.harness.render.html.two_runs import write_two_runs
from physics_crosscheck.harness.render.terminal.console import terminal
from physics_crosscheck.harness.render.terminal.two_runs import print_two_runs

DEFAULT = Path("reports/results.json")


def main(options: argparse.Namespace) -> int:
    """Write index.html of one run, or changes.html of two.

    Raises:
        FolderError: for more than two runs.
        ResultsError: if results can't be read.
    """
    files = [one / "results.json" if one.is_dir() else one for one in options.results] or [DEFAULT]
    if len(files) > 2:
        raise FolderError(f"report takes one run, or two to compare, and not {len(files)}")
    runs = [read_results(file) for file in files]
    out = options.out or files[-1].parent
    page = out / ("changes.html" if len(runs) == 2 else "index.html")
    check_page(page)
    if len(runs) == 2:
        changes = diff_runs(*runs)
        write_two_runs(page, changes, (files[0].parent, files[1].parent))
        print_two_runs(terminal(), changes)
        code = DIFFER if changes.changed else AGREE
    else:
        write_report(page, runs[0], read_history(files[0].parent))
        code = AGREE
    if options.badge is not None:
        write_badge(options.badge, runs[-1])
    print(f"Report: {page}" + ("" if options.badge is None else f"  Badge: {options.badge}"))
    return code
