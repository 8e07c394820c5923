"""`crosscheck new`: a commented folder that runs; from a model file where one is given."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from harness.commands.codes import AGREE, FAIL, USAGE
from harness.new.folder import NewError, check_name, example, write_folder


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    command.add_argument("name", metavar="NAME", help="the folder to write, and the system's name")


def main(options: argparse.Namespace) -> int:
    """Write the folder; say what was written and what comes next."""
    target = Path(options.name)
    try:
        check_name(target)
    except NewError as error:
        print(f"crosscheck: {error}", file=sys.stderr)
        return USAGE
    try:
        write_folder(target, example(target.name))
    except NewError as error:
        print(f"crosscheck: {error}", file=sys.stderr)
        return FAIL
    for path in sorted(target.iterdir()):
        print(path)
    print(f"\nnext: crosscheck run {target}\n      crosscheck derive {target}")
    return AGREE
