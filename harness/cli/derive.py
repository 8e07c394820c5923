"""`crosscheck derive`: equations, linearization, modes and errata of a system."""

from __future__ import annotations

import argparse
import sys

from harness.cases.derivation import derivation
from harness.cli import arguments
from harness.cli.exit_codes import AGREE, FAIL
from harness.files.folders import system_folders
from harness.text.equations import describe
from reference.declaration import DeclarationError
from reference.integrate import ReferenceError
from reference.load import load_system


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    arguments.folders(command, some=True)
    command.add_argument("--latex", action="store_true", help="as LaTeX instead of text")


def main(options: argparse.Namespace) -> int:
    """Print what the declaration entails."""
    try:
        for folder in system_folders(options.folders):
            derived = derivation(load_system(folder))
            print(describe(derived, "latex" if options.latex else "text"))
    except (DeclarationError, ReferenceError) as error:
        print(f"crosscheck: {error}", file=sys.stderr)
        return FAIL
    return AGREE
