"""Targets of a command line: folders, robot files, and the selection of their cases."""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, TypeVar

from physics_crosscheck.harness.modelfiles.choice import (
    CaseSelection,
    NamedModel,
    chosen_models,
    matching,
)
from physics_crosscheck.harness.modelfiles.folders import FolderError, NamedFolders, named_folders
from physics_crosscheck.harness.modelfiles.robot_targets import expand_folders, robot_files
from physics_crosscheck.harness.planning.cache import Cache
from physics_crosscheck.harness.planning.options import Options
from physics_crosscheck.harness.records.read import read_results
from physics_crosscheck.harness.results.visible import visible
from .arguments import limits_of
from .exit_codes import USAGE

Kind = TypeVar("Kind", bound=Options)


@dataclass(frozen=True)
class Targets:
    """Folders and files to run.

    Attributes:
        named: folders, and unknown names.
        robots: robot files that run standalone.
        choice: selection of their cases.
    """

    named: NamedFolders
    robots: Sequence[Path]
    choice: CaseSelection

    @property
    def folders(self) -> Sequence[Path]:
        """System folders."""
        return self.named.folders

    @property
    def paths(self) -> Sequence[Path]:
        """System folders, then robot files."""
        return (*self.named.folders, *self.robots)


def run_options(kind: type[Kind], given: argparse.Namespace, **more: Any) -> Kind:
    """Return the options of a run that a command line has; others keep their defaults.

    Args:
        kind: type of the options.
        given: the command line, whose values have the names of the options.
        more: further options, or other values.
    """
    named = {one.name: getattr(given, one.name, None) for one in fields(kind)}
    values = {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in named.items()
        if value is not None
    }
    if "cache" in values:
        values["cache"] = Cache(given.cache)
    return kind(**{**values, "limits": limits_of(given), **more})


def select_targets(options: argparse.Namespace) -> Targets:
    """Return what the options select; nothing where `--last-failed` finds no failed case.

    Raises:
        FolderError: if nothing is left to run, or a choice can't be read.
        ResultsError: for a last run that can't be read.
    """
    matching(options.words)
    names, only = list(options.folders), None
    if options.last_failed:
        last = read_results(options.out / "results.json")
        only = [(case.folder, case.id) for case in last.failed]
        if not only:
            print("crosscheck: the last run has no failed case; nothing to run", file=sys.stderr)
            return Targets(NamedFolders([], {}), [], CaseSelection(only=only))
        names = names or list(dict.fromkeys(folder for folder, _ in only))
    targets = resolve_targets(names, standalone=options.standalone, model=options.model)
    return replace(targets, choice=replace(targets.choice, words=options.words, only=only))


def resolve_targets(names: Sequence[str], *, standalone: bool, model: str | None = "") -> Targets:
    """Return the folders, robot files and models that names mean, and the unknown names.

    Args:
        names: names on a command line; none: all built-in folders.
        standalone: whether files in a system folder are robot files, too.
        model: as in `robot_files`.

    Raises:
        FolderError: if no name means a target.
    """
    models: dict[str, tuple[NamedModel, ...]] = {}
    if not standalone:
        names, models = chosen_models(names)
    robots = robot_files(expand_folders(names), model)
    has_files = bool(robots.files or robots.faults)
    if robots.others or not has_files:
        named = named_folders(robots.others, allow_none=has_files)
    else:
        named = NamedFolders([], {})
    faults = {**robots.faults, **named.faults}
    if not robots.files and not named.folders:
        raise FolderError("; ".join(faults.values()))
    return Targets(NamedFolders(named.folders, faults), robots.files, CaseSelection(models=models))


def warn_unknown(named: NamedFolders) -> None:
    """Print a warning for each unknown target, before the others run."""
    for fault in named.faults.values():
        print(f"crosscheck: {fault}; continuing with the others", file=sys.stderr, flush=True)


def with_unknown(code: int, named: NamedFolders) -> int:
    """Print the skipped targets at the end of a run; return the exit code.

    An unknown target is wrong usage, but a failure of the others takes precedence.
    """
    if not named.faults:
        return code
    names = ", ".join(visible(name) for name in named.faults)
    print(f"crosscheck: skipped unknown targets: {names}", file=sys.stderr)
    return max(code, USAGE)
