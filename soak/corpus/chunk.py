"""A process that judges entries and prints a line of JSON for each: `python -m soak.corpus.chunk`.

The command reads names from standard input, one on each line. Arguments are options of `run`.
`python -m soak.corpus` starts it in an empty working folder that also holds temporary files.
"""

from __future__ import annotations

import faulthandler
import json
import os
import signal
import sys
from dataclasses import asdict

from soak.corpus.entries import ENTRIES
from soak.corpus.judge import judge


def main() -> None:
    """Judge the entries, and print each result at once."""
    for name in ("CI", "GITHUB_ACTIONS", "GITHUB_STEP_SUMMARY"):
        os.environ.pop(name, None)
    out = os.fdopen(os.dup(1), "w")
    # If the process hangs, `kill -USR1` writes its stack here.
    faulthandler.register(signal.SIGUSR1, file=open("hangs.txt", "w", encoding="utf-8"))  # noqa: SIM115
    # Discard the output of C code. The output of the command line is captured elsewhere.
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)
    # An entry that signals its own process must not end the parent's group.
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    entries = [ENTRIES[name] for name in sys.stdin.read().splitlines()]
    for judged in judge(entries, *sys.argv[1:]):
        print(json.dumps(asdict(judged)), file=out, flush=True)


if __name__ == "__main__":
    main()
