"""On a real cluster outcomes are those of this machine, whatever its workers suffer."""

from __future__ import annotations

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

import msgspec
import pytest
from msgspec import structs

from physics_crosscheck.harness.checks.prepare import PreparedSystem, prepare, prepare_system
from physics_crosscheck.harness.extras.sweep.store import read_rows
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.jobs import payload
from physics_crosscheck.harness.jobs.chosen import executor
from physics_crosscheck.harness.jobs.executor import ClusterError, Executor
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.jobs.limits import Limits
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
    where,
)
from tests.standing import standing_only
from tests.sweep.made import swept_folder

pytestmark = pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs /proc")

LIMITS = Limits(seconds=1.0, memory=1.0)


ENGINE = ("mujoco",)
"""Whose version counts: the tests' own process may know of engines that no worker has."""

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
    """One model in one engine in one scenario."""
    folder = one_scenario("simple_pendulum", tmp_path / "mine" / "pendulum", "free")
    for name in ("robot.urdf", "robot.urdf.toml"):
        shutil.copy(ROOT / "models" / "simple_pendulum" / name, folder)
    standing_only(folder)
    return folder


def alike(value: Any) -> Any:
    """Results without times."""
    if isinstance(value, dict):
        left = {key: one for key, one in value.items() if key not in ("created", "seconds")}
        return {key: alike(one) for key, one in left.items()}
    return [alike(one) for one in value] if isinstance(value, list) else value


