"""Cost of a script as people write it: `solve_ivp`, a loop of steps, `allclose` and a tolerance.

The script runs at a step that it can afford. Its time for more digits is extrapolated: the error of
a method of first order is proportional to the step, and the time to its inverse.
"""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.integrate import solve_ivp

from benchmarks.bench_segments import sidecar_of
from physics_crosscheck.harness.checks.prepare import prepare_system
from physics_crosscheck.harness.checks.task import load
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.numerics.segments import extrapolate

TARGETS = (1e-6, 1e-9)
MASS, DAMPING, STIFFNESS, START = 1.3, 0.9, 47.0, (0.25, -0.4)
STEP = 1e-4


def by_hand(path: str, h: float, duration: float) -> tuple[float, float]:
    """Return the script's seconds at a step, and its error relative to the amplitude."""
    import mujoco

    began = time.process_time()
    model = mujoco.MjModel.from_xml_path(path)
    data = mujoco.MjData(model)
    model.opt.timestep = h
    data.qpos[0], data.qvel[0] = START
    count = round(duration / h)
    x = np.empty(count + 1)
    x[0] = START[0]
    for i in range(count):
        mujoco.mj_step(model, data)
        x[i + 1] = data.qpos[0]
    t = h * np.arange(count + 1)
    solved = solve_ivp(
        lambda _, y: [y[1], -(DAMPING * y[1] + STIFFNESS * y[0]) / MASS],
        (0, t[-1]),
        START,
        rtol=1e-12,
        atol=1e-14,
        method="DOP853",
        t_eval=t,
    )
    off = np.max(np.abs(x - solved.y[0])) / np.max(np.abs(solved.y[0]))
    return time.process_time() - began, float(off)


def harness_seconds(resolution: float) -> float:
    """Return the seconds to derive and solve the equations, and to extrapolate the model."""
    began = time.process_time()
    prepared = prepare_system(builtin() / "mass_spring_damper", described=False)
    motion = prepared.motions["free"]
    sidecar = sidecar_of(prepared.place, "mujoco.xml")
    model, coordinates = load(prepared.system, sidecar, "mujoco")
    limits = extrapolate(model, coordinates, motion, resolution=resolution)
    assert float(np.max((limits.limit.uncertainty + motion.bound) / motion.unit)) < resolution
    return time.process_time() - began


def rows() -> Iterator[tuple[float, float, float]]:
    """Yield target, seconds by hand (extrapolated), and seconds of the harness."""
    path = str(builtin() / "mass_spring_damper" / "mujoco.xml")
    seconds, off = by_hand(path, STEP, 14.5)
    harness_seconds(TARGETS[0])  # imports
    for target in TARGETS:
        yield target, seconds * off / target, harness_seconds(target)


def by_hand_ratios(console: Console) -> dict[str, float]:
    table = Table("to certify", "by hand (extrapolated)", "harness", "ratio", title="by hand")
    ratios = {}
    for target, hand, harness in rows():
        table.add_row(f"{target:g}", f"{hand:.3g} s", f"{harness:.2f} s", f"{harness / hand:.2g}")
        ratios[f"time to certify {target:g}: harness / a script by hand"] = harness / hand
    console.print(table)
    return ratios
