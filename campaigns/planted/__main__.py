"""Faults planted in each number of robot files, one at a time: is each caught and named?

`python -m campaigns.planted robot.urdf robot.xml` changes every number by 1e-6 and by 1 % of its
size. The changed copy runs in an engine and is compared with the equations of the original. The
exact change of the ends separates numbers that no motion depends on. The exit code is 1 if less
than 99 % of the visible faults are caught and named.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from campaigns.planted.compared import judge_by_compare
from campaigns.planted.fates import FaultBaseline, FaultFate, RobotFault, judge_by_equations, table
from physics_crosscheck.harness.engines.registry import engines_reading

SHARES = (1e-6, 1e-2)

MIN_NAMED_SHARE = 0.99


class FaultRecord:
    """A file of judged faults, a line of JSON each, from which an interrupted campaign resumes.

    Args:
        path: of the file; None stores nothing.
        run: title of the run; faults of other runs in the same file are ignored.
    """

    def __init__(self, path: Path | None, run: str) -> None:
        self._path, self._run = path, run
        lines = path.read_text("utf-8").splitlines() if path and path.exists() else []
        rows = [json.loads(line) for line in lines]
        faults = [
            RobotFault(**{**row["fault"], "fate": FaultFate(row["fault"]["fate"])})
            for row in rows
            if row["run"] == run
        ]
        self.faults = {(one.file, one.line, one.address, one.share): one for one in faults}

    def add(self, fault: RobotFault) -> None:
        """Write a judged fault to the file."""
        if self._path is not None:
            with self._path.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps({"run": self._run, "fault": vars(fault)}) + "\n")


def spread_indices(count: int) -> list[int]:
    """Return all indices below a count, ordered so that every prefix is spread evenly."""
    bits = max(count - 1, 1).bit_length()
    return sorted(range(count), key=lambda i: f"{i:0{bits}b}"[::-1])


def judged_faults(
    baseline: FaultBaseline, compare: bool, seconds: float, record: FaultRecord
) -> Iterator[RobotFault]:
    """Yield judged faults of a file's numbers, spread evenly, until processor time is used up."""
    judge, began = judge_by_compare if compare else judge_by_equations, time.process_time()
    for place in spread_indices(len(baseline.numbers.relevant_numbers)):
        index = baseline.numbers.relevant_numbers[place]
        number = baseline.numbers.numerals[index]
        for share in SHARES:
            key = number.file.name, number.line or 0, number.address, share
            fault = record.faults.get(key)
            if fault is None:
                fault = judge(baseline, index, share)
                record.add(fault)
            yield fault
        if time.process_time() - began > seconds:
            return


def main(given: Sequence[str] | None = None) -> int:
    """Print the faults that are not named, and the counts; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.planted", description=__doc__)
    parser.add_argument("files", type=Path, nargs="+")
    parser.add_argument("--engine", default="", help="engine [the first that reads the file]")
    parser.add_argument(
        "--seconds",
        type=float,
        default=float("inf"),
        help="processor time for a file; its numbers are sampled evenly [unlimited]",
    )
    parser.add_argument("--floating", action="store_true", help="free the root link of URDFs")
    parser.add_argument(
        "--edited", action="store_true", help="read the changed copy each time, and suspect it"
    )
    parser.add_argument(
        "--compare", action="store_true", help="test `crosscheck compare` on the file and each copy"
    )
    parser.add_argument("--record", type=Path, help="file of judged faults, to resume")
    parser.add_argument(
        "--set", action="append", default=[], help="switch on a setting of the engine"
    )
    options = parser.parse_args(given)
    everything: list[RobotFault] = []
    for file in options.files:
        engine = options.engine or engines_reading(file.suffix)[0].name
        words = [name for name in ("floating", "edited", "compare") if getattr(options, name)]
        title = " ".join([file.parent.name, file.name, engine, *words, *options.set])
        baseline = FaultBaseline.from_file(
            file,
            engine,
            floating=options.floating,
            edited=options.edited,
            use_equations=not options.compare,
            settings=dict.fromkeys(options.set, True),
        )
        faults, record = [], FaultRecord(options.record, title)
        for fault in judged_faults(baseline, options.compare, options.seconds, record):
            faults.append(fault)
            if fault.fate.is_visible and fault.fate not in (FaultFate.NAMED, FaultFate.TIED):
                print(fault, flush=True)
        everything += faults
        count = len(baseline.numbers.relevant_numbers)
        numbers = f"{len(faults) // len(SHARES)} of {count} numbers"
        print(f"{file} [{engine}]: {numbers}, {sum(f.seconds for f in faults):.0f} s")
        print("\n".join(f"  {line}" for line in table(faults)), flush=True)
    print("\n".join(table(everything)))
    visible = [fault for fault in everything if fault.fate.is_visible]
    named = sum(fault.fate in (FaultFate.NAMED, FaultFate.TIED) for fault in visible)
    return int(named < MIN_NAMED_SHARE * len(visible))


if __name__ == "__main__":
    sys.exit(main())