@pytest.mark.slow
def test_a_run_has_the_records_of_a_local_one(
    cluster: Loopback, pendulum: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(pendulum.parent)
    given = ["run", "pendulum", "--engine", "mujoco", "-q"]
    assert main([*given, "--out", "here", "--jobs", "1"]) == 0
    assert main([*given, "--out", "there", "--scheduler", cluster.address]) == 0
    here, there = (json.loads(Path(out, "results.json").read_text()) for out in ("here", "there"))
    assert len(here["cases"]) == 1
    assert alike(there) == alike(here)


@pytest.mark.slow
def test_a_sweep_has_the_rows_of_a_local_one(
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


def test_a_failure_is_told_as_on_this_machine_and_the_worker_lives_on(
    pool: Executor, cluster: Loopback
) -> None:
    tasks = (crash, spin, fill, unsendable)
    with executor(jobs=2, limits=LIMITS) as local:
        here = outcomes(local, *((task, 0) for task in tasks))
    there = outcomes(pool, *((task, 0) for task in tasks), (square, 7))
    assert all(isinstance(one, Failure) for one in here)
    assert there == [*here, 49]
    assert all(one.poll() is None for one in cluster.workers.values())


def outcomes(pool: Executor, *tasks: tuple[Any, Any]) -> list[Any]:
    asked = [pool.submit(function, argument) for function, argument in tasks]
    return [pool.outcome(one) for one in asked]


def test_tasks_read_the_copies_that_were_sent_under_the_names_that_files_have_here(
    cluster: Loopback, pendulum: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(pendulum.parent.parent)
    absolute, relative = pendulum / "system.py", Path("mine/pendulum/system.py")
    tasks: list[tuple[Any, Any]] = [
        (opened, absolute), (opened, relative), (refuse, absolute), (refuse, relative)
    ]  # fmt: skip
    with executor(jobs=1, limits=LIMITS) as local:
        here = outcomes(local, *tasks)
    mine = prepare_system(pendulum)
    beside = Path("beside.txt")
    beside.write_text("not sent")
    with executor(
        scheduler=cluster.address, files=lambda: [Path("mine/pendulum")], engines=ENGINE
    ) as pool:
        pendulum.parent.rename(pendulum.parent.with_name("gone"))
        assert outcomes(pool, *tasks) == here
        theirs = outcomes(pool, (prepare, pendulum))[0]
        missing = outcomes(pool, (opened, beside), (opened, beside.with_name("nowhere")))
    assert isinstance(theirs, PreparedSystem)
    assert theirs.place == pendulum
    assert record(theirs) == record(mine)
    # One that is here was not sent, one that is nowhere is missed as on this machine.
    assert missing[0].reason.endswith("put everything else that it reads into the folder")
    assert missing[1].reason.endswith("nowhere'")


def record(prepared: PreparedSystem) -> Any:
    return msgspec.to_builtins(msgspec.structs.replace(prepared.record, seconds=0.0))


def test_a_worker_that_joins_late_and_is_killed_costs_no_task(
    cluster: Loopback, tmp_path: Path
) -> None:
    kept = tmp_path / "kept.txt"
    kept.write_text("kept")
    with executor(scheduler=cluster.address, files=lambda: [kept], engines=ENGINE) as pool:
        assert outcomes(pool, *((slow, (str(tmp_path), number)) for number in range(4))) == [
            *range(4)
        ]
        cluster.worker("late", "--preload", str(cluster.place / "light.py"))
        doomed = cluster.workers["late"].pid
        asked: list[Any] = [pool.submit(slow, (str(tmp_path), n)) for n in range(4, 24)]
        until(lambda: pool.turn() is not None and begun_by(tmp_path) & set(below(doomed)))
        processes = below(doomed)
        cluster.kill("late")
        assert [pool.outcome(one) for one in asked] == list(range(4, 24))
        assert outcomes(pool, (opened, kept))[0][0] == "kept"
    until(lambda: not any(alive(pid) for pid in processes))


def begun_by(folder: Path) -> set[int]:
    """Who has started the processes that began a task."""
    return {int(one.read_text() or 0) for one in folder.iterdir() if one.name.isdigit()}


def alive(pid: int) -> bool:
    with contextlib.suppress(OSError):
        return "Z" not in Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    return False


def until(holds: Callable[[], object]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_what_is_being_done_ends_with_the_run_and_its_copies_go(
    cluster: Loopback, tmp_path: Path
) -> None:
    told, kept = tmp_path / "told", tmp_path / "kept.txt"
    kept.write_text("kept")
    with executor(scheduler=cluster.address, files=lambda: [kept], engines=ENGINE) as pool:
        copy = Path(*outcomes(pool, (where, kept))[0])
        assert copy.read_text() == "kept"
        for _ in range(9):
            pool.submit(nap, str(told))
        until(lambda: pool.turn() is not None and told.is_file() and told.read_text())
        napping = int(told.read_text())
    until(lambda: not alive(napping))
    assert not copy.exists()


def test_a_scheduler_needs_nothing_of_this_package(cluster: Loopback, pool: Executor) -> None:
    assert outcomes(pool, (square, 3)) == [9]
    import distributed

    with distributed.Client(cluster.address, set_as_default=False) as client:
        assert not client.run_on_scheduler(lambda: "physics_crosscheck" in sys.modules)


@pytest.mark.slow
def test_a_scheduler_that_is_lost_is_told_and_what_is_done_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed", reason="needs physics-crosscheck[cluster]")
    monkeypatch.setattr("physics_crosscheck.harness.jobs.cluster.ANSWER", 3.0)
    begun = tmp_path / "begun"
    with loopback(tmp_path) as own, executor(scheduler=own.address, engines=ENGINE) as pool:
        pool.submit(nap, str(begun))
        until(lambda: pool.turn() is not None and begun.is_file())
        os.kill(own.scheduler, signal.SIGKILL)
        with pytest.raises(ClusterError, match="finished cases are kept"):
            until(pool.turn)


def test_a_new_worker_that_differs_is_told_with_what_differs(
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
    said = capsys.readouterr().err
    assert re.search(
        r"tcp://\S+ has physics-crosscheck's files \w+ \(here \w+\), so its results", said
    )
    assert "install the same version there" in said
    assert "Traceback" not in said


def test_a_worker_without_the_package_is_told(
    cluster: Loopback, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "physics_crosscheck.py").write_text("raise ImportError('nothing of that name')\n")
    cluster.worker("bare", "--no-nanny", PYTHONPATH=str(tmp_path))
    try:
        assert main([*RUN, "--scheduler", cluster.address]) == 2
    finally:
        cluster.kill("bare")
    said = capsys.readouterr().err
    assert "can't import physics-crosscheck (nothing of that name): install it there" in said


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "127.0.0.1:9", "nothing://there", "?"])
def test_an_address_where_no_scheduler_answers_is_told(
    address: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("distributed", reason="needs physics-crosscheck[cluster]")
    monkeypatch.setattr("physics_crosscheck.harness.jobs.cluster.ANSWER", 0.5)
    assert main(["run", "simple_pendulum", "--scheduler", address]) == 2
    said = capsys.readouterr().err
    assert f"crosscheck: --scheduler {address}: no scheduler answers there" in said
    assert "Start one with `dask scheduler`" in said


def test_without_the_extra_its_name_is_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    monkeypatch.delitem(sys.modules, "physics_crosscheck.harness.jobs.cluster", raising=False)
    assert main(["run", "simple_pendulum", "--scheduler", "tcp://127.0.0.1:9"]) == 2
    assert "pip install 'physics-crosscheck[cluster]'" in capsys.readouterr().err


def test_nothing_of_it_is_imported_where_no_scheduler_is_asked_for() -> None:
    asked = "import sys, harness.run; sys.exit('distributed' in sys.modules)"
    subprocess.run([sys.executable, "-c", asked], check=True, env=environment())


def test_more_than_a_run_may_send_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "big.bin").write_bytes(bytes(3000))
    monkeypatch.setattr(payload, "MOST_SENT", 2000)
    with pytest.raises(payload.PayloadError, match=r"exceed .* with .*big\.bin, too much to send"):
        payload.input_files([tmp_path])
