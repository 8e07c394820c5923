"""Cost of the comparison of whole steps, in `make bench`.

`python -m benchmarks.bench_laws [robot.xml ...]`: processor time of one compared state, with the
reading of the file, the choice of states and the law, beside one step of MuJoCo with contacts.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from pathlib import Path

import gymnasium
from rich.console import Console
from rich.table import Table

from benchmarks.bench_engines import STEPS, best
from physics_crosscheck.harness.checks.whole_step import check_whole_step
from physics_crosscheck.harness.engines.protocol import ModelSpec

ASSETS = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"
ROBOTS = tuple(ASSETS / f"{name}.xml" for name in ("half_cheetah", "ant", "humanoid"))


def step_seconds(file: Path) -> float:
    """Return the processor time of one step while the robot falls and lies on its floor."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)

    def fall() -> None:
        mujoco.mj_resetData(model, data)
        mujoco.mj_step(model, data, nstep=STEPS)

    return best(fall) / STEPS


def law_ratios(console: Console, files: Sequence[Path] = ROBOTS) -> dict[str, float]:
    """Print the cost of each file's comparison, and return the costs in steps of MuJoCo."""
    table = Table("robot", "outcome", "states", "check", "a state", "a step", "ratio", title="laws")
    ratios = {}
    for file in files:
        began = time.process_time()
        check = check_whole_step(file, ModelSpec(file), "mujoco", 1e-9)
        seconds = time.process_time() - began
        if check is None or not check.record.states:
            console.print(f"{file.name}: no step was compared")
            continue
        record, step = check.record, step_seconds(file)
        state = seconds / record.states
        ratios[f"whole steps: a state / a step, {file.stem}"] = state / step
        sizes = f"{seconds:.2f} s", f"{state * 1e3:.1f} ms", f"{step * 1e6:.1f} us"
        outcome = str(record.outcome)
        table.add_row(file.name, outcome, str(record.states), *sizes, f"{state / step:.0f}")
    console.print(table)
    return ratios


if __name__ == "__main__":
    law_ratios(Console(width=140), [Path(one) for one in sys.argv[1:]] or ROBOTS)
