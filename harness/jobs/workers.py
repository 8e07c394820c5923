"""Worker processes: one task at a time each, with limits, and replaceable.

A worker that crashes, hangs or blows up is replaced; the tasks beside it and after it go on (a
`ProcessPoolExecutor` would lose every pending task to one segfault). There are no threads here, no
locks and no queues between processes: a worker has a pipe, and what is at its end is either a value
or the end of the process. So no death leaves anything locked, one with exit code 0 included.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import shutil
import signal
import tempfile
import time
import warnings
import weakref
from collections.abc import Iterator
from dataclasses import dataclass, replace
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from multiprocessing.reduction import ForkingPickler
from pathlib import Path
from typing import Any

from physics_crosscheck.harness.jobs.clock import is_waiting, processor_seconds
from physics_crosscheck.harness.jobs.environment import workers_defaults
from physics_crosscheck.harness.jobs.executor import MOMENT, Executor, Pending
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.jobs.limits import Limits
from physics_crosscheck.harness.jobs.main_module import without_main
from physics_crosscheck.harness.jobs.source import line_of_death
from physics_crosscheck.harness.jobs.stop import SIGNALS
from physics_crosscheck.harness.jobs.worker import Station, serve
from physics_crosscheck.harness.paths import IMPORT_ROOT
from physics_crosscheck.harness.records.case import CaseKind

__all__ = ["Failure", "Limits", "Pending", "Workers"]

MOST_PRINTED = 4000

_TRIES = 5
"""Times that a worker is tried to be started: a task may end the process that starts them."""

# Last what sympy imports only as it adds and simplifies.
PRELOADED = (
    "physics_crosscheck.harness.checks.case", "physics_crosscheck.harness.checks.multibody",
    "physics_crosscheck.harness.checks.audit", "physics_crosscheck.harness.diagnosis.coverage",
    "physics_crosscheck.harness.diagnosis.task", "scipy.integrate", "scipy.linalg",
    "sympy.tensor.tensor", "sympy.physics.units",
)  # fmt: skip
"""What is imported once, for all worker processes."""

_UNKNOWN = 255
"""Exit code that multiprocessing gives where the process that would have told it is gone."""

_UNAFFECTED = "other cases are not affected"

_Ended = tuple[str, CaseKind]
"""Why a task was ended, in a sentence, and the kind of that."""

_NO_MEMORY = ("bad_alloc", "Could not allocate memory", "Cannot allocate memory", "out of memory")
"""What C and C++ print before they end the process for want of memory."""


@dataclass(eq=False)
class _Worker:
    """A process, and the task that it has, since when.

    Attributes:
        orphaned: whether the process that started it is gone: its pipe alone tells of its end.
    """

    process: BaseProcess
    tasks: Connection
    station: Station
    pending: Pending[Any] | None = None
    since: float = 0.0
    used: float = 0.0
    orphaned: bool = False

    def begin(self, pending: Pending[Any]) -> None:
        """It gets a task now."""
        self.pending, self.since = pending, time.monotonic()
        self.used = processor_seconds(self.process.pid or 0)

    def overdue(self) -> _Ended | None:
        """Return why its task must end; None while it may continue.

        By the clock, and not for want of the processor; or it has had twice its share of that: it
        does not hear the signal that ends such tasks.
        """
        elapsed, limits = time.monotonic() - self.since, self.station.limits
        if self.pending is None or elapsed <= min(2 * limits.seconds, limits.wall):
            return None
        used = processor_seconds(self.process.pid or 0) - self.used
        if used > 2 * limits.seconds:
            return limits.spent, "time limit"
        if elapsed > limits.wall and is_waiting(used, elapsed):
            return limits.waited, "waiting"
        return None

    def lives_on(self) -> bool:
        """Whether it lives though its end was told: the process that started it has ended."""
        if self.process.exitcode != _UNKNOWN:
            return False
        with contextlib.suppress(OSError, AttributeError):
            return os.getpgid(self.process.pid or 0) > 0
        return False

    def printed(self) -> str:
        """The end of what the task printed."""
        try:
            with self.station.log.open("rb") as log:
                log.seek(max(0, self.station.log.stat().st_size - 4 * MOST_PRINTED))
                text = log.read().decode(errors="replace")
        except OSError:
            return ""
        return text.strip()[-MOST_PRINTED:]

    def kill(self) -> None:
        """End it, and whatever it started."""
        self.tasks.close()
        with contextlib.suppress(OSError, AttributeError):
            os.killpg(self.process.pid or 0, signal.SIGKILL)
        self.process.kill()
        self.process.join()

    def let_go(self) -> None:
        """Wait a little for one that has nothing to do: without a pipe, it ends by itself."""
        self.process.join(1.0)
        self.kill()


_IMPORTED_IN = os.getpid()
"""The process that imported this module; one forked from it has another number."""


class Workers(Executor):
    """Worker processes of this machine; use them as a context manager.

    Args:
        jobs: how many at most.
        limits: of each task.
        cwd: their working folder; None: this process's.
        wake: a pipe that ends the moment which `turn` waits; whoever reads it is another's affair.
        alone: whether they are not told of the program's main module.
    """

    def __init__(
        self,
        jobs: int,
        limits: Limits | None = None,
        *,
        cwd: Path | None = None,
        wake: Connection | None = None,
        alone: bool = False,
    ) -> None:
        super().__init__()
        self._jobs, self._limits = jobs, limits or Limits()
        self._cwd, self._wake, self._alone = cwd, wake, alone
        self._context = _context()
        self._scratch = Path(tempfile.mkdtemp(prefix="crosscheck-"))
        self._crew: list[_Worker] = []
        self._started = 0
        # At the latest when Python ends: before multiprocessing waits for the processes.
        self._end = weakref.finalize(self, _dismiss, self._crew, self._scratch)

    def begin(self) -> None:
        """Start what workers are started from, which imports while this process does."""
        if self._context.get_start_method() == "forkserver":
            from multiprocessing import forkserver  # which can't be imported where there is none

            with _as_servers_start():
                forkserver.ensure_running()

    def turn(self) -> list[Pending[Any]]:
        """Hand out tasks, wait a moment for something to happen, and return those that ended."""
        ended = list(self._hand_out())
        if not ended:
            ended = list(self._take())
        return ended

    def _hand_out(self) -> Iterator[Pending[Any]]:
        """Give waiting tasks to workers that have none; yields those that can't be sent."""
        while self._waiting:
            worker = next((one for one in self._crew if one.pending is None), None)
            if worker is None:
                if len(self._crew) >= self._jobs:
                    return
                worker = self._new()
            pending = self._waiting.popleft()
            try:
                data = ForkingPickler.dumps((pending.function, pending.argument))
            except Exception as error:
                pending.end(Failure(f"{type(error).__name__}: {error}", ""))
                yield pending
                continue
            worker.begin(pending)
            with contextlib.suppress(OSError):  # it is gone, which is seen below
                worker.tasks.send_bytes(data)

    def _new(self) -> _Worker:
        self._started += 1
        ours, theirs = self._context.Pipe()
        station = Station(
            cwd=str(self._cwd or Path.cwd()),
            scratch=self._scratch,
            log=self._scratch / f"{self._started}.log",
            trace=self._scratch / f"{self._started}.trace",
            limits=self._limits,
        )
        process = self._context.Process(target=serve, args=(theirs, station))
        with without_main() if self._alone else contextlib.nullcontext():
            _start(process)
        theirs.close()
        worker = _Worker(process, ours, station)
        self._crew.append(worker)
        return worker

    def _take(self) -> Iterator[Pending[Any]]:
        """Wait a moment; yields the tasks that ended, in the order of the workers."""
        ends: list[Connection | int] = [one.tasks for one in self._crew]
        ends += [one.process.sentinel for one in self._crew if not one.orphaned]
        ends += [] if self._wake is None else [self._wake]
        ready = wait(ends, MOMENT)
        for worker in tuple(self._crew):
            pending = worker.pending
            if worker.tasks in ready:
                self._receive(worker)
            elif worker.process.sentinel in ready:
                worker.orphaned = worker.pending is not None and worker.lives_on()
                if not worker.orphaned:
                    self._bury(worker)
            elif why := worker.overdue():
                self._bury(worker, why)
            if pending is not None and pending.ended:
                yield pending

    def _receive(self, worker: _Worker) -> None:
        """Take a value from a worker, or its death."""
        try:
            data = worker.tasks.recv_bytes()
        except (EOFError, OSError):
            worker.process.join(1.0)  # for its exit code; what lives on without a pipe is killed
            self._bury(worker)
            return
        pending, worker.pending = worker.pending, None
        assert pending is not None
        try:
            value, last = ForkingPickler.loads(data)
        except Exception as error:
            said = f"its value can't be read: {type(error).__name__}: {error}"
            value, last = Failure(said, ""), False
        if isinstance(value, Failure):
            value = replace(value, stdout=worker.printed())
        pending.end(value)
        if last or worker.orphaned:
            self._bury(worker)

    def _bury(self, worker: _Worker, why: _Ended | None = None) -> None:
        """Remove a worker that died, or is to; its task, if it has one, failed."""
        self._crew.remove(worker)
        worker.kill()
        if worker.pending is not None:
            reason, kind = why or _cause_of_death(worker)
            failure = Failure(_at(worker, reason), worker.printed(), kind=kind)
            worker.pending.end(failure)
        for file in (worker.station.log, worker.station.trace):
            file.unlink(missing_ok=True)

    def close(self) -> None:
        """End all workers, with what they are doing."""
        self._end()


