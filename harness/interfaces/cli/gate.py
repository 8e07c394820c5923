"""`crosscheck gate` and `accept`: run changed models, compare them with accepted results.

`accept` writes the results into the baseline, with a reason.
"""

import argparse
import os
import shlex
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path

from physics_crosscheck.harness.baseline.fingerprint import always_lines
from physics_crosscheck.harness.commands.gate.accept import AcceptError, accept
from physics_crosscheck.harness.commands.gate.gate import (
    accepted_targets,
    gate,
    moving_models,
    robots_in,
)
from physics_crosscheck.harness.commands.gate.result import GateResult
from physics_crosscheck.harness.commands.gate.text import (
    accepted_lines,
    code_hint,
    gate_lines,
    headline,
    notes,
    remedy,
    summary,
    total,
)
from physics_crosscheck.harness.modelfiles.folders import (
    FolderError,
    check_engines,
    expected_folder,
)
from physics_crosscheck.harness.modelfiles.robot_targets import models_below, robots_below
from physics_crosscheck.harness.paths import DEFAULT_FOLDER
from physics_crosscheck.harness.planning.options import Options
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.diff import Status
from physics_crosscheck.harness.records.write import encoded, write_whole
from physics_crosscheck.harness.render.terminal.console import (
    print_hint,
    print_status_lines,
    terminal,
)
from physics_crosscheck.harness.results.github import commands, in_ci, print_commands, write_summary
from physics_crosscheck.harness.results.places import shown_path
from .exit_codes import AGREE, DIFFER, FAIL, USAGE
from .targets import resolve_targets, run_options


def main(options: argparse.Namespace) -> int:
    """Run the gate, print and annotate its findings, and write its files."""
    check_engines(options.engines)
    folders, what = targets_and_options(options)
    with LateProgress() as progress:
        result = gate(folders, what, progress)
    console = terminal()
    lines = gate_lines(result, console.width, _accept_options(options))
    print_status_lines(console, lines)
    if page := _page(result, options):
        print(f"Report: {shown_path(page)}")
    print_hint(console, code_hint(result))
    for line in always_lines({one.id.system: one.files for one in result.changes}):
        print(f"crosscheck: {line}", file=sys.stderr)
    print_commands(commands(notes(result), os.environ))
    sys.stdout.flush()
    text = summary(result)
    write_summary(text, os.environ)
    write_whole(options.out / "summary.md", text)
    write_whole(options.out / "gate.json", encoded(result.record(), indent=1))
    return code(result)


def _page(result: GateResult, options: argparse.Namespace) -> Path | None:
    """Write the page of a gate in which something ran or changed; remove that of an earlier one."""
    page: Path = options.out / "gate.html"
    listed = [(one.diff, one.case) for one in result.changes if one.status is not Status.SAME]
    if result.results is None and not listed:
        page.unlink(missing_ok=True)
        return None
    from physics_crosscheck.harness.render.html.comparison import TEXT_COLUMNS, write_gate
    from .report import check_page

    check_page(page)
    accept = [] if result.passes else remedy(result, TEXT_COLUMNS, _accept_options(options))
    texts = headline(result), total(result), accept
    write_gate(page, result.record(), listed, result.results, texts)
    return page


def _accept_options(options: argparse.Namespace) -> list[str]:
    """Return the options that `crosscheck accept` needs to find the same cases."""
    words = [f"--folder {shlex.quote(str(name))}" for name in options.folders]
    if options.baseline != DEFAULT_FOLDER:
        words.append(f"--baseline {shlex.quote(str(options.baseline))}")
    return words


def code(result: GateResult) -> int:
    """Return the exit code of a gate."""
    if result.is_incomplete:
        return FAIL
    return AGREE if result.passes else DIFFER


def targets_and_options(options: argparse.Namespace) -> tuple[list[Path], Options]:
    """Return the folders and options that the arguments select.

    Without arguments, the folders are those of the baseline; without a baseline, those of `run`.

    Raises:
        FolderError, BaselineError: for an unknown folder or an unreadable baseline.
    """
    parents: tuple[Path, ...] | None = None
    if options.folders:
        targets = _named(options.folders, options.baseline)
        named = [Path(name) for name in options.folders]
        parents = tuple(p for p in named if p.is_dir() and not (p / "system.py").is_file())
    else:
        targets = accepted_targets(options.baseline)
        if not targets and not any(options.baseline.rglob("*.json")):
            targets = _named(models_below(Path()), options.baseline)
    chosen = run_options(Options, options, parents=parents)
    return moving_models(targets, options.baseline, chosen.model), chosen


def _named(names: Sequence[str], baseline: Path) -> list[Path]:
    """Return the named system folders and robot files.

    Raises:
        FolderError: naming each missing one, and the remedy.
    """
    below = [file for name in names if name for file in robots_in(Path(name), baseline)]
    rest = [name for name in names if not (name and robots_below(Path(name)))]
    if not rest:
        return list(dict.fromkeys(below))
    targets = resolve_targets(rest, standalone=False, model=None)
    models = [
        *(one.folder / one.model for models in targets.choice.models.values() for one in models),
        *(file for file in targets.robots if (file.parent / "system.py").is_file()),
    ]
    faults = [*targets.named.faults.values(), *map(expected_folder, models)]
    if faults:
        raise FolderError("; ".join(faults))
    return [*targets.folders, *dict.fromkeys([*below, *targets.robots])]


class LateProgress(ExitStack):
    """Progress as in `crosscheck run`, shown only once a case runs."""

    _shown: Callable[[int, int, Case | None], None] | None = None

    def __call__(self, done: int, total: int, case: Case | None) -> None:
        """Report a finished case."""
        if self._shown is None:
            from physics_crosscheck.harness.render.terminal.progress import Progress

            self._shown = self.enter_context(Progress())
        self._shown(done, total, case)


def accept_main(options: argparse.Namespace) -> int:
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
    lines = accepted_lines(
        result, done.cases, done.files, console.width, with_cases=options.verbose
    )
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
