"""The arguments of `crosscheck explain`."""

from __future__ import annotations

import argparse
from collections.abc import Iterable

from physics_crosscheck.harness.interfaces.cli.completion import completed_by
from physics_crosscheck.harness.interfaces.cli.help import CommandHelp

ABOUT = CommandHelp(
    description="Explain a message code: cause, example and remedy.\n"
    "Without a code, list all codes.",
    examples={
        "Explain one code": "crosscheck explain XC101",
        "List all codes": "crosscheck explain",
    },
    exit_codes={"0": "The page was printed.", "2": "Wrong usage, or an unknown code."},
)


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    codes = command.add_argument(
        "codes", nargs="*", metavar="CODE", help="Message codes or names [list all]"
    )
    completed_by(codes, _known_codes)


def _known_codes(**_: object) -> Iterable[str]:
    from physics_crosscheck.harness.records.codes import codes

    return codes()
