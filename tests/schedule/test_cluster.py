"""On a real cluster outcomes are those of this machine, whatever its workers suffer."""

from __future__ import annotations

import contextlib
import ctypes
import os
import re
import shutil
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

from harness.cases.prepare import Prepared, prepare
from harness.cli.main import main
from harness.records.read import read_results
from harness.records.results import Results
from harness.schedule import parcel
from harness.schedule.chosen import executor
from harness.schedule.executor import ClusterError, Executor
from harness.schedule.failure import Failure
from harness.schedule.limits import Limits
from tests.faults.known_folder import ROOT, one_scenario
from tests.schedule.clusters import Loopback, loopback

pytestmark = pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs /proc")

LIMITS = Limits(seconds=1.0, memory=1.0)


def process(_: object) -> int:
    return os.getpid()


def crash(_: object) -> None:
    os.write(2, b"about to fall\n")
    ctypes.string_at(0)


def spin(_: object) -> None:
    print("still here", flush=True)
    while True:
        pass


def fill(_: object) -> int:
    return len(bytearray(4 << 30))


def slow(number: int) -> tuple[int, int]:
    time.sleep(0.3)
    return number, os.getppid()


def nap(file: str) -> None:
    Path(file).write_text("begun")
    time.sleep(600)


def opened(file: Path) -> tuple[str, str, Path, str]:
    """What is read of a file, which is told with all its names."""
    return file.read_text(), str(file), file.resolve(), f"{file}: of {Path.cwd()}"


def refuse(file: Path) -> None:
    print(f"about {file}")
    raise ValueError(f"{file}: nothing in it")


def unsendable(_: object) -> object:
    return lambda: None


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Loopback]:
    with loopback(tmp_path_factory.mktemp("cluster"), "one", "two") as running:
        yield running


@pytest.fixture(scope="module")
def pool(cluster: Loopback) -> Iterator[Executor]:
    with executor(scheduler=cluster.address, limits=LIMITS) as running:
        yield running


@pytest.fixture
def pendulum(tmp_path: Path) -> Path:
    """One model in one engine in one scenario."""
    folder = one_scenario("simple_pendulum", tmp_path / "mine" / "pendulum", "small")
    beside = ROOT / "models" / "simple_pendulum"
    model = next(iter(sorted(beside.glob("*.xml"))))
    shutil.copy(model, folder)
    text = (beside / f"{model.name}.toml").read_text()
    text = re.sub(r"^engines = .*$", 'engines = ["mujoco"]', text, flags=re.MULTILINE)
    (folder / f"{model.name}.toml").write_text(text)
    return folder


def alike(results: Results) -> Results:
    """Without times."""
    return msgspec.structs.replace(
        results,
        created="",
        seconds=0.0,
        systems=tuple(msgspec.structs.replace(s, seconds=0.0) for s in results.systems),
        cases=tuple(msgspec.structs.replace(c, seconds=0.0) for c in results.cases),
    )


def test_a_run_has_the_records_of_a_local_one(
    cluster: Loopback, pendulum: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(pendulum.parent)
    given = ["run", "pendulum", "--alone", "--engine", "mujoco", "-q"]
    assert main([*given, "--out", "here", "--jobs", "1"]) == 0
    assert main([*given, "--out", "there", "--scheduler", cluster.address]) == 0
    here, there = (read_results(Path(out, "results.json")) for out in ("here", "there"))
    assert len(here.cases) == 1
    assert msgspec.to_builtins(alike(there)) == msgspec.to_builtins(alike(here))
