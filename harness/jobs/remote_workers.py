"""Remote worker pools: a dask worker runs a run's tasks in separate processes, within their limits.

A dask worker calls `receive`, `do` and `leave`. It runs no task itself: a crash would end it, and a
thread cannot be stopped. The dask worker is a daemon child of its nanny, and multiprocessing does
not allow daemons to have children. Nothing here relies on that rule, so it is switched off.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib.metadata
import multiprocessing
import os
import pickle
import platform
import threading
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from multiprocessing.util import Finalize
from pathlib import Path
from typing import Any

from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.paths import PACKAGE, SOURCES
from .executor import MOMENT
from .failure import Failure
from .limits import Limits
from .workers import Workers

IDLE_SECONDS = 60.0
"""Seconds without a task after which the processes of a pool end; the next task starts new ones."""


@dataclass(frozen=True, kw_only=True)
class RunConfig:
    """The configuration of a run on remote workers.

    Attributes:
        run: name of the run.
        limits: limits of each task.
        cwd: working folder of the program that started the run.
        files: hashes of the files and folders that tasks read, by path.
        versions: versions installed on that machine.
        engines: engines whose versions count; empty: all that are installed there.
    """

    run: str
    limits: Limits
    cwd: str
    files: Mapping[str, str]
    versions: Mapping[str, str]
    engines: tuple[str, ...] = ()


def installed(only: tuple[str, ...] = ()) -> dict[str, str]:
    """Return the versions that affect results; skip engines that are not installed.

    Args:
        only: engines to include; empty: all.
    """
    versions = {"python": ".".join(platform.python_version_tuple()[:2])}
    for name in ("physics-crosscheck", "numpy", "scipy", "sympy", "msgspec"):
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            versions[name] = importlib.metadata.version(name)
    versions["physics-crosscheck's files"] = _sources()
    for name, engine in engines().items():
        version = engine.version() if not only or name in only else None
        if version is not None:
            versions[name] = version
    return versions


@functools.cache
def _sources() -> str:
    """Return a hash of this package's source, since two checkouts may have the same version."""
    whole = hashlib.sha256()
    for folder in SOURCES:
        for file in sorted(folder.rglob("*.py")):
            if file.is_relative_to(folder / "models"):
                continue
            whole.update(f"{file.relative_to(PACKAGE)}\0".encode())
            whole.update(file.read_bytes())
    return whole.hexdigest()[:12]


def _misfit(config: RunConfig) -> str:
    """Describe the differences between this machine's versions and the run's; "" if they agree."""
    here = installed(config.engines)
    return ", ".join(
        f"{name} {here.get(name, 'not installed')} (here {version})"
        for name, version in config.versions.items()
        if here.get(name) != version
    )


def contents(paths: Iterable[str]) -> dict[str, str]:
    """Return a hash of each file, or of all files in a folder except hidden ones and bytecode."""
    return {path: _content(Path(path)) for path in paths}


def _content(path: Path) -> str:
    whole = hashlib.sha256()
    try:
        for file in _within(path) if path.is_dir() else [path]:
            whole.update(f"{file.relative_to(path)}\0".encode(errors="surrogateescape"))
            whole.update(file.read_bytes())
    except OSError as error:
        return error.strerror or str(error)
    return whole.hexdigest()[:12]


def _within(path: Path) -> list[Path]:
    paths = []
    for folder, inner, names in os.walk(path):
        inner[:] = [name for name in inner if not (name[0] == "." or name == "__pycache__")]
        paths += [Path(folder, name) for name in names]
    return sorted(one for one in paths if one.is_file())


def _unshared(config: RunConfig) -> str:
    """Return the first path whose content differs here; "" if all are the same."""
    here = contents(config.files)
    missing = [] if Path(config.cwd).is_dir() else [config.cwd]
    return next(iter(missing + [one for one in here if here[one] != config.files[one]]), "")


