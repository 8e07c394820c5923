"""Names beside others that mean nothing that can be run: told, and no success."""

from __future__ import annotations

import sys

from physics_crosscheck.harness.cli.exit_codes import USAGE
from physics_crosscheck.harness.files.folders import NamedFolders
from physics_crosscheck.harness.text.visible import visible


def tell_missing(named: NamedFolders) -> None:
    """Say, before the others run, which names mean nothing that can be run."""
    for fault in named.faults.values():
        print(f"crosscheck: {fault}; the others go on", file=sys.stderr, flush=True)


def with_missing(code: int, named: NamedFolders) -> int:
    """Say so once more where the run ends; the exit code with that.

    A name that means nothing is wrong usage, whatever the others came to, but hides no failure.
    """
    if not named.faults:
        return code
    names = ", ".join(visible(name) for name in named.faults)
    print(f"crosscheck: not run, as told at the beginning: {names}", file=sys.stderr)
    return max(code, USAGE)
