"""`crosscheck gate`: run what changed, and compare it with what was accepted."""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from physics_crosscheck.harness.baseline.changes import Status
from physics_crosscheck.harness.baseline.place import DEFAULT
from physics_crosscheck.harness.gate.gate import accepted_folders, gate
from physics_crosscheck.harness.gate.notes import notes
from physics_crosscheck.harness.gate.options import GateOptions
from physics_crosscheck.harness.gate.result import GateResult
from physics_crosscheck.harness.gate.text import gate_lines, summary
from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.exit_codes import AGREE, DIFFER, FAIL
from physics_crosscheck.harness.modelfiles.folders import check_engines, system_folders
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.write import encoded, write_whole
from physics_crosscheck.harness.render.terminal.console import terminal
from physics_crosscheck.harness.render.terminal.progress import Progress
from physics_crosscheck.harness.results.github import commands, print_commands, write_summary
from physics_crosscheck.harness.results.visible import visible


def main(options: argparse.Namespace) -> int:
    """Gate, print, annotate, write; any doubt is no pass."""
    check_engines(options.engine)
    folders, what = meant(options)
    with LateProgress() as progress:
        found = gate(folders, what, progress)
    for line in gate_lines(found, terminal().width, _accept_options(options)):
        print(visible(line))
    print_commands(commands(notes(found), os.environ))
    sys.stdout.flush()
    text = summary(found)
    write_summary(text, os.environ)
    write_whole(options.out / "summary.md", text)
    write_whole(options.out / "gate.json", encoded(found.record(), indent=1))
    return code(found)


def _accept_options(options: argparse.Namespace) -> list[str]:
    """Return the options that `crosscheck accept` needs to find the same cases."""
    words = [f"--folder {shlex.quote(str(name))}" for name in options.folders]
    if options.baseline != DEFAULT:
        words.append(f"--baseline {shlex.quote(str(options.baseline))}")
    return words


def code(found: GateResult) -> int:
    """The exit code of what a gate found."""
    if found.of(Status.NOT_RUN) or not found.changes or found.failures:
        return FAIL
    return AGREE if found.passes else DIFFER


def meant(options: argparse.Namespace) -> tuple[list[Path], GateOptions]:
    """The folders and options that the arguments mean.

    Raises:
        FolderError, BaselineError: naming what is wrong.
    """
    parents: tuple[Path, ...] | None = None
    if options.folders:
        folders = system_folders(options.folders)
        named = [Path(name) for name in options.folders]
        parents = tuple(p for p in named if p.is_dir() and not (p / "system.py").is_file())
    else:
        folders = accepted_folders(options.baseline)
        if not folders and not any(options.baseline.glob("*.json")):
            folders = system_folders([])
    return folders, GateOptions(
        baseline=options.baseline,
        engines=tuple(options.engine),
        every=getattr(options, "every", False),
        diagnose=getattr(options, "diagnose", False),
        resolution=options.resolution,
        jobs=options.jobs,
        limits=arguments.limits_of(options),
        parents=parents,
    )


class LateProgress(ExitStack):
    """Progress as in `crosscheck run`, made when there is some."""

    _shown: Callable[[int, int, Case | None], None] | None = None

    def __call__(self, done: int, total: int, case: Case | None) -> None:
        """Tell that a case is done."""
        if self._shown is None:
            self._shown = self.enter_context(Progress())
        self._shown(done, total, case)
