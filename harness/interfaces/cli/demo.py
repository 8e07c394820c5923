"""`crosscheck demo`: run the built-in example systems."""

from __future__ import annotations

import argparse

from physics_crosscheck.harness.interfaces.cli import run
from physics_crosscheck.harness.modelfiles.folders import builtin, system_folders


def main(options: argparse.Namespace) -> int:
    """Run all of them; return the exit code of `run`."""
    options.folders = [str(folder) for folder in system_folders([str(builtin())])]
    return run.main(options)
