"""How well a robot's states tell its file's numbers apart: at random, and chosen.

`python -m benchmarks.bench_states robot.urdf robot.xml [--floating]`: of the slopes of
accelerations by the numbers, in the directions that can be told apart, the condition, and how
finely these are told beside a hundred random states, in geometric mean; and the largest effect of a
number at any of the states beside that at a hundred random ones: the median, and what 95 % have.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.checks.findings import settings_of
from physics_crosscheck.harness.modelfiles.numbers import NUDGE
from physics_crosscheck.harness.modelfiles.readers import read_robot, robot_numbers
from physics_crosscheck.harness.modelfiles.robot import Robot, home_of
from physics_crosscheck.harness.modelfiles.robot_system import robot_system
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.couplings import Coupled
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.samples import candidates, select_d_optimal

TOLD_APART = 1e-6
"""Of the largest singular value: directions with less are those of numbers that are one."""

MANY, COUNTS = 100, (24, 32, 40)


def slopes(robot: Robot, q: Array, v: Array, forces: Array) -> Array:
    """Of accelerations by the file's numbers, each by its size, (numbers, K, n)."""
    numbers = robot_numbers(robot.file, settings_of(robot))
    rows = []
    for i in numbers.relevant_numbers:
        one = numbers.numerals[i]
        ends = [numbers.tree({i: one.value + way * NUDGE * one.scale}) for way in (1, -1)]
        if any(tree is None or tree.dof != q.shape[1] for tree in ends):
            continue  # it may be moved to one side only
        up, down = (
            TreeEquations(robot_system(replace(robot, tree=tree))).pushed_acceleration(q, v, forces)
            for tree in ends
        )
        rows.append((up - down) / (2 * NUDGE))
    return np.array(rows)


def told_apart(rows: Array) -> Array:
    """The same in directions that can be told apart, (K, n, directions)."""
    flat = rows.reshape(len(rows), -1)
    flat = flat[np.any(flat != 0, axis=1)]
    flat = flat / np.linalg.norm(flat, axis=1)[:, None]
    left, sizes, _ = np.linalg.svd(flat, full_matrices=False)
    clear = left[:, sizes > TOLD_APART * sizes[0]]
    found: Array = (clear.T @ flat).reshape(-1, *rows.shape[1:])
    return np.moveaxis(found, 0, -1)


def _sizes(rows: Array) -> Array:
    """Singular values of what states show, (K, n, directions)."""
    return np.asarray(np.linalg.svd(rows.reshape(-1, rows.shape[2]), compute_uv=False), dtype=float)


def report(file: Path, floating: bool) -> None:
    """Print what states of a robot tell."""
    robot = read_robot(file, floating=floating)
    system = robot_system(robot)
    equations, kept = TreeEquations(system), Coupled(system.tree).kept
    within, home = np.stack(robot.limits, axis=1)[kept], home_of(system.tree, robot.limits)[kept]
    many = candidates(equations, within, home, max(COUNTS), 1)
    began = time.process_time()
    chosen = select_d_optimal(many.rows(equations), max(COUNTS))
    spent = time.process_time() - began
    rows = slopes(robot, many.q, many.v, equations.forces_for(many.q, many.v, many.a))
    rows = rows / np.max(np.abs(many.a), axis=0)
    shown = told_apart(rows)
    print(f"{file}: {len(home)} freedoms, {len(rows)} numbers, {shown.shape[2]} directions;")
    print(f"  chosen of {len(many.q)} in {spent:.2f} s")
    effects = np.abs(rows).max(axis=2)
    full = effects[:, :MANY].max(axis=1)
    effects = effects[full > 0] / full[full > 0, None]
    known = _sizes(shown[:MANY])
    ways = {f"{n} at random": list(range(n)) for n in (*COUNTS, MANY)}
    ways |= {f"{n} chosen": chosen[:n] for n in COUNTS}
    for name, states in ways.items():
        sizes = _sizes(shown[states])
        finely = np.exp(np.mean(np.log(sizes) - np.log(known)))
        most = effects[:, states].max(axis=1)
        shares = f"{np.median(most):.2f}, {np.percentile(most, 5):.2f}"
        condition = f"condition {sizes[0] / sizes[-1]:.3g}, finely {finely:.2f}"
        print(f"  {name:14} {condition}, largest effects {shares}")


def main() -> None:
    """Of every file given."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.bench_states", description=__doc__)
    parser.add_argument("files", type=Path, nargs="+")
    parser.add_argument("--floating", action="store_true", help="the roots of URDFs move freely")
    options = parser.parse_args()
    for file in options.files:
        report(file, options.floating)


if __name__ == "__main__":
    main()
