"""Runs on a real cluster: results equal local ones, even if workers fail."""

import contextlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from msgspec import structs

from physics_crosscheck.harness.extras.sweep.store import read_rows
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.jobs import remote_workers
from physics_crosscheck.harness.jobs.chosen import executor
from physics_crosscheck.harness.jobs.executor import ClusterError, Executor
from physics_crosscheck.harness.jobs.workers import Failure, Limits
from physics_crosscheck.harness.records.sweep import SweepRow
from tests.faults.known_folder import ROOT, environment, one_scenario
from tests.schedule.clusters import (
    PATIENCE,
    Loopback,
    below,
    crash,
    fill,
    loopback,
    nap,
    opened,
    refuse,
    slow,
    spin,
    square,
    unsendable,
)
from tests.standing import keep_default_engines
from tests.sweep.made import swept_folder

pytestmark = pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs /proc")

LIMITS = Limits(seconds=1.0, memory=1.0)


ENGINE = ("mujoco",)
"""Engines of which versions are compared: this process may know engines that no worker has."""

RUN = ("run", "simple_pendulum", "--engine", *ENGINE)

CLOCKED = {name: 0.0 for name in SweepRow.__struct_fields__ if name.endswith("seconds")}


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Loopback]:
    with loopback(tmp_path_factory.mktemp("cluster")) as running:
        yield running


@pytest.fixture(scope="module")
def pool(cluster: Loopback) -> Iterator[Executor]:
    with executor(scheduler=cluster.address, limits=LIMITS, engines=ENGINE) as running:
        yield running


@pytest.fixture
def pendulum(tmp_path: Path) -> Path:
    """Create a folder with one model, one engine and one scenario."""
    folder = one_scenario("simple_pendulum", tmp_path / "mine" / "pendulum", "free")
    for name in ("robot.urdf", "robot.urdf.toml"):
        shutil.copy(ROOT / "models" / "simple_pendulum" / name, folder)
    keep_default_engines(folder)
    return folder


def without_times(value: Any) -> Any:
    if isinstance(value, dict):
        rest = {key: item for key, item in value.items() if key not in ("created", "seconds")}
        return {key: without_times(item) for key, item in rest.items()}
    return [without_times(item) for item in value] if isinstance(value, list) else value


