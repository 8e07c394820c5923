"""`crosscheck review`: show the gate's findings one by one, and accept or reject them."""

from __future__ import annotations

import argparse
import sys

from physics_crosscheck.harness.commands.gate.accept import AcceptError, accept_each
from physics_crosscheck.harness.commands.gate.gate import gate
from physics_crosscheck.harness.commands.gate.result import GateResult
from physics_crosscheck.harness.commands.gate.review import Decisions, Review
from physics_crosscheck.harness.commands.gate.text import accepted_lines, change_lines
from physics_crosscheck.harness.interfaces.cli.exit_codes import AGREE, DIFFER, FAIL, USAGE
from physics_crosscheck.harness.interfaces.cli.gate import LateProgress, targets_and_options
from physics_crosscheck.harness.modelfiles.folders import check_engines
from physics_crosscheck.harness.records.baseline import ChangedLine
from physics_crosscheck.harness.records.diff import Status
from physics_crosscheck.harness.render.terminal.console import terminal, wrapped
from physics_crosscheck.harness.results.github import in_ci
from physics_crosscheck.harness.results.visible import visible


def main(options: argparse.Namespace) -> int:
    """Run changed models, ask, and write accepted results; Ctrl-C writes nothing."""
    if in_ci() or not sys.stdin.isatty():
        print(
            "crosscheck: review needs a person at a terminal."
            " Use crosscheck accept --reason TEXT CASE, or crosscheck gate.",
            file=sys.stderr,
        )
        return USAGE
    check_engines(options.engine)
    folders, what = targets_and_options(options)
    with LateProgress() as progress:
        result = gate(folders, what, progress)
    decided = Review(result, input, _print_line).walk()
    _print_line("")
    for change in result.with_status(Status.NOT_RUN):
        for line in change_lines(change):
            _print_line(line)
    try:
        done = accept_each(
            result, decided.reasons, decided.reasons.keys() - decided.kept, options.baseline
        )
    except AcceptError as error:
        print(f"crosscheck: {error}", file=sys.stderr)
        return FAIL
    _summarize(result, decided)
    if done.files:
        for line in accepted_lines(done.cases, done.files, terminal().width, with_cases=True):
            _print_line(line)
    if result.with_status(Status.NOT_RUN) or result.failures:
        return FAIL
    return DIFFER if decided.rejected or decided.undecided else AGREE


def _summarize(result: GateResult, decided: Decisions) -> None:
    """Print the number of cases per decision, and the edits to undo."""
    counts = {
        "accepted": len(decided.reasons),
        "rejected": len(decided.rejected),
        "not decided": len(decided.undecided),
        "could not run": len(result.with_status(Status.NOT_RUN)),
    }
    summary_text = ", ".join(f"{count} {what}" for what, count in counts.items() if count)
    _print_line(summary_text or "Nothing to review: every case is as accepted")
    for diff in result.file_diffs:
        if any(diff.concerns(change.id) for change in decided.rejected):
            for changed in diff.changes:
                _print_line(_undo(diff.path, changed))


def _undo(path: str, line: ChangedLine) -> str:
    """Return the remedy of a rejected edit."""
    what = f"set it back to {line.old}" if line.old else "undo this edit"
    return f"{path}:{line.line} {line.edit or line.message}: {what}"


def _print_line(line: str) -> None:
    print("\n".join(wrapped(visible(line), terminal().width)), flush=True)
