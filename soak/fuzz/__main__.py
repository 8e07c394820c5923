"""Fuzz the parsers, and exit with 1 if an input breaks a parser's contract.

    python -m soak.fuzz --seconds 3600
    python -m soak.fuzz --seconds 600 --only xml

The command needs Atheris; `make fuzz` installs it. Each parser gets a share of the time in rounds.
Each round runs in a separate process, which starts from the inputs of the previous rounds.
"""

from __future__ import annotations

import argparse
import importlib.util
import subprocess
import sys
import time
from pathlib import Path

from soak import argument_parser
from soak.fuzz.minimize import minimize
from soak.fuzz.targets import TARGETS


def main() -> int:
    """Fuzz the selected parsers, and print the smallest input of each find."""
    options = _options()
    if importlib.util.find_spec("atheris") is None:
        print("soak.fuzz: atheris is not installed; pip install '.[fuzz]'", file=sys.stderr)
        return 2
    chosen = [TARGETS[name] for name in options.only or TARGETS]
    total = sum(target.share for target in chosen)
    finds = options.out / "finds"
    finds.mkdir(parents=True, exist_ok=True)
    runs = dict.fromkeys((target.name for target in chosen), 0)
    for _ in range(options.rounds):
        for target in chosen:
            seconds = options.seconds / options.rounds * target.share / total
            runs[target.name] += fuzz(target.name, max(1.0, seconds), options.out)
            print(f"{target.name:<12} {runs[target.name]:>9} inputs so far", flush=True)
    for name, count in runs.items():
        print(f"{name:<12} {count:>9} inputs")
    return report(finds)


def _options() -> argparse.Namespace:
    parser = argument_parser("soak.fuzz", __doc__)
    parser.add_argument("--seconds", type=float, default=3600.0, help="total time (3600)")
    parser.add_argument("--rounds", type=int, default=4, help="rounds of all parsers (4)")
    out = Path("reports/fuzz")
    parser.add_argument("--out", type=Path, default=out, help=f"inputs and finds ({out})")
    names = sorted(TARGETS)
    parser.add_argument("--only", action="append", choices=names, help="fuzz only this parser")
    return parser.parse_args()


def fuzz(name: str, seconds: float, out: Path) -> int:
    """Fuzz one parser in as many processes as needed, and return the number of inputs."""
    corpus, until, runs = out / "corpus" / name, time.monotonic() + seconds, 0
    corpus.mkdir(parents=True, exist_ok=True)
    while (remaining := until - time.monotonic()) > 1:
        command = [sys.executable, "-m", "soak.fuzz.one", name, str(int(remaining))]
        done = subprocess.run(
            [*command, str(out / "finds"), str(corpus)], capture_output=True, text=True, check=False
        )
        (out / f"{name}.log").write_text(done.stdout + done.stderr, "utf-8")
        counted = [line for line in done.stderr.splitlines() if "number_of_executed_units" in line]
        runs += int(counted[-1].split()[-1]) if counted else 0
        if done.returncode == 0:
            break
        if not counted and not any((out / "finds").glob(f"{name}-stopped-*")):
            raise RuntimeError(f"{name} can't be fuzzed:\n{done.stderr[-2000:]}")
    return runs


def report(finds: Path) -> int:
    """Print every find with its minimized input, and the inputs that ended a process."""
    paths = sorted(finds.glob("*.txt"))
    for path in paths:
        data = path.with_suffix(".input").read_bytes()
        name = path.name.rsplit("-", 1)[0]
        print(f"{name}: {' | '.join(path.read_text('utf-8').splitlines())}")
        small = minimize(TARGETS[name], data)
        path.with_suffix(".small").write_bytes(small)
        print(f"  {small!r}")
    # An input that is slow only on a busy machine does not count: processor time is the limit.
    stopped = [p for p in sorted(finds.glob("*-stopped-*")) if "-slow-unit-" not in p.name]
    for path in stopped:
        print(f"{path.name}: ended the process: {path.read_bytes()[:200]!r}")
    return 1 if paths or stopped else 0


if __name__ == "__main__":
    sys.exit(main())
