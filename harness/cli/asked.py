"""What a command line asks to be run: folders, robots' files, and which of their cases."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from harness.files.choice import Choice, NamedModel, chosen_models, matching
from harness.files.folders import FolderError, NamedFolders, named_folders
from harness.records.read import read_results
from harness.robots.named import robot_files


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
    models: dict[str, tuple[NamedModel, ...]] = {}
    if not options.alone:
        names, models = chosen_models(names)
    alone = robot_files(names)
    choice = Choice(models=models, words=options.words, only=only)
    if alone.others or not (alone.files or alone.faults):
        named = named_folders(alone.others, beside=bool(alone.files or alone.faults))
    else:
        named = NamedFolders([], {})
    faults = {**alone.faults, **named.faults}
    if not alone.files and not named.folders:
        raise FolderError("; ".join(faults.values()))
    return Asked(NamedFolders(named.folders, faults), alone.files, choice)