_pools: dict[str, RemoteWorkerPool] = {}
_lock, _starting = threading.Lock(), threading.Lock()


class _RemoteProcess(Workers):
    """One process, for the tasks of one thread of a dask worker."""

    def _new(self) -> Any:
        with _starting:  # a start changes the state of this process for a moment
            return super()._new()


class RemoteWorkerPool:
    """The processes for a run's tasks on one machine, one for each thread that runs a task.

    Args:
        config: configuration of the run.
    """

    def __init__(self, config: RunConfig) -> None:
        self._config = config
        self._free: list[Workers] = []
        self._busy: list[Workers] = []
        self._last = time.monotonic()
        self._closed = threading.Event()
        threading.Thread(target=self._end_idle, daemon=True).start()

    def do(self, data: bytes) -> bytes | Failure | None:
        """Run a serialized task; return its serialized value, its failure, or None if the pool is
        closed.
        """
        workers = self._process()
        try:
            pending = workers.submit(done, data)
            while not (pending.ended or self._closed.is_set()):
                workers.turn()
        except Exception as error:
            workers.close()
            return Failure(f"its machine runs no tasks: {type(error).__name__}: {error}", "")
        finally:
            self._last = time.monotonic()
            self._busy.remove(workers)
        if self._closed.is_set():
            workers.close()
            return None
        self._free.append(workers)
        return pending.value

    def close(self) -> None:
        """End the processes, including running tasks."""
        self._closed.set()
        while self._busy:
            time.sleep(MOMENT / 10)
        self._dismiss()

    def _process(self) -> Workers:
        """Return a process that has no task, or a new one."""
        with _lock:
            workers = self._free.pop() if self._free else None
        if workers is None:
            folder = Path(self._config.cwd)
            workers = _RemoteProcess(1, self._config.limits, cwd=folder, hide_main=True)
        self._busy.append(workers)
        return workers

    def _dismiss(self) -> None:
        while True:
            with _lock:
                if not self._free:
                    return
                workers = self._free.pop()
            workers.close()

    def _end_idle(self) -> None:
        """End the processes whenever no task has come for a while."""
        while not self._closed.wait(IDLE_SECONDS):
            if not self._busy and time.monotonic() - self._last > IDLE_SECONDS:
                self._dismiss()


def done(data: bytes) -> bytes | Failure:
    """Run a pickled task, a function and its argument, and return its pickled value.

    Raises:
        Exception: any error of the task.
    """
    function, argument = pickle.loads(data)
    value = function(argument)
    try:
        return pickle.dumps(value, protocol=pickle.HIGHEST_PROTOCOL)
    except Exception as error:
        return Failure(f"its value can't be sent: {type(error).__name__}: {error}", "")


def receive(pickled: bytes) -> tuple[str, str]:
    """Accept a run by its pickled configuration; a repeated call has no effect.

    Returns:
        Other versions than the run's, and a path with another content; both empty if it is
        accepted.
    """
    config: RunConfig = pickle.loads(pickled)
    if (other := _misfit(config)) or (path := _unshared(config)):
        return other, "" if other else path
    with _lock:
        if config.run not in _pools:
            # multiprocessing's rule is about processes that it starts, not the present one.
            multiprocessing.current_process().daemon = False
            _pools[config.run] = RemoteWorkerPool(config)
            # Run before multiprocessing waits for children, which it does when a process ends.
            Finalize(None, leave, args=(config.run,), exitpriority=10)
    return "", ""


def do(run: str, data: bytes) -> tuple[str, bytes | Failure | None]:
    """Run a task; return this worker's address, and the value, None if it does not know the run."""
    import distributed  # an extra

    pool = _pools.get(run)
    return distributed.get_worker().address, None if pool is None else pool.do(data)


def leave(run: str) -> None:
    """End a run."""
    with _lock:
        pool = _pools.pop(run, None)
    if pool is not None:
        pool.close()
