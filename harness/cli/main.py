"""The command line, `crosscheck COMMAND`; each command is a module of `harness.cli`."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence
from typing import Any

from harness.cli.exit_codes import FAIL, USAGE

COMMANDS = {
    "run": "run every model of the folders against their equations",
    "gate": "run what changed, and compare it with what was accepted",
    "accept": "accept the present results as the baseline, with a reason",
    "report": "HTML from results, without running anything",
    "derive": "equations, linearization, modes and errata",
    "audit": "no motion: literals, compiled terms, accelerations",
    "compare": "two models, no equations: do they move alike, and what differs",
    "mutate": "what the check would catch: literals and known mistakes",
    "new": "a commented folder that runs, or one from a model file of yours",
    "engines": "what is installed, versions, capabilities",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    options = _parser(given).parse_args(given)
    try:
        return _run(options)
    except OSError as error:
        print(f"crosscheck: {error.filename or ''}: {error.strerror}", file=sys.stderr)
        return FAIL
    except KeyboardInterrupt:
        print("crosscheck: stopped; nothing was written", file=sys.stderr)
        return FAIL


def _run(options: argparse.Namespace) -> int:
    # Imported here: help alone needs no records, and they cost more than all the rest of it.
    from harness.baseline.store import BaselineError
    from harness.files.folders import FolderError
    from harness.records.read import ResultsError

    try:
        code: int = _module(options.command).main(options)
        return code
    except (FolderError, ResultsError) as error:
        print(f"crosscheck: {error}", file=sys.stderr)
        return USAGE
    except BaselineError as error:
        print(f"crosscheck: {error}", file=sys.stderr)
        return FAIL


def _parser(given: Sequence[str]) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="crosscheck",
        description="Tells whether a physics model file is right, to nine digits.",
        epilog="Exit codes: 0 every case agrees; 1 a case differs or is unresolved; 2 wrong usage;"
        " 3 a case failed.",
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, says in COMMANDS.items():
        command = commands.add_parser(name, help=says)
        # Only the command that is meant is imported: sympy or bokeh cost most of a second.
        if name in given[:1]:
            _module(name).add(command)
    return parser


def _module(name: str) -> Any:
    return importlib.import_module(f"harness.cli.{name}")


if __name__ == "__main__":
    sys.exit(main())