@pytest.mark.slow
def test_run_equals_a_local_run(
    cluster: Loopback, pendulum: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(pendulum.parent)
    given = ["run", "pendulum", "--engine", "mujoco", "-q"]
    assert main([*given, "--out", "here", "--jobs", "1"]) == 0
    assert main([*given, "--out", "there", "--scheduler", cluster.address]) == 0
    here, there = (json.loads(Path(out, "results.json").read_text()) for out in ("here", "there"))
    assert len(here["cases"]) == 1
    assert without_times(there) == without_times(here)


@pytest.mark.slow
def test_sweep_equals_a_local_sweep(
    cluster: Loopback, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("pyarrow")
    monkeypatch.chdir(tmp_path)
    swept_folder(tmp_path / "mass", "mujoco.xml")
    given = ["sweep", "mass", "--vary", "k=20:200:log", "--draws", "2", "--engine", "mujoco"]
    assert main([*given, "--out", "here"]) == 0
    assert main([*given, "--out", "there", "--scheduler", cluster.address]) == 0
    here, there = (
        {row.index: structs.replace(row, **CLOCKED) for row in read_rows(Path(out))}
        for out in ("here", "there")
    )
    assert len(here) == 2
    assert there == here


def test_failures_are_reported_as_locally_and_workers_survive(
    pool: Executor, cluster: Loopback
) -> None:
    tasks = (crash, spin, fill, unsendable)
    with executor(jobs=2, limits=LIMITS) as local:
        here = outcomes(local, *((task, 0) for task in tasks))
    there = outcomes(pool, *((task, 0) for task in tasks), (square, 7))
    assert all(isinstance(failure, Failure) for failure in here)
    assert there == [*here, 49]
    assert all(worker.poll() is None for worker in cluster.workers.values())


def outcomes(pool: Executor, *tasks: tuple[Any, Any]) -> list[Any]:
    pending = [pool.submit(function, argument) for function, argument in tasks]
    return [pool.outcome(task) for task in pending]


def test_tasks_read_shared_files_under_local_names(
    cluster: Loopback, pendulum: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(pendulum.parent.parent)
    absolute, relative = pendulum / "system.py", Path("mine/pendulum/system.py")
    tasks: list[tuple[Any, Any]] = [
        (opened, absolute), (opened, relative), (refuse, absolute), (refuse, relative)
    ]  # fmt: skip
    with executor(jobs=1, limits=LIMITS) as local:
        here = outcomes(local, *tasks)
    with executor(
        scheduler=cluster.address, files=lambda: [Path("mine/pendulum")], engines=ENGINE
    ) as pool:
        assert outcomes(pool, *tasks) == here


def test_worker_that_sees_other_files_is_rejected(
    cluster: Loopback, pendulum: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = remote_workers.contents([str(pendulum)])
    (pendulum / "system.py").write_text("# edited on one machine\n")
    contents = "physics_crosscheck.harness.jobs.cluster.contents"
    for there in (seen, {str(pendulum / "nowhere"): "0123456789ab"}):
        monkeypatch.setattr(contents, lambda _, there=there: there)
        refused = pytest.raises(ClusterError, match=f"does not see {next(iter(there))} as it is")
        with refused, executor(scheduler=cluster.address, engines=ENGINE):
            raise AssertionError("the run was taken")


def test_killed_worker_loses_no_task(cluster: Loopback, tmp_path: Path) -> None:
    sent = tmp_path / "kept.txt"
    sent.write_text("kept")
    with executor(scheduler=cluster.address, files=lambda: [sent], engines=ENGINE) as pool:
        assert outcomes(pool, *((slow, (str(tmp_path), number)) for number in range(4))) == [
            *range(4)
        ]
        cluster.worker("late", "--preload", str(cluster.place / "light.py"))
        doomed = cluster.workers["late"].pid
        pending: list[Any] = [pool.submit(slow, (str(tmp_path), n)) for n in range(4, 24)]
        until(lambda: pool.turn() is not None and starters(tmp_path) & set(below(doomed)))
        processes = below(doomed)
        cluster.kill("late")
        assert [pool.outcome(task) for task in pending] == list(range(4, 24))
        assert outcomes(pool, (opened, sent))[0][0] == "kept"
    until(lambda: not any(alive(pid) for pid in processes))


def starters(folder: Path) -> set[int]:
    """Return the parents of the processes that began a task."""
    return {int(file.read_text() or 0) for file in folder.iterdir() if file.name.isdigit()}


def alive(pid: int) -> bool:
    with contextlib.suppress(OSError):
        return "Z" not in Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    return False


def until(holds: Callable[[], object]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_running_tasks_end_with_the_run(cluster: Loopback, tmp_path: Path) -> None:
    pid_file = tmp_path / "pid"
    with executor(scheduler=cluster.address, engines=ENGINE) as pool:
        for _ in range(9):
            pool.submit(nap, str(pid_file))
        until(lambda: pool.turn() is not None and pid_file.is_file() and pid_file.read_text())
        napping = int(pid_file.read_text())
    until(lambda: not alive(napping))


def test_scheduler_does_not_import_this_package(cluster: Loopback, pool: Executor) -> None:
    assert outcomes(pool, (square, 3)) == [9]
    import distributed

    with distributed.Client(cluster.address, set_as_default=False) as client:
        assert not client.run_on_scheduler(lambda: "physics_crosscheck" in sys.modules)


@pytest.mark.slow
def test_lost_scheduler_is_reported_and_finished_cases_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed", reason="needs physics-crosscheck[cluster]")
    monkeypatch.setattr("physics_crosscheck.harness.jobs.cluster.ANSWER", 3.0)
    pid_file = tmp_path / "begun"
    with loopback(tmp_path) as running, executor(scheduler=running.address, engines=ENGINE) as pool:
        pool.submit(nap, str(pid_file))
        until(lambda: pool.turn() is not None and pid_file.is_file())
        os.kill(running.scheduler, signal.SIGKILL)
        with pytest.raises(ClusterError, match="reuses finished cases"):
            until(pool.turn)


def test_worker_with_another_version_is_rejected(
    cluster: Loopback, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / "checkout"
    name = "physics_crosscheck"
    shutil.copytree(ROOT / name, other / name, ignore=shutil.ignore_patterns("__pycache__"))
    with (other / name / "reference" / "mechanism" / "real.py").open("a") as file:
        file.write("# another\n")
    cluster.worker("other", "--no-nanny", PYTHONPATH=str(other))
    try:
        assert main([*RUN, "--scheduler", cluster.address]) == 2
    finally:
        cluster.kill("other")
    message = capsys.readouterr().err
    assert re.search(
        r"tcp://\S+ has physics-crosscheck's files \w+ \(here \w+\), so its results", message
    )
    assert "install the same version there" in message
    assert "Traceback" not in message


def test_worker_without_the_package_is_rejected(
    cluster: Loopback, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "physics_crosscheck.py").write_text("raise ImportError('nothing of that name')\n")
    cluster.worker("bare", "--no-nanny", PYTHONPATH=str(tmp_path))
    try:
        assert main([*RUN, "--scheduler", cluster.address]) == 2
    finally:
        cluster.kill("bare")
    message = capsys.readouterr().err
    assert "can't import physics-crosscheck (nothing of that name): install it there" in message


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "127.0.0.1:9", "nothing://there", "?"])
def test_unreachable_scheduler_is_reported(
    address: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("distributed", reason="needs physics-crosscheck[cluster]")
    monkeypatch.setattr("physics_crosscheck.harness.jobs.cluster.ANSWER", 0.5)
    assert main(["run", "simple_pendulum", "--scheduler", address]) == 2
    message = capsys.readouterr().err
    assert f"crosscheck: --scheduler {address}: no scheduler answers there" in message
    assert "Start one with `dask scheduler`" in message


def test_missing_extra_is_reported(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    monkeypatch.delitem(sys.modules, "physics_crosscheck.harness.jobs.cluster", raising=False)
    assert main(["run", "simple_pendulum", "--scheduler", "tcp://127.0.0.1:9"]) == 2
    assert "pip install 'physics-crosscheck[cluster]'" in capsys.readouterr().err


def test_distributed_is_not_imported_without_a_scheduler() -> None:
    code = "import sys, harness.run; sys.exit('distributed' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, env=environment())
