"""What a command line asks to be run: folders, robots' files, and which of their cases."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from physics_crosscheck.harness.files.choice import Choice, NamedModel, chosen_models, matching
from physics_crosscheck.harness.files.folders import FolderError, NamedFolders, named_folders
from physics_crosscheck.harness.records.read import read_results
from physics_crosscheck.harness.robots.named import robot_files


@dataclass(frozen=True)
class Asked:
    """What is to be run.

    Attributes:
        named: folders, and names that mean nothing.
        robots: files that are run alone.
        choice: of their cases.
    """

    named: NamedFolders
    robots: Sequence[Path]
    choice: Choice

    @property
    def folders(self) -> Sequence[Path]:
        """System folders."""
        return self.named.folders


def asked_for(options: argparse.Namespace) -> Asked:
    """What is meant; nothing at all where only what failed is wanted, and nothing did.

    Raises:
        FolderError: where nothing is left to run, or a choice can't be read.
        ResultsError: for a last run that can't be read.
    """
    matching(options.words)
    names, only = list(options.folders), None
    if options.last_failed:
        last = read_results(options.out / "results.json")
        only = [(case.folder, case.id) for case in last.failed]
        if not only:
            print("the last run has nothing that failed", file=sys.stderr)
            return Asked(NamedFolders([], {}), [], Choice(only=only))
        names = names or list(dict.fromkeys(folder for folder, _ in only))
    found = meant_by(names, alone=options.alone)
    if not found.robots and not found.folders:
        raise FolderError("; ".join(found.named.faults.values()))
    return replace(found, choice=replace(found.choice, words=options.words, only=only))


def meant_by(names: Sequence[str], *, alone: bool) -> Asked:
    """Folders, robots' files and models of folders that names mean; with names that mean nothing.

    Args:
        names: of a command line; none: all built-in folders.
        alone: whether files in a system folder are robots' files, too.
    """
    models: dict[str, tuple[NamedModel, ...]] = {}
    if not alone:
        names, models = chosen_models(names)
    robots = robot_files(names)
    beside = bool(robots.files or robots.faults)
    if robots.others or not beside:
        named = named_folders(robots.others, beside=beside)
    else:
        named = NamedFolders([], {})
    faults = {**robots.faults, **named.faults}
    return Asked(NamedFolders(named.folders, faults), robots.files, Choice(models=models))
