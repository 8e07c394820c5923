"""`crosscheck accept`: write the current results into the baseline, with a reason."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from physics_crosscheck.harness.gate.accept import AcceptError, accept
from physics_crosscheck.harness.gate.gate import gate
from physics_crosscheck.harness.gate.text import accepted_lines
from physics_crosscheck.harness.interfaces.cli.exit_codes import AGREE, FAIL, USAGE
from physics_crosscheck.harness.interfaces.cli.gate import LateProgress, meant
from physics_crosscheck.harness.modelfiles.folders import check_engines
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
    patterns = [name for name in options.cases if not _is_target(Path(name))]
    options.folders = [*options.folders, *(name for name in options.cases if name not in patterns)]
    targets, what = meant(options)
    with LateProgress() as progress:
        result = gate(targets, what, progress)
    try:
        done = accept(result, patterns, reason, options.baseline)
    except AcceptError as error:
        print(f"crosscheck: {error}", file=sys.stderr)
        return FAIL
    console = terminal()
    lines = accepted_lines(done.cases, done.files, console.width, with_cases=options.verbose)
    print_status_lines(console, lines)
    for case in done.left:
        print(f"crosscheck: {case} is unchanged: its engine is not installed", file=sys.stderr)
    return FAIL if done.left else AGREE


def _is_target(path: Path) -> bool:
    """Return whether a name is a folder or a robot file; any other is a pattern of case names."""
    return path.is_dir() or (path.is_file() and not (path.parent / "system.py").is_file())
