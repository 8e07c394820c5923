"""A process that judges some entries, one line of JSON each: `python -m soak.corpus.chunk`.

Names are read from standard input, a line each. Arguments are options of `run`. Started by
`python -m soak.corpus`, in an empty folder that is its working folder and its folder for temporary
files.
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
    """Judge, and tell each as soon as it is known."""
    for name in ("CI", "GITHUB_ACTIONS", "GITHUB_STEP_SUMMARY"):
        os.environ.pop(name, None)
    out = os.fdopen(os.dup(1), "w")
    # Where it hangs: `kill -USR1` writes it here.
    faulthandler.register(signal.SIGUSR1, file=open("hangs.txt", "w", encoding="utf-8"))  # noqa: SIM115
    # What C code prints goes nowhere; what the command line prints is caught.
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)
    # An entry that signals its own process must not take its parent's group with it.
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    entries = [ENTRIES[name] for name in sys.stdin.read().splitlines()]
    for judged in judge(entries, *sys.argv[1:]):
        print(json.dumps(asdict(judged)), file=out, flush=True)


if __name__ == "__main__":
    main()
