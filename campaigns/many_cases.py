"""Speed and memory of a sweep of many cases, and the rows that a kill loses.

`python -m campaigns.many_cases --draws 286 --out DIR` sweeps the drum with its pendulum, the
anchored pair and an arm of seven joints from pybullet_data. It kills all processes once with
SIGKILL and resumes. It prints the cost of the rows, and runs some again by their own commands.
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

REPEATED_ROWS = 12
"""Rows that are run again by their own commands."""

POLL_SECONDS = 2.0
"""Seconds between two measurements of memory."""


def default_systems() -> tuple[str, ...]:
    """Return the systems and the robot file that a sweep takes by default."""
    import pybullet_data  # part of an extra

    return (*SYSTEMS, str(Path(pybullet_data.getDataPath()) / ARM))


def command(options: argparse.Namespace) -> list[str]:
    """Return the command line of the sweep."""
    words = [sys.executable, "-m", "physics_crosscheck", "sweep"]
    words += options.systems or default_systems()
    for text in options.vary or VARY:
        words += ["--vary", text]
    for name in options.engine or ENGINES:
        words += ["--engine", name]
    words += ["--draws", str(options.draws), "--seed", "1", "--jobs", str(options.jobs)]
    words += ["--resolution", repr(options.resolution)]
    return [*words, "--out", str(options.out)]


def process_tree(pid: int) -> Iterator[int]:
    """Yield the id of a process and of all its descendants."""
    yield pid
    for task in Path(f"/proc/{pid}/task").glob("*"):
        for child in (task / "children").read_text().split():
            yield from process_tree(int(child))


def memory(pid: int) -> tuple[float, float]:
    """Return the resident memory of a process and of its largest descendant, MB."""
    sizes = []
    for member in process_tree(pid):
        try:
            pages = int(Path(f"/proc/{member}/statm").read_text().split()[1])
        except OSError:
            continue
        sizes.append(pages * os.sysconf("SC_PAGE_SIZE") / 1e6)
    return sizes[0] if sizes else 0.0, max(sizes[1:], default=0.0)


def run_sweep(words: list[str], kill_after: float) -> list[tuple[float, float, float]]:
    """Run a sweep; return samples of (seconds, MB of the program, MB of its largest worker).

    After `kill_after` seconds SIGKILL ends all its processes, as a power failure would; 0: never.
    """
    samples, began = [], time.monotonic()
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while process.poll() is None:
        elapsed = time.monotonic() - began
        try:
            samples.append((elapsed, *memory(process.pid)))
        except OSError:
            continue
        if 0 < kill_after < elapsed:
            for member in [*process_tree(process.pid)]:
                os.kill(member, signal.SIGKILL)
            process.wait()
            break
        time.sleep(POLL_SECONDS)
    return samples


def print_memory(name: str, samples: list[tuple[float, float, float]]) -> None:
    """Print the largest memory in each fifth of the run."""
    size = max(len(samples) // 5, 1)
    for begin in range(0, len(samples), size):
        part = samples[begin : begin + size]
        print(
            f"{name}: until {part[-1][0]:.0f} s: program {max(p[1] for p in part):.0f} MB,"
            f" largest worker {max(p[2] for p in part):.0f} MB"
        )


def main() -> None:
    """Sweep, kill, resume, and print what the rows cost."""
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
    first = run_sweep(words, options.kill_after)
    plan = read_plan(options.out)
    assert plan is not None
    if options.kill_after:
        stored = sum(done(options.out))
        print(f"killed after {first[-1][0]:.0f} s: {stored} of {plan.cases} rows are stored")
        print_memory("first", first)
    began = time.monotonic()
    samples = run_sweep(words, 0.0) if options.kill_after else first
    seconds = samples[-1][0] if samples else time.monotonic() - began
    print_memory("second", samples)
    rows = list(read_rows(options.out))
    assert sorted(row.index for row in rows) == list(range(plan.cases)), (
        "a row is missing or repeated"
    )
    resumed = len(rows) - (stored if options.kill_after else 0)
    speed = f"{resumed / seconds:.2f} per second with {options.jobs} jobs"
    print(f"{resumed} cases in {seconds:.0f} s: {speed}")
    outcomes = {o: sum(row.outcome is o for row in rows) for o in Outcome}
    print({o.value: count for o, count in outcomes.items() if count})
    for system in (*dict.fromkeys(row.system for row in rows), ""):
        chosen = [row for row in rows if system in ("", row.system)]
        engine = sum(row.engine_seconds for row in chosen)
        parts = {
            "total": sum(row.seconds for row in chosen),
            "reference": sum(row.reference_seconds for row in chosen),
            "loading": sum(row.loading_seconds for row in chosen),
        }
        ratios = ", ".join(f"{name} {value / engine:.3f}" for name, value in parts.items())
        steps = sum(row.steps for row in chosen)
        print(
            f"{system or 'all'}: {len(chosen)} cases, {steps:.3g} steps in {engine:.1f} s: {ratios}"
        )
    repeat_rows(rows)


def repeat_rows(rows: list[SweepRow]) -> None:
    """Run some rows again by their own commands; print whether the verdicts are the same."""
    for row in rows[:: max(len(rows) // REPEATED_ROWS, 1)][:REPEATED_ROWS]:
        words = [sys.executable, "-m", "physics_crosscheck", *shlex.split(row.command)[1:]]
        output = subprocess.run(words, capture_output=True, text=True, check=False).stdout
        is_same = "\n".join(row_lines(row)) in output
        print(f"#{row.index} {row.name}: {'same verdict' if is_same else output}")


if __name__ == "__main__":
    main()
