"""The arguments of `crosscheck new`."""

from __future__ import annotations

import argparse
from pathlib import Path

from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.help import CommandHelp, group

ABOUT = CommandHelp(
    description="Create a system folder with comments that explain every part.\n"
    "It runs as it is; with --from, it declares the bodies of your model.",
    examples={
        "Create an example to edit": "crosscheck new my_arm",
        "Create a folder from a model file": "crosscheck new my_arm --from arm.urdf",
    },
    exit_codes={
        "0": "The folder was written.",
        "2": "Wrong usage, or an unusable folder name.",
        "3": "The model could not be read, or the folder could not be written.",
    },
)


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    command.add_argument(
        "name", metavar="NAME", help="Folder to create; its name becomes the system's name"
    )
    group(command, "Robot files").add_argument(
        "--from",
        dest="model",
        type=Path,
        default=None,
        metavar="FILE",
        help="Model file to start from: URDF, SDFormat or MJCF",
    )
    arguments.floating(command)
    arguments.chosen_model(command)
