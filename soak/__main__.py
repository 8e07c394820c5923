"""Run every part of `make soak`, and exit with 1 if a part fails.

    python -m soak
    python -m soak --only corpus

The command prints the result and the duration of each part.
"""

from __future__ import annotations

import subprocess
import sys
import time

from soak import argument_parser

PARTS = {
    "corpus": ("soak.corpus", "--jobs", "2"),
    "faults while running": ("soak.faults", "--jobs", "2"),
    "random mechanisms": ("campaigns.mechanisms", "--count", "2000", "--seed", "1", "--jobs", "2"),
}
"""Module and arguments of each part, which runs as `python -m ...`."""


def main() -> int:
    """Run the parts in order, and print the result and the duration of each."""
    parser = argument_parser("soak", __doc__)
    parser.add_argument("--only", action="append", choices=sorted(PARTS), help="run only this part")
    parts = parser.parse_args().only or list(PARTS)
    lines, bad = [], 0
    for part in parts:
        command = ["-m", *PARTS[part]]
        print(f"{part}: python {' '.join(command)}", flush=True)
        began = time.monotonic()
        code = subprocess.run([sys.executable, *command], check=False).returncode
        bad += bool(code)
        verdict = "right" if code == 0 else f"WRONG (exit code {code})"
        lines.append(f"{part:<22} {verdict:<22} {(time.monotonic() - began) / 60:5.1f} min")
    print("\n".join(("", *lines)))
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
