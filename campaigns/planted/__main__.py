"""Each number of robots' files made wrong, one at a time: is it caught, and named?

`python -m campaigns.planted robot.urdf robot.xml`: every number by 1e-6 and by 1 % of its
size; a changed copy runs in an engine, beside the equations of the file as it is. What no motion
depends on, by the exact change of the ends, is told apart. Exit code 1 where less than 99 % of what
can be seen is caught and named.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from campaigns.planted.compared import compared
from campaigns.planted.fates import Fate, Ground, Planted, plant, table
from campaigns.planted.record import Record
from physics_crosscheck.harness.engines.registry import engines_reading

SHARES = (1e-6, 1e-2)

WANTED = 0.99


@dataclass(frozen=True, kw_only=True)
class Robot:
    """A file and how it is run.

    Attributes:
        file: of the robot.
        engine: that runs it.
        floating: whether the root link of a URDF moves freely.
        edited: as in `Ground.of`.
        compare: whether the old file is compared to the new one; else the new one runs beside the
            equations of the old.
        switched: settings of the engine that are on.
    """

    file: Path
    engine: str
    floating: bool
    edited: bool
    compare: bool
    switched: tuple[str, ...]

    @property
    def told(self) -> str:
        """What is run, and how: one line."""
        ways = [name for name in ("floating", "edited", "compare") if getattr(self, name)]
        return " ".join([self.file.parent.name, self.file.name, self.engine, *ways, *self.switched])


@cache
def _ground(robot: Robot) -> Ground:
    return Ground.of(
        robot.file,
        robot.engine,
        floating=robot.floating,
        edited=robot.edited,
        known=not robot.compare,
        settings=dict.fromkeys(robot.switched, True),
    )


def spread(count: int) -> list[int]:
    """All indices below a count, so that any first few of them are spread evenly."""
    bits = max(count - 1, 1).bit_length()
    return sorted(range(count), key=lambda i: f"{i:0{bits}b}"[::-1])


def planted(robot: Robot, seconds: float, record: Record) -> Iterator[Planted]:
    """The faults of a file's numbers, spread evenly, as many as processor time allows."""
    ground, tried = _ground(robot), compared if robot.compare else plant
    began = time.process_time()
    for place in spread(len(ground.numbers.relevant_numbers)):
        index = ground.numbers.relevant_numbers[place]
        one = ground.numbers.numerals[index]
        for share in SHARES:
            found = record.known(one.file.name, one.line, one.address, share)
            if found is None:
                found = tried(ground, index, share)
                record.add(found)
            yield found
        if time.process_time() - began > seconds:
            return


def main(given: Sequence[str] | None = None) -> int:
    """Print what is not named, and the counts; the exit code."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.planted", description=__doc__)
    parser.add_argument("files", type=Path, nargs="+")
    parser.add_argument("--engine", default="", help="the first that reads the file")
    parser.add_argument(
        "--seconds",
        type=float,
        default=float("inf"),
        help="processor time for a file; numbers are spread evenly, and counted",
    )
    parser.add_argument("--floating", action="store_true", help="the root link of a URDF is free")
    parser.add_argument(
        "--edited", action="store_true", help="suspect the changed copy, and read it each time anew"
    )
    parser.add_argument(
        "--compare", action="store_true", help="compare the file to each changed copy"
    )
    parser.add_argument(
        "--record", type=Path, help="a file of what has been tried, which is not tried again"
    )
    parser.add_argument("--set", action="append", default=[], help="a setting of the engine: on")
    options = parser.parse_args(given)
    everything: list[Planted] = []
    for file in options.files:
        engine = options.engine or engines_reading(file.suffix)[0].name
        robot = Robot(
            file=file,
            engine=engine,
            floating=options.floating,
            edited=options.edited,
            compare=options.compare,
            switched=tuple(options.set),
        )
        found = []
        for one in planted(robot, options.seconds, Record(options.record, robot.told)):
            found.append(one)
            if one.fate.seen and one.fate not in (Fate.NAMED, Fate.TIED):
                print(one, flush=True)
        everything += found
        of = (
            f"{len(found) // len(SHARES)} of {len(_ground(robot).numbers.relevant_numbers)} numbers"
        )
        print(f"{file} [{engine}]: {of}, {sum(one.seconds for one in found):.0f} s")
        print("\n".join(f"  {line}" for line in table(found)), flush=True)
    print("\n".join(table(everything)))
    seen = [one for one in everything if one.fate.seen]
    good = sum(one.fate in (Fate.NAMED, Fate.TIED) for one in seen)
    return int(good < WANTED * len(seen))


if __name__ == "__main__":
    sys.exit(main())
