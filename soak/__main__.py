"""Everything that `make soak` does, with its times: `python -m soak`; exit code 1 on any fault."""

from __future__ import annotations

import argparse
import subprocess
import sys
import time

PARTS = {
    "corpus": ("soak.corpus", "--jobs", "2"),
    "faults while running": ("soak.faults", "--jobs", "2"),
    "random mechanisms": ("campaigns.mechanisms", "--count", "2000", "--seed", "1", "--jobs", "2"),
}
"""Each part is a command of its own, `python -m ...`."""


def main() -> int:
    """Do the parts one after the other, and tell how each ended."""
    parser = argparse.ArgumentParser(prog="python -m soak", description=__doc__)
    parser.add_argument("--only", action="append", choices=sorted(PARTS), metavar="PART")
    wanted = parser.parse_args().only or list(PARTS)
    lines, bad = [], 0
    for part in wanted:
        command = ["-m", *PARTS[part]]
        print(f"{part}: python {' '.join(command)}", flush=True)
        began = time.monotonic()
        code = subprocess.run([sys.executable, *command], check=False).returncode
        bad += bool(code)
        ended = "right" if code == 0 else f"WRONG (exit code {code})"
        lines.append(f"{part:<22} {ended:<22} {(time.monotonic() - began) / 60:5.1f} min")
    print("\n".join(("", *lines)))
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
