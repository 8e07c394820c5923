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
import queue
import shutil
import tempfile
import threading
from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import dataclass, replace
from multiprocessing.util import Finalize
from pathlib import Path
from typing import Any, cast

import msgspec

from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.jobs import payload
from physics_crosscheck.harness.jobs.executor import Pending
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.jobs.limits import Limits
from physics_crosscheck.harness.jobs.workers import Workers
from physics_crosscheck.harness.paths import PACKAGE, SOURCES

IDLE_SECONDS = 60.0
"""Seconds without a task after which the processes of a pool end; the next task starts new ones."""

_MAX_PROCESSES = 10_000
"""Upper limit for the number of processes; dask requests only as many tasks as its worker has
threads.
"""


@dataclass(frozen=True, kw_only=True)
class RunConfig:
    """The configuration of a run on remote workers.

    Attributes:
        run: name of the run.
        limits: limits of each task.
        cwd: working folder of the program that started the run.
        versions: versions installed on that machine.
        engines: engines whose versions count; empty: all that are installed there.
    """

    run: str
    limits: Limits
    cwd: str
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


_pools: dict[str, RemoteWorkerPool] = {}
_lock = threading.Lock()


class RemoteWorkerPool:
    """The processes for a run's tasks on one machine, with copies of its files.

    Args:
        root: folder for the copies.
        config: configuration of the run.
    """

    def __init__(self, root: Path, config: RunConfig) -> None:
        self._root, self._config = str(root), config
        self._requests: queue.SimpleQueue[tuple[bytes, Future[object]] | None] = queue.SimpleQueue()
        self._woken, self._wake = multiprocessing.Pipe(duplex=False)
        self._request_lock = threading.Lock()
        self._closed = False
        self._thread = threading.Thread(target=self._manage, daemon=True)
        self._thread.start()

    def do(self, data: bytes) -> bytes | Failure | None:
        """Run a serialized task; return its serialized value, its failure, or None if the pool is
        closed.
        """
        future: Future[object] = Future()
        with self._request_lock:
            if self._closed:
                return None
            self._requests.put((data, future))
            self._wake.send_bytes(b".")
        value = future.result()
        return (
            self._with_original_paths(value)
            if isinstance(value, Failure)
            else cast(bytes | None, value)
        )

    def close(self) -> None:
        """End the processes, including running tasks, and remove the copies."""
        with self._request_lock:
            if not self._closed:
                self._closed = True
                self._requests.put(None)
                self._wake.send_bytes(b".")
        self._thread.join()
        shutil.rmtree(self._root, ignore_errors=True)

    def _with_original_paths(self, failure: Failure) -> Failure:
        """Return a failure with the paths that its files have on the machine that started
        the run.
        """
        reason, stdout = (text.replace(self._root, "") for text in (failure.reason, failure.stdout))
        locations = tuple(
            msgspec.structs.replace(one, file=one.file.replace(self._root, ""))
            for one in failure.locations
        )
        return replace(failure, reason=reason, stdout=stdout, locations=locations)

    def _manage(self) -> None:
        """Start tasks until the run leaves; only this thread uses multiprocessing."""
        flying: dict[Pending[Any], Future[object]] = {}
        while not self._closed:
            request = self._next(IDLE_SECONDS)
            if request is None:
                continue
            try:
                with self._workers() as workers:
                    self._run_tasks(workers, flying, request)
            except Exception as error:
                reason = f"its machine runs no tasks: {type(error).__name__}: {error}"
                for future in flying.values():
                    future.set_result(Failure(reason, ""))
                flying.clear()
        for future in flying.values():
            future.set_result(None)
        while (request := self._next(0.0)) is not None:
            request[1].set_result(None)

    def _workers(self) -> Workers:
        cwd = Path(self._root + self._config.cwd)
        return Workers(
            _MAX_PROCESSES, self._config.limits, cwd=cwd, wake=self._woken, hide_main=True
        )

    def _next(self, seconds: float) -> tuple[bytes, Future[object]] | None:
        """Return the next task, if one arrives in time and the run has not left."""
        with contextlib.suppress(queue.Empty):
            return self._requests.get(block=seconds > 0, timeout=seconds)
        return None

    def _run_tasks(
        self,
        workers: Workers,
        flying: dict[Pending[Any], Future[object]],
        request: tuple[bytes, Future[object]] | None,
    ) -> None:
        """Run this task and the following ones, until none arrives for a while."""
        while True:
            while request is not None:
                data, future = request
                flying[workers.submit(payload.done, (data, self._root))] = future
                request = self._next(0.0)
            if self._closed:
                return
            if not flying:
                request = self._next(IDLE_SECONDS)
                if request is None:
                    return
                continue
            while self._woken.poll():
                self._woken.recv_bytes()
            for pending in workers.turn():
                flying.pop(pending).set_result(pending.value)
            request = self._next(0.0)


def receive(pickled: bytes, temporary: str) -> str:
    """Accept a run; a repeated call has no effect.

    Args:
        pickled: pickled configuration and copies of the files.
        temporary: folder for temporary files.

    Returns:
        The differences between the versions; empty if they agree, and the run is accepted.
    """
    config, packet = cast(tuple[RunConfig, bytes], pickle.loads(pickled))
    if other := _misfit(config):
        return other
    with _lock:
        if config.run not in _pools:
            root = Path(tempfile.mkdtemp(prefix="crosscheck-", dir=temporary)).resolve()
            payload.extract(packet, root)
            (root / config.cwd.lstrip(os.sep)).mkdir(parents=True, exist_ok=True)
            # multiprocessing's rule is about processes that it starts, not the present one.
            multiprocessing.current_process().daemon = False
            _pools[config.run] = RemoteWorkerPool(root, config)
            # Run before multiprocessing waits for children, which it does when a process ends.
            Finalize(None, leave, args=(config.run,), exitpriority=10)
    return ""


def do(run: str, data: bytes) -> bytes | Failure | None:
    """Run a task; return None if this worker does not know the run."""
    pool = _pools.get(run)
    return None if pool is None else pool.do(data)


def leave(run: str) -> None:
    """End a run."""
    with _lock:
        pool = _pools.pop(run, None)
    if pool is not None:
        pool.close()
