"""A real scheduler and real workers on loopback, in separate processes, and tasks for them."""

import contextlib
import ctypes
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
LIGHT = """from physics_crosscheck.harness.jobs import workers
workers.PRELOADED = workers.PRELOADED_TO_DERIVE = ()
"""
"""Code that lets the processes of a dask worker start from a server without imports."""


@dataclass
class Loopback:
    """A scheduler, and workers that share no working folder with it."""

    place: Path
    address: str = ""
    workers: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)
    _all: list[subprocess.Popen[bytes]] = field(default_factory=list)

    def start(self) -> None:
        self._start("scheduler", "scheduler", "--port", "0", "--host", "127.0.0.1")
        self.address = self._wait_for_log("scheduler", r"Scheduler at:\s+(tcp://\S+)")

    def worker(self, name: str, *more: str, **environment: str) -> None:
        """Start a worker with one thread and the default nanny of `dask worker`."""
        options = ("--nthreads", "1", "--name", name, "--local-directory", ".")
        arguments = ("worker", self.address, *options, *more)
        self.workers[name] = self._start(name, *arguments, **environment)
        self._wait_for_log(name, r"Registered to:\s+(tcp://\S+)")

    def kill(self, name: str) -> None:
        """Kill a worker without warning, first its nanny, which would restart it."""
        _kill(self.workers.pop(name))

    @property
    def scheduler(self) -> int:
        return self._all[0].pid

    def log(self, name: str) -> str:
        return (self.place / f"{name}.log").read_text(errors="replace")

    def close(self) -> None:
        """Kill all processes, because a regular shutdown takes seconds."""
        for process in reversed(self._all):
            _kill(process)

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

    def _wait_for_log(self, name: str, pattern: str) -> str:
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            if match := re.search(pattern, self.log(name)):
                return match[1]
            time.sleep(0.05)
        raise AssertionError(f"{name} did not start:\n{self.log(name)}")


def _kill(process: subprocess.Popen[bytes]) -> None:
    """Kill a process, then its children, which then cannot be restarted."""
    started = children(process.pid)
    process.kill()
    for pid in started:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    process.wait()


def children(pid: int) -> list[int]:
    """Return the processes that any thread of a process has started."""
    pids = []
    for listed in Path(f"/proc/{pid}/task").glob("*/children"):
        with contextlib.suppress(OSError):
            pids += [int(word) for word in listed.read_text().split()]
    return pids


def below(pid: int) -> list[int]:
    return [pid, *(inner for child in children(pid) for inner in below(child))]


@contextlib.contextmanager
def loopback(place: Path) -> Iterator[Loopback]:
    """Start a scheduler with one worker without a nanny; `light.py` in `place` is preloaded."""
    pytest.importorskip("distributed", reason="needs physics-crosscheck[cluster]")
    cluster = Loopback(place)
    try:
        cluster.start()
        (place / "light.py").write_text(LIGHT)
        cluster.worker("one", "--no-nanny", "--preload", str(place / "light.py"))
        yield cluster
    finally:
        cluster.close()


def crash(_: object) -> None:
    os.write(2, b"about to fall\n")
    ctypes.string_at(0)


def spin(_: object) -> None:
    print("still here", flush=True)
    sum(iter(int, 1))


def fill(_: object) -> int:
    return len(bytearray(4 << 30))


def slow(given: tuple[str, int]) -> int:
    """Record the parent process, whose parent is the dask worker."""
    folder, number = given
    Path(folder, f"{number}").write_text(f"{os.getppid()}")
    time.sleep(0.1)
    return number


def nap(file: str) -> None:
    Path(file).write_text(f"{os.getpid()}")
    time.sleep(600)


def opened(file: Path) -> tuple[str, str, Path, str]:
    """Return the text of a file and all its names."""
    return file.read_text(), str(file), file.resolve(), f"{file}: of {Path.cwd()}"


def refuse(file: Path) -> None:
    print(f"about {file}")
    raise ValueError(f"{file}: nothing in it")


def unsendable(_: object) -> object:
    return lambda: None


def square(x: int) -> int:
    return x * x
