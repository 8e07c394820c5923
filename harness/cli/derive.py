"""`crosscheck derive`: equations, linearization, modes and errata of a system."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Literal

from physics_crosscheck.harness.cases.derivation import derivation
from physics_crosscheck.harness.cases.tree_derivation import tree_derivation
from physics_crosscheck.harness.cli import arguments
from physics_crosscheck.harness.cli.exit_codes import AGREE, FAIL
from physics_crosscheck.harness.cli.missing import tell_missing, with_missing
from physics_crosscheck.harness.files.folders import named_folders
from physics_crosscheck.harness.schedule.workers import Failure, Workers
from physics_crosscheck.harness.text.equations import describe
from physics_crosscheck.reference.load import load_declaration, told_with_file
from physics_crosscheck.reference.trees import MultibodySystem

Form = Literal["latex", "text"]


def main(options: argparse.Namespace) -> int:
    """Print what the declarations entail."""
    form: Form = "latex" if options.latex else "text"
    named = named_folders(options.folders)
    tell_missing(named)
    with Workers(1, arguments.limits_of(options)) as workers:
        for folder in named.folders:
            text = workers.outcome(workers.submit(derived, (folder, form)))
            if isinstance(text, Failure):
                print(f"crosscheck: {text.about(folder / 'system.py')}", file=sys.stderr)
                return FAIL
            print(text)
    return with_missing(AGREE, named)


def derived(task: tuple[Path, Form]) -> str:
    """What a folder's declaration entails, in words; in a worker: a declaration is a program.

    Raises:
        DeclarationError, ReferenceError: naming what is wrong and where.
    """
    folder, form = task
    system = load_declaration(folder)
    if isinstance(system, MultibodySystem):
        return describe(tree_derivation(system), form)
    with told_with_file(folder):
        return describe(derivation(system), form)
