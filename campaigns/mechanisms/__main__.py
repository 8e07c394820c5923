"""Random mechanisms in 3-D, judged by independent equations in extended precision.

`python -m campaigns.mechanisms --count 2000 --seed 1 --jobs 2` counts wrong verdicts, and limits
whose error exceeds their uncertainty. `--faults 4` also changes four numbers of each file, one at a
time, and counts visible faults that the harness misses. The exit code is 1 if anything is wrong, or
if more than 1 % of the mechanisms are unresolved.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from campaigns.mechanisms.census import CensusOptions, census
from campaigns.mechanisms.results import (
    MechanismResult,
    all_correct,
    detection_lines,
    json_line,
    problem_lines,
    table,
)

PROGRESS = 100
"""Number of mechanisms between two lines of progress."""


def _arguments(given: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m campaigns.mechanisms", description=__doc__)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, help="index of the only mechanism to run")
    parser.add_argument("--engine", default="", choices=("", "mujoco", "pybullet"))
    parser.add_argument("--joints", type=int, default=5, help="largest number of joints [5]")
    parser.add_argument("--segments", type=int, default=31, help="segments of each motion [31]")
    parser.add_argument(
        "--faults",
        type=int,
        nargs="?",
        default=0,
        const=4,
        help="faults in each file [0; without a number 4]",
    )
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, help="file for a line of JSON per mechanism")
    return parser.parse_args(given)


def main(given: Sequence[str] | None = None) -> int:
    """Run a census, print failures and tables, and return the exit code."""
    chosen = _arguments(given)
    options = CensusOptions(
        seed=chosen.seed,
        engine=chosen.engine,
        joints=chosen.joints,
        segments=chosen.segments,
        faults=chosen.faults,
    )
    indices = range(chosen.count) if chosen.only is None else [chosen.only]
    results: list[MechanismResult] = []
    if chosen.out:
        chosen.out.write_bytes(b"")
    for result in census(options, indices, chosen.jobs):
        results.append(result)
        if chosen.out:
            with chosen.out.open("ab") as file:
                file.write(json_line(result))
        if result.wrong or result.unresolved:
            print("\n".join(problem_lines(result, _command(options, result.index))), flush=True)
        if len(results) % PROGRESS == 0:
            wrong = sum(result.wrong for result in results)
            print(f"{len(results)} of {len(indices)}, {wrong} wrong", file=sys.stderr, flush=True)
    print("\n".join(table(results)))
    if options.faults:
        print("\n".join(detection_lines(fault for result in results for fault in result.faults)))
    return int(not all_correct(results))


def _command(options: CensusOptions, index: int) -> str:
    """Return the command that runs a mechanism again."""
    engine = f" --engine {options.engine}" if options.engine else ""
    faults = f" --faults {options.faults}" if options.faults else ""
    return (
        f"python -m campaigns.mechanisms --seed {options.seed} --only {index}{engine}"
        f" --joints {options.joints} --segments {options.segments}{faults}"
    )


if __name__ == "__main__":
    sys.exit(main())
