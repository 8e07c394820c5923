"""What robots' files alone cost: processor seconds and memory of the work of each step."""

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
    """Of a piece of work in a process of its own: processor seconds, MiB, and what it told."""

    seconds: float
    memory: float
    told: str


def cost(work: Callable[[], str]) -> Cost:
    """Do it in a fork of this process, so that its memory is its own."""
    here, there = multiprocessing.Pipe(duplex=False)
    context = multiprocessing.get_context("fork")
    child = context.Process(target=_measured, args=(work, there))
    child.start()
    found: Cost = here.recv()
    child.join()
    return found


def _measured(work: Callable[[], str], answer: Connection) -> None:
    began = time.process_time()
    try:
        told = work()
    except Exception as error:
        told = str(error).rpartition(": ")[2]
    used = resource.getrusage(resource.RUSAGE_SELF)
    answer.send(Cost(time.process_time() - began, used.ru_maxrss / 1024, told))


def with_children() -> float:
    """Processor seconds of this process and of those below it that live, or that these awaited."""
    tick = os.sysconf("SC_CLK_TCK")
    found = time.process_time()
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            words = stat.read_text().rpartition(")")[2].split()
            if int(words[1]) == os.getpid():
                found += sum(map(int, words[11:15])) / tick
    return found


def whole_new(console: Console) -> None:
    """`crosscheck new --from` of an arm of seven joints: Python's starts and workers included."""
    found = find_spec("pybullet_data")
    if found is None or found.origin is None:
        return
    file = Path(found.origin).parent / "kuka_iiwa" / "model.urdf"
    times = []
    for _ in range(3):
        done = subprocess.run(
            [sys.executable, "-m", "benchmarks.bench_robots", str(file)],
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        times.append(float(done.stdout.split()[-1]))
    seconds = statistics.median(times)
    console.print(f"crosscheck new --from kuka_iiwa/model.urdf, all of it: {seconds:.1f} s")


def robots(console: Console) -> None:
    """Equations, every engine, a new folder: of arms, a quadruped and humanoids."""
    whole_new(console)
    table = Table("robot", "what", "told", "work", "memory", title="robots' files alone")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "branches_of_30.urdf"
        file.write_text(branches(30))
        _rows(table, file.name, file, floating=False)
        for package, name, floating in ROBOTS:
            found = find_spec(package)
            if found is None or found.origin is None:
                console.print(f"no {name}: {package} is not installed")
                continue
            _rows(table, name, Path(found.origin).parent / name, floating=floating)
    console.print(table)


def branches(count: int) -> str:
    """A URDF of so many hinges, in branches of six, each link with products of inertia."""
    parts = ['<robot name="branches"><link name="l0"/>']
    for i in range(1, count + 1):
        parent = 0 if i % 6 == 1 else i - 1
        parts.append(
            f'<link name="l{i}"><inertial>'
            f'<origin xyz="0.1 0.02 -0.{i % 4 + 1}" rpy="0.{i % 3} 0 0"/>'
            f'<mass value="{1 + i % 5}"/><inertia ixx="0.05" iyy="0.06" izz="0.04" ixy="0.001" '
            'ixz="0.002" iyz="-0.003"/></inertial></link>'
            f'<joint name="j{i}" type="continuous"><parent link="l{parent}"/><child link="l{i}"/>'
            f'<origin xyz="0 0.{i % 3} -0.3"/><axis xyz="{i % 3 % 2} {int(i % 3 == 0)} '
            f'{int(i % 3 == 2)}"/><dynamics damping="0.{i % 7}"/></joint>'
        )
    return "".join([*parts, "</robot>"])


def _rows(table: Table, name: str, file: Path, *, floating: bool) -> None:
    works = {"run": partial(run, file, floating), "new": partial(new, file)}
    for what, work in works.items():
        one = cost(work)
        table.add_row(name, what, one.told, f"{one.seconds:.1f} s", f"{one.memory:.0f} MiB")


def run(file: Path, floating: bool) -> str:
    """The file's equations, and it in every engine."""
    prepared = prepare_tree(file, floating=floating)
    told = [f"{len(prepared.names)} coordinates"]
    for engine in engines_reading(file.suffix):
        if engine.version() is not None:
            case = run_case(model_task(prepared, engine.name))
            told.append(f"{engine.name} {case.outcome}")
    return ", ".join(told)


def new(file: Path) -> str:
    """A folder from the file."""
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "robot"
        from_model(file, target)
        return f"{len(list(target.iterdir()))} files"


if __name__ == "__main__":
    new(Path(sys.argv[1]))
    print(with_children())