def _dismiss(crew: list[_Worker], scratch: Path) -> None:
    """End workers, and remove what they left."""
    for worker in crew:
        worker.tasks.close()
    for worker in crew:
        if worker.pending is None:
            worker.let_go()
        else:
            worker.kill()
    crew.clear()
    shutil.rmtree(scratch, ignore_errors=True)


def _context() -> Any:
    """How processes are started: from a server that has imported what every task needs.

    It is started with the first of them: where all is known, nothing has to be imported. A process
    that was forked can't use the server of the one that it came from, and starts each by itself.
    """
    if os.getpid() != _IMPORTED_IN:
        return multiprocessing.get_context("spawn")
    methods = multiprocessing.get_all_start_methods()
    context = multiprocessing.get_context("forkserver" if "forkserver" in methods else "spawn")
    if "forkserver" in methods:
        context.set_forkserver_preload(list(PRELOADED))
    return context


def _start(process: BaseProcess) -> None:
    """Start a worker; where the server is gone, killed by a task perhaps, by another one.

    Raises:
        OSError: where that is of no use.
    """
    for _ in range(_TRIES):
        try:
            with _as_servers_start():
                process.start()
        except (EOFError, ConnectionError):
            time.sleep(MOMENT)  # it is about to end, which is to be seen
        else:
            return
    raise OSError("no worker process can be started: the process that starts them ends each time")


