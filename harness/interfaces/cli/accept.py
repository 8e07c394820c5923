"""`crosscheck accept`: write the current results into the baseline, with a reason."""

import argparse
import sys
from pathlib import Path

from physics_crosscheck.harness.commands.gate.accept import AcceptError, accept
from physics_crosscheck.harness.commands.gate.gate import gate
from physics_crosscheck.harness.commands.gate.text import accepted_lines
from physics_crosscheck.harness.modelfiles.folders import check_engines
from physics_crosscheck.harness.render.terminal.console import print_status_lines, terminal
from physics_crosscheck.harness.results.github import in_ci
from .exit_codes import AGREE, FAIL, USAGE
from .gate import LateProgress, targets_and_options


def main(options: argparse.Namespace) -> int:
    """Run the models that changed, and write their results into the baseline."""
    if in_ci():
        print("crosscheck: accept needs a person and is refused in CI", file=sys.stderr)
        return USAGE
    reason = " ".join(options.reason.split())
    if not reason:
        print("crosscheck: --reason is empty. State why the results are right.", file=sys.stderr)
        return USAGE
    check_engines(options.engines)
    patterns = separate_patterns(options)
    targets, what = targets_and_options(options)
    with LateProgress() as progress:
        result = gate(targets, what, progress)
    try:
        done = accept(result, patterns, reason, options.baseline, untested=options.untested)
    except AcceptError as error:
        print(f"crosscheck: {error}", file=sys.stderr)
        return FAIL
    console = terminal()
    lines = accepted_lines(done.cases, done.files, console.width, with_cases=options.verbose)
    print_status_lines(console, lines)
    for case in done.unchanged:
        print(f"crosscheck: {case} is unchanged: its engine is not installed", file=sys.stderr)
    return FAIL if done.unchanged else AGREE


def separate_patterns(options: argparse.Namespace) -> list[str]:
    """Move named targets to the folders; return the other names, which are patterns of cases.

    As in other commands, a named target replaces the folders of the project's settings.
    """
    targets = [name for name in options.cases if _is_target(Path(name))]
    if targets:
        is_setting = options.folders is options.settings_defaults.get("folders")
        options.folders = [*(() if is_setting else options.folders), *targets]
    return [name for name in options.cases if name not in targets]


def _is_target(path: Path) -> bool:
    """Return whether a name is a folder or a robot file; any other is a pattern of case names."""
    return path.is_dir() or (path.is_file() and not (path.parent / "system.py").is_file())
