"""The command line, `crosscheck COMMAND`; each command is a module of `harness.cli`.

Its arguments are declared in the module of that name in `harness.cli.parsers`: what a command needs
to do its work is not imported before they are parsed.
"""

from __future__ import annotations

import argparse
import importlib
import os
import signal
import sys
from collections.abc import Sequence
from typing import Any

from physics_crosscheck.harness.cli.completion import COMPLETING, complete, words_before
from physics_crosscheck.harness.cli.exit_codes import FAIL, SIGNALLED, USAGE
from physics_crosscheck.harness.cli.streams import claim_streams, unprinted
from physics_crosscheck.harness.schedule.environment import claim_defaults
from physics_crosscheck.harness.schedule.stop import Stopped, raising

COMMANDS = {
    "run": "run every model of the folders against their equations",
    "list": "the cases that a run has, by their names; nothing is run",
    "gate": "run what changed, and compare it with what was accepted",
    "review": "go through what the gate finds, one by one, and accept or reject it",
    "accept": "accept the present results as the baseline, with a reason",
    "report": "HTML from results, without running anything; of two runs, what moved",
    "derive": "equations, linearization, modes and errata",
    "audit": "no motion: literals, compiled terms, accelerations",
    "compare": "two models, no equations: do they move alike, and what differs",
    "versions": "the same models under several versions of an engine",
    "sweep": "many cases: constants drawn, steps, integrators and engines varied, as rows",
    "mutate": "what the check would catch: literals and known mistakes",
    "new": "a commented folder that runs, or one from a model file of yours",
    "engines": "what is installed, versions, capabilities",
    "completion": "a shell's script that completes what is typed with Tab",
}


EXIT_CODES = (
    "Exit codes: 0 every case agrees; 1 a case differs or is unresolved, or the audit finds a wrong"
    " number; 2 wrong usage; 3 a case, an audit or a diagnosis failed, or nothing could be tested;"
    " 128 + N stopped by signal N, 130 by Ctrl-C."
)


def program() -> int:
    """The command line as a program of its own; returns the exit code."""
    claim_streams()
    claim_defaults()
    code = main()
    if lost := unprinted():
        print(f"crosscheck: standard output: {lost}", file=sys.stderr)
    return code or (FAIL if lost else 0)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    if COMPLETING in os.environ:
        given = words_before()
    try:
        with raising():
            # Within: a command's modules are imported here, which takes a while on a busy machine.
            parser = _parser(given)
            if COMPLETING in os.environ:
                complete(parser)
            options = parser.parse_args(given)
            for note in getattr(options, "settings_notes", ()):
                print(f"crosscheck: {note}", file=sys.stderr)
            return _guarded(options)
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        print(f"crosscheck: {where}{error.strerror or error}", file=sys.stderr)
        return FAIL
    except KeyboardInterrupt as stopped:
        number = stopped.number if isinstance(stopped, Stopped) else signal.SIGINT
        print(f"crosscheck: stopped by {signal.Signals(number).name}", file=sys.stderr)
        return SIGNALLED + number


def _guarded(options: argparse.Namespace) -> int:
    """Run a command; where its output is read for workflow commands, no name in it may be one."""
    asked = getattr(options, "format", "") == "github"
    if not asked and os.environ.get("GITHUB_ACTIONS", "").lower() != "true":
        return _run(options)
    from physics_crosscheck.harness.text.github import plain_logs

    with plain_logs():
        return _run(options)


def _run(options: argparse.Namespace) -> int:
    # Imported here: help alone needs no records, and they cost more than all the rest of it.
    from physics_crosscheck.harness.baseline.store import BaselineError
    from physics_crosscheck.harness.files.folders import FolderError
    from physics_crosscheck.harness.records.read import ResultsError
    from physics_crosscheck.harness.schedule.executor import ClusterError

    try:
        code: int = _module(options.command).main(options)
        return code
    except (FolderError, ResultsError, ClusterError) as error:
        print(f"crosscheck: {error}", file=sys.stderr)
        return USAGE
    except BaselineError as error:
        print(f"crosscheck: {error}", file=sys.stderr)
        return FAIL


class _Version(argparse.Action):
    """Says the version; metadata costs more to import than all help."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from importlib.metadata import version

        print(f"crosscheck {version('physics-crosscheck')}")
        parser.exit()


def _parser(given: Sequence[str]) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="crosscheck",
        description="Tells whether a physics model file is right, to nine digits.",
        epilog=EXIT_CODES,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version, and end")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, says in COMMANDS.items():
        command = commands.add_parser(name, help=says, epilog=EXIT_CODES)
        # Only the command that is meant: what its arguments may be takes a while to import too.
        if name in given[:1]:
            importlib.import_module(f"physics_crosscheck.harness.cli.parsers.{name}").add(command)
            _with_settings(command, name)
    return parser


def _with_settings(command: argparse.ArgumentParser, name: str) -> None:
    """A project's own defaults."""
    from physics_crosscheck.harness.cli.settings import SettingsError, apply

    try:
        apply(command, name)
    except SettingsError as error:
        command.exit(USAGE, f"crosscheck: {error}\n")


def _module(name: str) -> Any:
    return importlib.import_module(f"physics_crosscheck.harness.cli.{name}")


if __name__ == "__main__":
    sys.exit(program())