@contextlib.contextmanager
def _as_servers_start() -> Iterator[None]:
    """Meanwhile a server may be started, which hears no signal and takes no module of a user's.

    What is beside it, multiprocessing's tracker of resources, comes first: as it starts, it lets
    signals through again.
    """
    if "forkserver" in multiprocessing.get_all_start_methods():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that it had to be started again
            resource_tracker.ensure_running()
    with _safe_path(), workers_defaults(), _signals_held():
        yield


@contextlib.contextmanager
def _safe_path() -> Iterator[None]:
    """Processes started meanwhile don't look for modules in the working folder first.

    A user's `types.py` there, or a file called like an engine, would be taken for the real one. Not
    where this is the folder that our own packages are in.
    """
    if Path.cwd() == IMPORT_ROOT or "PYTHONSAFEPATH" in os.environ:
        yield
        return
    os.environ["PYTHONSAFEPATH"] = "1"
    try:
        yield
    finally:
        del os.environ["PYTHONSAFEPATH"]


@contextlib.contextmanager
def _signals_held() -> Iterator[None]:
    """Processes started meanwhile don't hear what ends programs: they end when this one does."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _cause_of_death(worker: _Worker) -> _Ended:
    """Return why a worker died, and the kind of that: a limit, or what ended it."""
    code, limits = worker.process.exitcode, worker.station.limits
    if hasattr(signal, "SIGPROF") and code == -signal.SIGPROF:
        return limits.spent, "time limit"
    if code == -signal.SIGABRT and any(words in worker.printed() for words in _NO_MEMORY):
        return limits.full, "memory limit"
    if code is not None and code >= 0 and line_of_death(worker.station.trace):
        return f"it ends the process, exit code {code}; {_UNAFFECTED}", "exit"
    kind: CaseKind = "crash" if code is None or code < 0 else "exit"
    return f"the process died ({_signal(code)}); {_UNAFFECTED}", kind


def _at(worker: _Worker, sentence: str) -> str:
    """A sentence with the line of a user's file that was being run, where that is known."""
    line = line_of_death(worker.station.trace)
    return f"{line}: {sentence}" if line else sentence


def _signal(code: int | None) -> str:
    if code is not None and code < 0:
        with contextlib.suppress(ValueError):
            return signal.Signals(-code).name
    return f"exit code {code}"
