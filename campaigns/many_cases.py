"""Many cases of a sweep: how many a second, how much memory, and what a kill in the middle loses.

`python -m campaigns.many_cases --draws 286 --out DIR` sweeps the drum with its pendulum, the
anchored pair and an arm of seven joints (pybullet_data's), kills everything once with SIGKILL, goes
on, tells what the rows cost, and runs some of them again by their own commands.
"""

from __future__ import annotations

import argparse
import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from physics_crosscheck.harness.extras.sweep.store import done, read_plan, read_rows
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.sweep import SweepRow
from physics_crosscheck.harness.render.terminal.sweep import row_lines

VARY = (
    "M=1.2:4.8:log", "m=0.4:1.6:log", "l=0.3:1.2", "k=30:130:log", "g=9.6:10",
    "m1=0.8:3.2:log", "m2=0.5:1.8:log", "c=0.3:3", "k1=30:110", "k2=35:140",
    *(f"link[lbr_iiwa_link_{i}]/inertial/mass@value=1:6:log" for i in range(1, 8)),
    *(f"joint[lbr_iiwa_joint_{i}]/dynamics@damping=0.1:1" for i in range(1, 8)),
)  # fmt: skip
ENGINES = ("mujoco", "pybullet", "pymunk")
SYSTEMS = ("drum_pendulum", "anchored_pair")
ARM = "kuka_iiwa/model.urdf"

AGAIN = 12
"""Rows that are run again by their own commands."""

MOMENT = 2.0
"""Seconds between two looks at the memory."""


def defaults() -> tuple[str, ...]:
    import pybullet_data  # an engine's, in an extra

    return (*SYSTEMS, str(Path(pybullet_data.getDataPath()) / ARM))


def command(options: argparse.Namespace) -> list[str]:
    words = [sys.executable, "-m", "physics_crosscheck", "sweep", *(options.systems or defaults())]
    for text in options.vary or VARY:
        words += ["--vary", text]
    for name in options.engine or ENGINES:
        words += ["--engine", name]
    words += ["--draws", str(options.draws), "--seed", "1", "--jobs", str(options.jobs)]
    words += ["--resolution", repr(options.resolution)]
    return [*words, "--out", str(options.out)]


def family(pid: int) -> Iterator[int]:
    """A process, and all that follow from it."""
    yield pid
    for task in Path(f"/proc/{pid}/task").glob("*"):
        for child in (task / "children").read_text().split():
            yield from family(int(child))


def memory(pid: int) -> tuple[float, float]:
    """Megabytes that a process has resident, and the largest of those that follow from it."""
    sizes = []
    for one in family(pid):
        try:
            pages = int(Path(f"/proc/{one}/statm").read_text().split()[1])
        except OSError:
            continue
        sizes.append(pages * os.sysconf("SC_PAGE_SIZE") / 1e6)
    return sizes[0] if sizes else 0.0, max(sizes[1:], default=0.0)


def watched(words: list[str], kill_after: float) -> list[tuple[float, float, float]]:
    """Run a sweep: seconds, megabytes of the program and of its largest worker, time after time.

    After so many seconds it is killed as a machine that loses its power; 0: never.
    """
    found, began = [], time.monotonic()
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while process.poll() is None:
        elapsed = time.monotonic() - began
        try:
            found.append((elapsed, *memory(process.pid)))
        except OSError:
            continue
        if 0 < kill_after < elapsed:
            for one in [*family(process.pid)]:
                os.kill(one, signal.SIGKILL)
            process.wait()
            break
        time.sleep(MOMENT)
    return found


def told(name: str, looks: list[tuple[float, float, float]]) -> None:
    """How memory went, in five parts."""
    size = max(len(looks) // 5, 1)
    for begin in range(0, len(looks), size):
        part = looks[begin : begin + size]
        print(
            f"{name}: until {part[-1][0]:.0f} s: program {max(p[1] for p in part):.0f} MB,"
            f" largest worker {max(p[2] for p in part):.0f} MB"
        )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("systems", nargs="*")
    parser.add_argument("--vary", action="append", default=[])
    parser.add_argument("--engine", action="append", default=[])
    parser.add_argument("--draws", type=int, default=30)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--resolution", type=float, default=1e-9)
    parser.add_argument("--kill-after", type=float, default=60.0)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    words = command(options)
    first = watched(words, options.kill_after)
    plan = read_plan(options.out)
    assert plan is not None
    if options.kill_after:
        kept = sum(done(options.out))
        print(f"killed after {first[-1][0]:.0f} s: {kept} of {plan.cases} rows are kept")
        told("first", first)
    began = time.monotonic()
    looks = watched(words, 0.0) if options.kill_after else first
    seconds = looks[-1][0] if looks else time.monotonic() - began
    told("second", looks)
    rows = list(read_rows(options.out))
    assert sorted(row.index for row in rows) == list(range(plan.cases)), (
        "a row is missing, or twice"
    )
    here = len(rows) - (kept if options.kill_after else 0)
    print(
        f"{here} cases in {seconds:.0f} s: {here / seconds:.2f} a second with {options.jobs} jobs"
    )
    outcomes = {o: sum(row.outcome is o for row in rows) for o in Outcome}
    print({o.value: count for o, count in outcomes.items() if count})
    for system in (*dict.fromkeys(row.system for row in rows), ""):
        some = [row for row in rows if system in ("", row.system)]
        engine = sum(row.engine_seconds for row in some)
        parts = {
            "in all": sum(row.seconds for row in some),
            "reference": sum(row.reference_seconds for row in some),
            "loading": sum(row.loading_seconds for row in some),
        }
        ratios = ", ".join(f"{name} {value / engine:.3f}" for name, value in parts.items())
        steps = sum(row.steps for row in some)
        print(
            f"{system or 'all'}: {len(some)} cases, {steps:.3g} steps in {engine:.1f} s: {ratios}"
        )
    again(rows)


def again(rows: list[SweepRow]) -> None:
    """Some rows by their own commands: each prints the verdict that its row has."""
    for row in rows[:: max(len(rows) // AGAIN, 1)][:AGAIN]:
        words = [sys.executable, "-m", "physics_crosscheck", *shlex.split(row.command)[1:]]
        told = subprocess.run(words, capture_output=True, text=True, check=False).stdout
        same = "\n".join(row_lines(row)) in told
        print(f"#{row.index} {row.name}: {'the same again' if same else told}")


if __name__ == "__main__":
    main()
