"""`crosscheck mutate`: what the check would catch, shown by making each literal wrong."""

from __future__ import annotations

import argparse
import sys

from harness.commands import arguments
from harness.commands.codes import AGREE, DIFFER, FAIL
from harness.commands.watch import Watcher
from harness.folders import system_folders
from harness.mutate import MutationError, mutate
from harness.mutate_text import mutation_lines
from harness.run import Options


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    arguments.folders(command, some=True)
    arguments.engine(command)
    arguments.jobs(command)


def main(options: argparse.Namespace) -> int:
    """Mutate every model of the folders and print what became of each fault."""
    arguments.check_engines(options.engine)
    folders = system_folders(options.folders)
    try:
        with Watcher() as watcher:
            rows = mutate(folders, Options(tuple(options.engine), jobs=options.jobs), watcher.count)
    except MutationError as error:
        print(f"crosscheck: {error}", file=sys.stderr)
        return FAIL
    for text in mutation_lines(rows):
        print(text)
    return AGREE if all(row.verdict != "missed" for row in rows) else DIFFER
