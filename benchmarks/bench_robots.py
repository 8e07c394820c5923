"""Processor time and memory of `run` and `new --from` of robot files."""

from __future__ import annotations

import multiprocessing
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from importlib.util import find_spec
from multiprocessing.connection import Connection
from pathlib import Path
from typing import NamedTuple

from rich.console import Console
from rich.table import Table

from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.commands.scaffold.from_model import from_model
from physics_crosscheck.harness.engines.registry import engines_reading

ROBOTS = (
    ("pybullet_data", "kuka_iiwa/model.urdf", False),
    ("pybullet_data", "franka_panda/panda.urdf", False),
    ("pybullet_data", "a1/a1.urdf", True),
    ("gymnasium", "envs/mujoco/assets/humanoid.xml", False),
)
"""Package, file, whether its root floats."""


class Cost(NamedTuple):
    """Cost of a call in a process of its own: processor seconds, peak MiB, and its result."""

    seconds: float
    memory: float
    result: str


def cost(call: Callable[[], str]) -> Cost:
    """Call a function in a fork of this process, so that its memory is its own."""
    here, there = multiprocessing.Pipe(duplex=False)
    context = multiprocessing.get_context("fork")
    child = context.Process(target=_measured, args=(call, there))
    child.start()
    measured: Cost = here.recv()
    child.join()
    return measured


def _measured(call: Callable[[], str], answer: Connection) -> None:
    began = time.process_time()
    try:
        result = call()
    except Exception as error:
        result = str(error).rpartition(": ")[2]
    used = resource.getrusage(resource.RUSAGE_SELF)
    answer.send(Cost(time.process_time() - began, used.ru_maxrss / 1024, result))


def with_children() -> float:
    """Return the processor seconds of this process and its children, ended ones included."""
    tick = os.sysconf("SC_CLK_TCK")
    seconds = time.process_time()
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            words = stat.read_text().rpartition(")")[2].split()
            if int(words[1]) == os.getpid():
                seconds += sum(map(int, words[11:15])) / tick
    return seconds


def whole_new(console: Console) -> None:
    """Print the time of `crosscheck new --from` of an arm, with start-up and workers."""
    package = find_spec("pybullet_data")
    if package is None or package.origin is None:
        return
    file = Path(package.origin).parent / "kuka_iiwa" / "model.urdf"
    times = []
    for _ in range(3):
        done = subprocess.run(
            [sys.executable, "-m", "benchmarks.bench_robots", str(file)],
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        times.append(float(done.stdout.split()[-1]))
    seconds = statistics.median(times)
    console.print(f"crosscheck new --from kuka_iiwa/model.urdf, with start-up: {seconds:.1f} s")


def robots(console: Console) -> None:
    """Print the cost of checking arms, a quadruped and humanoids, and of folders from them."""
    whole_new(console)
    table = Table("robot", "command", "result", "processor time", "memory", title="robot files")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "branches_of_30.urdf"
        file.write_text(branches(30))
        _rows(table, file.name, file, floating=False)
        for package, name, floating in ROBOTS:
            spec = find_spec(package)
            if spec is None or spec.origin is None:
                console.print(f"no {name}: {package} is not installed")
                continue
            _rows(table, name, Path(spec.origin).parent / name, floating=floating)
    console.print(table)


def branches(count: int) -> str:
    """Return a URDF of hinges in branches of six, each link with products of inertia."""
    parts = ['<robot name="branches"><link name="l0"/>']
    for i in range(1, count + 1):
        parent = 0 if i % 6 == 1 else i - 1
        parts.append(
            f'<link name="l{i}"><inertial>'
            f'<origin xyz="0.1 0.02 -0.{i % 4 + 1}" rpy="0.{i % 3} 0 0"/>'
            f'<mass value="{1 + i % 5}"/><inertia ixx="0.05" iyy="0.06" izz="0.04" ixy="0.001" '
            'ixz="0.002" iyz="-0.003"/></inertial></link>'
        )
        parts.append(
            f'<joint name="j{i}" type="continuous"><parent link="l{parent}"/><child link="l{i}"/>'
            f'<origin xyz="0 0.{i % 3} -0.3"/><axis xyz="{i % 3 % 2} {int(i % 3 == 0)} '
            f'{int(i % 3 == 2)}"/><dynamics damping="0.{i % 7}"/></joint>'
        )
    return "".join([*parts, "</robot>"])


def _rows(table: Table, name: str, file: Path, *, floating: bool) -> None:
    calls = {"run": partial(run, file, floating), "new": partial(new, file)}
    for command, call in calls.items():
        spent = cost(call)
        sizes = f"{spent.seconds:.1f} s", f"{spent.memory:.0f} MiB"
        table.add_row(name, command, spent.result, *sizes)


def run(file: Path, floating: bool) -> str:
    """Derive the equations of a file, and check it in every engine that reads it."""
    prepared = prepare_tree(file, floating=floating)
    outcomes = [f"{len(prepared.names)} coordinates"]
    for engine in engines_reading(file.suffix):
        if engine.version() is not None:
            case = run_case(model_task(prepared, engine.name))
            outcomes.append(f"{engine.name} {case.outcome}")
    return ", ".join(outcomes)


def new(file: Path) -> str:
    """Write a system folder from a file."""
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "robot"
        from_model(file, target)
        return f"{len(list(target.iterdir()))} files"


if __name__ == "__main__":
    new(Path(sys.argv[1]))
    print(with_children())
