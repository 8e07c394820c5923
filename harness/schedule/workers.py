"""Persistent worker processes: one task at a time each, with a time limit, and replaceable.

A worker that crashes, hangs or blows up is killed and replaced; the tasks beside it and after it
go on (pebble's pool; a ProcessPoolExecutor would lose every pending task to one segfault).
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass, replace
from multiprocessing import forkserver
from pathlib import Path
from types import TracebackType
from typing import TypeVar

import pebble

import physics_crosscheck

LIMIT = 120.0
"""Seconds that a task may take unless told otherwise."""

MOST_PRINTED = 4000

Argument = TypeVar("Argument")
Value = TypeVar("Value")


@dataclass(frozen=True)
class Failure:
    """Why a task has no value: one sentence, and what was printed meanwhile.

    Attributes:
        usage: whether what was asked makes no sense, rather than something having gone wrong.
    """

    reason: str
    stdout: str
    usage: bool = False


class Workers:
    """A pool of worker processes; use it as a context manager."""

    def __init__(self, jobs: int, limit: float = LIMIT) -> None:
        methods = multiprocessing.get_all_start_methods()
        method = "forkserver" if "forkserver" in methods else "spawn"
        context = multiprocessing.get_context(method)
        if method == "forkserver":
            # First what binds our names: the server begins in the user's folder, which may have a
            # package called harness.
            context.set_forkserver_preload(
                ["physics_crosscheck", "harness.cases.case", "harness.cases.prepare"]
            )
            with _safe_path():
                forkserver.ensure_running()
        self._limit = limit
        self._jobs = jobs
        self._pool = pebble.ProcessPool(
            max_workers=jobs, context=context, initializer=physics_crosscheck.claim
        )
        self._logs = Path(tempfile.mkdtemp(prefix="crosscheck-"))
        self._count = 0

    def _settle(self) -> None:
        """Wait until every worker has started: one that is closed before complains on stderr."""
        if self._count == 0 or self._count > 4 * self._jobs:
            return
        seen: set[int] = set()
        for _ in range(20):
            naps = [self._pool.schedule(_nap, args=[0.1]) for _ in range(self._jobs)]
            with contextlib.suppress(Exception):
                seen |= {nap.result() for nap in naps}
            if len(seen) >= self._jobs:
                return

    def submit(self, function: Callable[[Argument], Value], argument: Argument) -> Future[Value]:
        """Start a task; `outcome` turns the finished future into a value or a `Failure`."""
        self._count += 1
        log = self._logs / f"{self._count}.log"
        future: Future[Value] = self._pool.schedule(
            _captured, args=[function, argument, str(log)], timeout=self._limit
        )
        future.log = log  # type: ignore[attr-defined]  # travels with the future it belongs to
        return future

    def outcome(self, future: Future[Value]) -> Value | Failure:
        """Value of a finished task, or a `Failure` that says what became of it."""
        log: Path = future.log  # type: ignore[attr-defined]  # set by submit
        try:
            value = future.result()
            return replace(value, stdout=_tail(log)) if isinstance(value, Failure) else value
        except TimeoutError:
            reason = f"it took more than the {self._limit:g} s allowed and was stopped"
        except pebble.ProcessExpired as error:
            how = _signal(error.exitcode)
            reason = f"the engine's process died ({how}); the cases beside it are not affected"
        except Exception as error:
            reason = f"{type(error).__name__}: {error}"
        return Failure(reason, _tail(log))

    def __enter__(self) -> Workers:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self._settle()
            self._pool.close()
        else:
            self._pool.stop()
        self._pool.join()
        for log in self._logs.glob("*.log"):
            log.unlink()
        self._logs.rmdir()


@contextlib.contextmanager
def _safe_path() -> Iterator[None]:
    """Processes started meanwhile don't look for modules in the working folder first.

    A user's `types.py` there, or a file called like an engine, would be taken for the real one. Not
    where this is the folder that our own packages are in.
    """
    if Path.cwd() == physics_crosscheck.BESIDE or "PYTHONSAFEPATH" in os.environ:
        yield
        return
    os.environ["PYTHONSAFEPATH"] = "1"
    try:
        yield
    finally:
        del os.environ["PYTHONSAFEPATH"]


def _nap(seconds: float) -> int:
    time.sleep(seconds)
    return os.getpid()


def _captured(
    function: Callable[[Argument], Value], argument: Argument, log: str
) -> Value | Failure:
    """Run a task with everything printed, C code included, going to a file.

    What it raises comes back as a sentence: an exception may be one that can't be sent, and a
    `sys.exit` in someone's model file would end the process that asked.
    """
    with _into(log):
        try:
            return function(argument)
        except (Exception, SystemExit) as error:
            # The worker's own errors, of these kinds, carry a sentence; anything else is told with
            # its own kind.
            ours = type(error).__module__.startswith(("harness.", "reference."))
            known = ours and isinstance(error, ValueError | RuntimeError)
            return Failure(str(error) if known else f"{type(error).__name__}: {error}", "")


@contextlib.contextmanager
def _into(log: str) -> Iterator[None]:
    sys.stdout.flush()
    sys.stderr.flush()
    kept = [os.dup(1), os.dup(2)]
    target = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    try:
        os.dup2(target, 1)
        os.dup2(target, 2)
        yield
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os.dup2(kept[0], 1)
        os.dup2(kept[1], 2)
        for descriptor in (*kept, target):
            os.close(descriptor)


def _signal(code: int) -> str:
    import signal

    if code is not None and code < 0:
        with contextlib.suppress(ValueError):
            return signal.Signals(-code).name
    return f"exit code {code}"


def _tail(log: Path) -> str:
    try:
        text = log.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
    return text.strip()[-MOST_PRINTED:]
