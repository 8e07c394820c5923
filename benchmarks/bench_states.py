"""Accuracy to which the states of a robot distinguish the numbers of its file.

`python -m benchmarks.bench_states robot.urdf robot.xml [--floating]` compares random and chosen
states with 100 random ones. It prints the condition of the slopes of accelerations by the numbers,
in the directions that can be distinguished, and the geometric mean of their singular values. Then
the largest effect of a number at any state: the median, and the least of 95 % of the numbers.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.checks.findings import settings_of
from physics_crosscheck.harness.modelfiles.numbers import NUDGE
from physics_crosscheck.harness.modelfiles.readers import read_robot, robot_numbers, robot_system
from physics_crosscheck.harness.modelfiles.robot import Robot, home_of
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.couplings import Coupled
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.samples import candidates, select_d_optimal

DISTINCT = 1e-6
"""Least singular value of a direction that can be distinguished, relative to the largest."""

RANDOM_STATES, COUNTS = 100, (24, 32, 40)


def slopes(robot: Robot, q: Array, v: Array, forces: Array) -> Array:
    """Return slopes of accelerations by numbers of the file, times their scale, (numbers, K, n)."""
    numbers = robot_numbers(robot.file, settings_of(robot))
    rows = []
    for i in numbers.relevant_numbers:
        number = numbers.numerals[i]
        changes = (NUDGE * number.scale, -NUDGE * number.scale)
        ends = [numbers.tree({i: number.value + change}) for change in changes]
        if any(tree is None or tree.dof != q.shape[1] for tree in ends):
            continue  # valid on one side only
        up, down = (
            TreeEquations(robot_system(replace(robot, tree=tree))).pushed_acceleration(q, v, forces)
            for tree in ends
        )
        rows.append((up - down) / (2 * NUDGE))
    return np.array(rows)


def distinct_directions(rows: Array) -> Array:
    """Return slopes in the directions that can be distinguished, (K, n, directions)."""
    flat = rows.reshape(len(rows), -1)
    flat = flat[np.any(flat != 0, axis=1)]
    flat = flat / np.linalg.norm(flat, axis=1)[:, None]
    vectors, sizes, _ = np.linalg.svd(flat, full_matrices=False)
    clear = vectors[:, sizes > DISTINCT * sizes[0]]
    directions: Array = (clear.T @ flat).reshape(-1, *rows.shape[1:])
    return np.moveaxis(directions, 0, -1)


def _sizes(rows: Array) -> Array:
    """Return the singular values of slopes, (K, n, directions)."""
    return np.asarray(np.linalg.svd(rows.reshape(-1, rows.shape[2]), compute_uv=False), dtype=float)


def report(file: Path, floating: bool) -> None:
    """Print the accuracy for one robot."""
    robot = read_robot(file, floating=floating)
    system = robot_system(robot)
    equations, kept = TreeEquations(system), Coupled(system.tree).kept
    within, home = np.stack(robot.limits, axis=1)[kept], home_of(system.tree, robot.limits)[kept]
    drawn = candidates(equations, within, home, max(COUNTS), 1)
    began = time.process_time()
    chosen = select_d_optimal(drawn.rows(equations), max(COUNTS))
    spent = time.process_time() - began
    rows = slopes(robot, drawn.q, drawn.v, equations.forces_for(drawn.q, drawn.v, drawn.a))
    rows = rows / np.max(np.abs(drawn.a), axis=0)
    shown = distinct_directions(rows)
    print(
        f"{file}: {len(home)} degrees of freedom, {len(rows)} numbers, {shown.shape[2]} directions"
    )
    print(f"  chosen of {len(drawn.q)} in {spent:.2f} s")
    effects = np.abs(rows).max(axis=2)
    full = effects[:, :RANDOM_STATES].max(axis=1)
    effects = effects[full > 0] / full[full > 0, None]
    reference = _sizes(shown[:RANDOM_STATES])
    ways = {f"{n} at random": list(range(n)) for n in (*COUNTS, RANDOM_STATES)}
    ways |= {f"{n} chosen": chosen[:n] for n in COUNTS}
    for name, states in ways.items():
        sizes = _sizes(shown[states])
        accuracy = np.exp(np.mean(np.log(sizes) - np.log(reference)))
        largest = effects[:, states].max(axis=1)
        shares = f"{np.median(largest):.2f}, {np.percentile(largest, 5):.2f}"
        condition = f"condition {sizes[0] / sizes[-1]:.3g}, accuracy {accuracy:.2f}"
        print(f"  {name:14} {condition}, largest effects {shares}")


def main() -> None:
    """Print the accuracy for each file."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.bench_states", description=__doc__)
    parser.add_argument("files", type=Path, nargs="+")
    parser.add_argument("--floating", action="store_true", help="the roots of URDFs move freely")
    options = parser.parse_args()
    for file in options.files:
        report(file, options.floating)


if __name__ == "__main__":
    main()
