"""Random mechanisms in 3-D, judged beside dynamics written for themselves with more digits.

`python -m campaigns.mechanisms --count 2000 --seed 1 --jobs 2`: is any verdict wrong, is any limit
outside its uncertainty? With `--faults 4`, that many numbers of each file are made wrong, one at a
time: is each told that can be seen? Exit code 1 where the answer is the wrong one, or where more
than a hundredth of the mechanisms is left unresolved.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from campaigns.mechanisms.census import Options, census
from campaigns.mechanisms.results import Result, all_right, fates, line, offender, table

PROGRESS = 100
"""Mechanisms between two lines of progress."""


def _arguments(given: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m campaigns.mechanisms", description=__doc__)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, help="the mechanism of that number, and no other")
    parser.add_argument("--engine", default="", choices=("", "mujoco", "pybullet"))
    parser.add_argument("--joints", type=int, default=5, help="at most")
    parser.add_argument("--segments", type=int, default=31, help="of each motion")
    parser.add_argument("--faults", type=int, nargs="?", default=0, const=4, help="of each file")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, help="a file for a line of JSON each, as they come")
    return parser.parse_args(given)


def main(given: Sequence[str] | None = None) -> int:
    """Run a census and tell what came of it; the exit code."""
    chosen = _arguments(given)
    options = Options(
        seed=chosen.seed,
        engine=chosen.engine,
        joints=chosen.joints,
        segments=chosen.segments,
        faults=chosen.faults,
    )
    indices = range(chosen.count) if chosen.only is None else [chosen.only]
    results: list[Result] = []
    if chosen.out:
        chosen.out.write_bytes(b"")
    for result in census(options, indices, chosen.jobs):
        results.append(result)
        if chosen.out:
            with chosen.out.open("ab") as file:
                file.write(line(result))
        if result.wrong or result.unresolved:
            print("\n".join(offender(result, _command(options, result.index))), flush=True)
        if len(results) % PROGRESS == 0:
            wrong = sum(result.wrong for result in results)
            print(f"{len(results)} of {len(indices)}, {wrong} wrong", file=sys.stderr, flush=True)
    print("\n".join(table(results)))
    if options.faults:
        print("\n".join(fates(fault for result in results for fault in result.faults)))
    return int(not all_right(results))


def _command(options: Options, index: int) -> str:
    """What runs one mechanism again."""
    engine = f" --engine {options.engine}" if options.engine else ""
    faults = f" --faults {options.faults}" if options.faults else ""
    return (
        f"python -m campaigns.mechanisms --seed {options.seed} --only {index}{engine}"
        f" --joints {options.joints} --segments {options.segments}{faults}"
    )


if __name__ == "__main__":
    sys.exit(main())
