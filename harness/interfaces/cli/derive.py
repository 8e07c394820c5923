"""`crosscheck derive`: equations, linearization, modes and errata of a system."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Literal

from physics_crosscheck.harness.checks.derivation import derivation
from physics_crosscheck.harness.checks.tree_derivation import tree_derivation
from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.exit_codes import AGREE, FAIL
from physics_crosscheck.harness.interfaces.cli.targets import warn_unknown, with_unknown
from physics_crosscheck.harness.jobs.workers import Failure, Workers
from physics_crosscheck.harness.modelfiles.folders import named_folders
from physics_crosscheck.harness.render.terminal.equations import describe
from physics_crosscheck.reference.load import load_declaration, told_with_file
from physics_crosscheck.reference.mechanism.multibody import MultibodySystem

Form = Literal["latex", "text"]


def main(options: argparse.Namespace) -> int:
    """Print the equations of each system."""
    form: Form = "latex" if options.latex else "text"
    named = named_folders(options.folders)
    warn_unknown(named)
    with Workers(1, arguments.limits_of(options)) as workers:
        for folder in named.folders:
            text = workers.outcome(workers.submit(describe_folder, (folder, form)))
            if isinstance(text, Failure):
                print(f"crosscheck: {text.about(folder / 'system.py')}", file=sys.stderr)
                return FAIL
            print(text)
    return with_unknown(AGREE, named)


def describe_folder(task: tuple[Path, Form]) -> str:
    """Return the text about a folder's equations; runs in a worker, since system.py is code.

    Raises:
        DeclarationError, ReferenceError: naming what is wrong and where.
    """
    folder, form = task
    system = load_declaration(folder)
    if isinstance(system, MultibodySystem):
        return describe(tree_derivation(system), form)
    with told_with_file(folder):
        return describe(derivation(system), form)
