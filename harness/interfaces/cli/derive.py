"""`crosscheck derive`: equations, linearization, modes and errata of a system."""

import argparse
import sys
from functools import partial
from pathlib import Path
from typing import Literal

from physics_crosscheck.harness.checks.derivation import derivation, tree_derivation
from physics_crosscheck.harness.checks.findings import format_omission
from physics_crosscheck.harness.documents.expanded import with_sources
from physics_crosscheck.harness.jobs.workers import Failure, Workers
from physics_crosscheck.harness.modelfiles.readers import read_robot, robot_bodies
from physics_crosscheck.harness.render.terminal.console import terminal
from physics_crosscheck.harness.render.terminal.equations import describe
from physics_crosscheck.reference.load import load_declaration, with_location
from physics_crosscheck.reference.mechanism.assemble import MultibodySystem
from . import arguments
from .exit_codes import AGREE, FAIL
from .targets import resolve_targets, warn_unknown, with_unknown

Form = Literal["latex", "text"]


def main(options: argparse.Namespace) -> int:
    """Print the equations of each system folder and each robot file."""
    form: Form = "latex" if options.latex else "text"
    width = terminal().width
    targets = resolve_targets(options.folders, standalone=options.standalone, model=options.model)
    warn_unknown(targets.named)
    describe_robot = partial(
        describe_file, form=form, width=width, floating=options.floating, model=options.model
    )
    with Workers(1, arguments.limits_of(options)) as workers:
        for path in targets.paths:
            is_file = path in targets.robots
            task = describe_robot if is_file else partial(describe_folder, form=form, width=width)
            text = workers.outcome(workers.submit(task, path))
            if isinstance(text, Failure):
                file = path if is_file else path / "system.py"
                print(f"crosscheck: {with_sources(text.about(file))}", file=sys.stderr)
                return FAIL
            print(with_sources(text))
    return with_unknown(AGREE, targets.named)


def describe_file(file: Path, *, form: Form, width: int, floating: bool | None, model: str) -> str:
    """Return the text about a robot's equations; the other arguments are those of `read_robot`.

    Raises:
        RobotError: naming what is wrong and where.
    """
    robot = read_robot(file, floating=floating, model=model)
    omitted = [format_omission(one) for one in robot.left_out]
    return describe(tree_derivation(robot_bodies(robot), omitted), form, width)


def describe_folder(folder: Path, *, form: Form, width: int) -> str:
    """Return the text about a folder's equations; runs in a worker, since system.py is code.

    Raises:
        DeclarationError, ReferenceError: naming what is wrong and where.
    """
    system = load_declaration(folder)
    if isinstance(system, MultibodySystem):
        return describe(tree_derivation(system), form, width)
    with with_location(folder):
        return describe(derivation(system), form, width)
