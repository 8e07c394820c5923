"""A real scheduler and real workers on loopback, as processes of their own."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PATIENCE = 120.0


@dataclass
class Loopback:
    """A scheduler, and workers that share no working folder with it.

    Attributes:
        place: folder of logs and of the workers' folders.
        address: of the scheduler.
        workers: by name.
    """

    place: Path
    address: str = ""
    workers: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)
    _all: list[subprocess.Popen[bytes]] = field(default_factory=list)

    def start(self) -> None:
        self._start("scheduler", "scheduler", "--port", "0", "--host", "127.0.0.1")
        self.address = self._said("scheduler", r"Scheduler at:\s+(tcp://\S+)")

    def worker(self, name: str, *more: str, **environment: str) -> None:
        """One more, with the nanny that `dask worker` has by default, and one thread."""
        arguments = ("worker", self.address, "--nthreads", "1", "--name", name, *more)
        self.workers[name] = self._start(name, *arguments, **environment)
        self._said(name, r"Registered to:\s+(tcp://\S+)")

    def kill(self, name: str) -> None:
        """Kill a worker without a warning, its nanny first, which would start it again."""
        nanny = self.workers.pop(name)
        below = children(nanny.pid)
        os.kill(nanny.pid, signal.SIGKILL)
        for pid in below:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        nanny.wait()

    @property
    def scheduler(self) -> int:
        """Its process."""
        return self._all[0].pid

    def log(self, name: str) -> str:
        return (self.place / f"{name}.log").read_text(errors="replace")

    def close(self) -> None:
        for process in reversed(self._all):
            process.terminate()
        for process in reversed(self._all):
            try:
                process.wait(20.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def _start(self, name: str, *arguments: str, **environment: str) -> subprocess.Popen[bytes]:
        folder = self.place / f"{name}_folder"
        folder.mkdir(parents=True)
        with (self.place / f"{name}.log").open("wb") as log:
            process = subprocess.Popen(
                [sys.executable, "-m", "dask", *arguments, "--no-dashboard"],
                cwd=folder,
                stdout=log,
                stderr=log,
                env=os.environ | {"PYTHONPATH": str(ROOT), "PYTHONWARNINGS": ""} | environment,
            )
        self._all.append(process)
        return process

    def _said(self, name: str, pattern: str) -> str:
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            if found := re.search(pattern, self.log(name)):
                return found[1]
            time.sleep(0.05)
        raise AssertionError(f"{name} did not start:\n{self.log(name)}")


def children(pid: int) -> list[int]:
    """Processes that any thread of a process has started."""
    found = []
    for listed in Path(f"/proc/{pid}/task").glob("*/children"):
        with contextlib.suppress(OSError):
            found += [int(one) for one in listed.read_text().split()]
    return found


def below(pid: int) -> list[int]:
    """A process, and all that were started by it."""
    return [pid, *(inner for one in children(pid) for inner in below(one))]


@contextlib.contextmanager
def loopback(place: Path, *workers: str) -> Iterator[Loopback]:
    pytest.importorskip("distributed", reason="needs physics-crosscheck[cluster]")
    cluster = Loopback(place)
    try:
        cluster.start()
        for name in workers:
            cluster.worker(name)
        yield cluster
    finally:
        cluster.close()
