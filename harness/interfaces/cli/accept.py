"""`crosscheck accept`: write the current results into the baseline, with a reason."""

from __future__ import annotations

import argparse
import sys

from physics_crosscheck.harness.gate.accept import AcceptError, accept
from physics_crosscheck.harness.gate.gate import gate
from physics_crosscheck.harness.gate.text import accepted_lines
from physics_crosscheck.harness.interfaces.cli.exit_codes import AGREE, FAIL, USAGE
from physics_crosscheck.harness.interfaces.cli.gate import LateProgress, meant
from physics_crosscheck.harness.modelfiles.folders import check_engines, check_no_robots
from physics_crosscheck.harness.render.terminal.console import print_status_lines, terminal
from physics_crosscheck.harness.results.github import in_ci


def main(options: argparse.Namespace) -> int:
    """Run the models that changed, and write their results into the baseline."""
    if in_ci():
        print("crosscheck: accept needs a person and is refused in CI", file=sys.stderr)
        return USAGE
    reason = " ".join(options.reason.split())
    if not reason:
        print("crosscheck: --reason is empty. State why the results are right.", file=sys.stderr)
        return USAGE
    check_engines(options.engine)
    check_no_robots(options.cases)
    folders, what = meant(options)
    with LateProgress() as progress:
        found = gate(folders, what, progress)
    try:
        done = accept(found, options.cases, reason, options.baseline)
    except AcceptError as error:
        print(f"crosscheck: {error}", file=sys.stderr)
        return FAIL
    console = terminal()
    lines = accepted_lines(done.cases, done.files, console.width, with_cases=options.verbose)
    print_status_lines(console, lines)
    for case in done.left:
        print(f"crosscheck: {case} is unchanged: its engine is not installed", file=sys.stderr)
    return FAIL if done.left else AGREE
