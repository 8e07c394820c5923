"""Each number of robots' files made wrong, one at a time: is it caught, and named?

`python -m campaigns.planted robot.urdf robot.xml --jobs 2`: every number by 1e-6 and by 1 % of its
size; a changed copy runs in an engine, beside the equations of the file as it is. What no motion
depends on, by the exact change of the ends, is told apart. Exit code 1 where less than 99 % of what
can be seen is caught and named.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from pathlib import Path

from campaigns.planted.fates import Fate, Ground, Planted, faults, table
from harness.engines.registry import readers

SHARES = (1e-6, 1e-2)

WANTED = 0.99


@cache
def _ground(file: Path, engine: str) -> Ground:
    return Ground.of(file, engine)


def _some(file: Path, engine: str, index: int) -> list[Planted]:
    return list(faults(_ground(file, engine), SHARES, [index]))


def planted(file: Path, engine: str, every: int, jobs: int) -> Iterator[Planted]:
    """The faults of a file, of each `every`-th of its numbers."""
    chosen = _ground(file, engine).numbers.saying[::every]
    if jobs == 1:
        yield from faults(_ground(file, engine), SHARES, chosen)
        return
    with ProcessPoolExecutor(jobs) as pool:
        for found in pool.map(partial(_some, file, engine), chosen):
            yield from found


def main(given: Sequence[str] | None = None) -> int:
    """Print what is not named, and the counts; the exit code."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.planted", description=__doc__)
    parser.add_argument("files", type=Path, nargs="+")
    parser.add_argument("--engine", default="", help="the first that reads the file")
    parser.add_argument("--every", type=int, default=1, help="of the numbers, the how-manieth")
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args(given)
    everything: list[Planted] = []
    for file in options.files:
        began = time.perf_counter()
        engine = options.engine or readers(file.suffix)[0].name
        found = list(planted(file, engine, options.every, options.jobs))
        everything += found
        for one in found:
            if one.fate.seen and one.fate not in (Fate.NAMED, Fate.TIED):
                print(one)
        print(f"{file} [{engine}], {time.perf_counter() - began:.0f} s")
        print("\n".join(f"  {line}" for line in table(found)), flush=True)
    print("\n".join(table(everything)))
    seen = [one for one in everything if one.fate.seen]
    good = sum(one.fate in (Fate.NAMED, Fate.TIED) for one in seen)
    return int(good < WANTED * len(seen))


if __name__ == "__main__":
    sys.exit(main())
