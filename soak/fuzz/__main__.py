"""Fuzz every parser: `python -m soak.fuzz --seconds 3600`; it needs Atheris, see `make fuzz`.

Each parser gets its share of the time, in rounds, in a process of its own that goes on from the
inputs kept before. Finds are made small and printed; exit code 1 where there is one.
"""

from __future__ import annotations

import argparse
import importlib.util
import subprocess
import sys
import time
from pathlib import Path

from soak.fuzz.minimize import smallest
from soak.fuzz.targets import TARGETS


def main() -> int:
    """Fuzz, make small, print."""
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
    parser = argparse.ArgumentParser(prog="python -m soak.fuzz")
    parser.add_argument("--seconds", type=float, default=3600.0, help="in all (3600)")
    parser.add_argument("--rounds", type=int, default=4, help="that the time is cut into (4)")
    parser.add_argument("--out", type=Path, default=Path("reports/fuzz"), metavar="DIR")
    parser.add_argument("--only", action="append", choices=sorted(TARGETS), metavar="NAME")
    return parser.parse_args()


def fuzz(name: str, seconds: float, out: Path) -> int:
    """Fuzz one parser, with a new process wherever one was ended; returns how many inputs ran."""
    corpus, until, runs = out / "corpus" / name, time.monotonic() + seconds, 0
    corpus.mkdir(parents=True, exist_ok=True)
    while (left := until - time.monotonic()) > 1:
        command = [sys.executable, "-m", "soak.fuzz.one", name, str(int(left))]
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
    """Print every find with the smallest input that shows it, and those that ended a process."""
    found = sorted(finds.glob("*.txt"))
    for path in found:
        data = path.with_suffix(".input").read_bytes()
        name = path.name.rsplit("-", 1)[0]
        print(f"{name}: {' | '.join(path.read_text('utf-8').splitlines())}")
        small = smallest(TARGETS[name], data)
        path.with_suffix(".small").write_bytes(small)
        print(f"  {small!r}")
    # An input that is merely slow on a busy machine is no find: its processor time is counted.
    stopped = [p for p in sorted(finds.glob("*-stopped-*")) if "-slow-unit-" not in p.name]
    for path in stopped:
        print(f"{path.name}: ended the process: {path.read_bytes()[:200]!r}")
    return 1 if found or stopped else 0


if __name__ == "__main__":
    sys.exit(main())
