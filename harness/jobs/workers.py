"""Worker processes: one task at a time each, with limits, and replaceable.

A worker that crashes, hangs or exceeds its memory is replaced; other tasks continue. A
`ProcessPoolExecutor` would lose every pending task to one segfault. There are no threads, locks or
queues between processes. A worker has a pipe, which delivers a value or the end of the process. So
no death leaves a lock behind, not even one with exit code 0.
"""

import contextlib
import multiprocessing
import os
import shutil
import signal
import subprocess
import tempfile
import time
import warnings
import weakref
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice, product
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from multiprocessing.reduction import ForkingPickler
from pathlib import Path
from typing import Any

from physics_crosscheck.harness.paths import IMPORT_ROOT
from physics_crosscheck.harness.records.case import CaseKind
from .environment import without_main, workers_defaults
from .executor import MOMENT, Executor, Pending
from .failure import Failure, line_of_death
from .limits import Limits
from .stop import SIGNALS
from .worker import WorkerConfig, serve

__all__ = ["Failure", "Limits", "Pending", "Workers"]

MOST_PRINTED = 4000

_TRIES = 5
"""Number of attempts to start a worker, since a task may end the process that starts them."""

PRELOADED = (
    "physics_crosscheck.harness.planning.tasks", "physics_crosscheck.harness.engines.preloaded",
    "scipy.integrate", "scipy.linalg", "sympy.tensor.tensor", "sympy.codegen.ast",
)  # fmt: skip
"""Modules that are imported once for all worker processes."""

PRELOADED_TO_DERIVE = "sympy.physics.units", "sympy.assumptions.wrapper", "sympy.sets.setexpr"
"""Modules that sympy imports only when it adds and simplifies, as for energies."""

_UNKNOWN = 255
"""Exit code from multiprocessing if the process that should report it is gone."""

MOST_SEEN = 200
"""Number of waiting tasks among which a worker looks for one with its last subject."""

_UNAFFECTED = "other cases are not affected"

_Ended = tuple[str, CaseKind]
"""Sentence and kind of the reason for ending a task."""

_NO_MEMORY = ("bad_alloc", "Could not allocate memory", "Cannot allocate memory", "out of memory")
"""Messages of C and C++ before a process ends for lack of memory."""


@dataclass(eq=False)
class _Worker:
    """A process with its task and the start time of the task."""

    process: BaseProcess
    tasks: Connection
    config: WorkerConfig
    pending: Pending[Any] | None = None
    since: float = 0.0
    used: float = 0.0
    subject: str = ""
    orphaned: bool = False

    def begin(self, pending: Pending[Any]) -> None:
        """Start a task now."""
        self.pending, self.since, self.subject = pending, time.monotonic(), pending.subject
        self.used = processor_seconds(self.process.pid or 0)

    def overdue(self) -> _Ended | None:
        """Return why its task must end; None while it may continue.

        The elapsed time counts only if the task is not waiting for the processor. Twice its
        processor time ends it too, since it then ignores the signal that ends such tasks.
        """
        elapsed, limits = time.monotonic() - self.since, self.config.limits
        if self.pending is None or elapsed <= min(2 * limits.seconds, limits.wall):
            return None
        used = processor_seconds(self.process.pid or 0) - self.used
        if used > 2 * limits.seconds:
            return limits.spent, "time limit"
        if elapsed > limits.wall and is_waiting(used, elapsed):
            return limits.waited, "waiting"
        return None

    def lives_on(self) -> bool:
        """Return whether it runs although its end was reported: the process that started it has
        ended.
        """
        if self.process.exitcode != _UNKNOWN:
            return False
        with contextlib.suppress(OSError, AttributeError):
            return os.getpgid(self.process.pid or 0) > 0
        return False

    def printed(self) -> str:
        """Return the end of the task's printed output."""
        try:
            with self.config.log.open("rb") as log:
                log.seek(max(0, self.config.log.stat().st_size - 4 * MOST_PRINTED))
                text = log.read().decode(errors="replace")
        except OSError:
            return ""
        return text.strip()[-MOST_PRINTED:]

    def kill(self) -> None:
        """End it, with all its child processes."""
        self.tasks.close()
        with contextlib.suppress(OSError, AttributeError):
            os.killpg(self.process.pid or 0, signal.SIGKILL)
        self.process.kill()
        self.process.join()

    def let_go(self) -> None:
        """Wait briefly for an idle worker, which ends by itself without a pipe."""
        self.process.join(1.0)
        self.kill()


_IMPORTED_IN = os.getpid()
"""Process that imported this module; a forked process has another number."""


class Workers(Executor):
    """The worker processes of this machine; use it as a context manager.

    Args:
        jobs: maximum number of workers.
        limits: limits of each task.
        cwd: working folder; None: that of this process.
        hide_main: whether to hide the program's main module from them.
        derives: whether tasks derive equations from energies.
    """

    def __init__(
        self,
        jobs: int,
        limits: Limits | None = None,
        *,
        cwd: Path | None = None,
        hide_main: bool = False,
        derives: bool = True,
    ) -> None:
        super().__init__()
        self._jobs, self._limits = jobs, limits or Limits()
        self._cwd, self._hide_main = cwd, hide_main
        self._context = _context(derives)
        self._scratch = Path(tempfile.mkdtemp(prefix="crosscheck-"))
        self._running: list[_Worker] = []
        self._started = 0
        # At the latest when Python ends, before multiprocessing waits for the processes.
        self._end = weakref.finalize(self, _dismiss, self._running, self._scratch)

    def begin(self) -> None:
        """Start the server process, which imports modules while this process continues."""
        if self._context.get_start_method() == "forkserver":
            from multiprocessing import forkserver  # missing where there is no fork server

            with _as_servers_start():
                forkserver.ensure_running()

    def turn(self) -> list[Pending[Any]]:
        """Start tasks, wait briefly for an event, and return the tasks that ended."""
        ended = list(self._hand_out())
        if not ended:
            ended = list(self._take())
        return ended

    def _hand_out(self) -> Iterator[Pending[Any]]:
        """Give waiting tasks to idle workers; yield those that cannot be sent."""
        while (chosen := self._chosen()) is not None:
            pending, worker = chosen
            self._waiting.remove(pending)
            try:
                data = ForkingPickler.dumps((pending.function, pending.argument))
            except Exception as error:
                pending.end(Failure(f"{type(error).__name__}: {error}", ""))
                yield pending
                continue
            worker.begin(pending)
            with contextlib.suppress(OSError):  # the worker is gone; detected below
                worker.tasks.send_bytes(data)

    def _chosen(self) -> tuple[Pending[Any], _Worker] | None:
        """Return a waiting task and an idle worker, if possible the one with the task's subject.

        A task waits while another one of its subject runs, since that process keeps what it needs.
        """
        busy = {one.subject for one in self._running if one.pending is not None} - {""}
        tasks = [one for one in islice(self._waiting, MOST_SEEN) if one.subject not in busy]
        free = [one for one in self._running if one.pending is None]
        if not tasks or not (free or len(self._running) < self._jobs):
            return None
        pairs: list[tuple[Pending[Any], _Worker]] = [*product(tasks, free or [self._new()])]
        alike = (pair for pair in pairs if pair[0].subject == pair[1].subject != "")
        return next(alike, pairs[0])

    def _new(self) -> _Worker:
        self._started += 1
        ours, theirs = self._context.Pipe()
        config = WorkerConfig(
            cwd=str(self._cwd or Path.cwd()),
            scratch=self._scratch,
            log=self._scratch / f"{self._started}.log",
            trace=self._scratch / f"{self._started}.trace",
            limits=self._limits,
        )
        process = self._context.Process(target=serve, args=(theirs, config))
        with without_main() if self._hide_main else contextlib.nullcontext():
            _start(process)
        theirs.close()
        worker = _Worker(process, ours, config)
        self._running.append(worker)
        return worker

    def _take(self) -> Iterator[Pending[Any]]:
        """Wait briefly; yield the tasks that ended, in the order of the workers."""
        ends: list[Connection | int] = [one.tasks for one in self._running]
        ends += [one.process.sentinel for one in self._running if not one.orphaned]
        ready = wait(ends, MOMENT)
        for worker in tuple(self._running):
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
        """Receive a value from a worker, or detect its end."""
        try:
            data = worker.tasks.recv_bytes()
        except (EOFError, OSError):
            worker.process.join(1.0)  # for its exit code; kill it if it lives on
            self._bury(worker)
            return
        pending, worker.pending = worker.pending, None
        assert pending is not None
        try:
            value, last = ForkingPickler.loads(data)
        except Exception as error:
            message = f"its value can't be read: {type(error).__name__}: {error}"
            value, last = Failure(message, ""), False
        if isinstance(value, Failure):
            value = replace(value, stdout=worker.printed())
        pending.end(value)
        if last or worker.orphaned:
            self._bury(worker)

    def _bury(self, worker: _Worker, why: _Ended | None = None) -> None:
        """Remove a worker that died or must end; its task, if any, fails."""
        self._running.remove(worker)
        worker.kill()
        if worker.pending is not None:
            reason, kind = why or _cause_of_death(worker)
            failure = Failure(_with_line(worker, reason), worker.printed(), kind=kind)
            worker.pending.end(failure)
        for file in (worker.config.log, worker.config.trace):
            file.unlink(missing_ok=True)

    def close(self) -> None:
        """End all workers, including running tasks."""
        self._end()


def _dismiss(workers: list[_Worker], scratch: Path) -> None:
    """End workers, and remove their files."""
    for worker in workers:
        worker.tasks.close()
    for worker in workers:
        if worker.pending is None:
            worker.let_go()
        else:
            worker.kill()
    workers.clear()
    shutil.rmtree(scratch, ignore_errors=True)


def _context(derives: bool) -> Any:
    """Return how processes start: from a server that has imported the modules of every task.

    The server starts with the first process, so nothing is imported if all results are cached. A
    forked process cannot use the server of its parent, and starts each worker directly.
    """
    if os.getpid() != _IMPORTED_IN:
        return multiprocessing.get_context("spawn")
    methods = multiprocessing.get_all_start_methods()
    context = multiprocessing.get_context("forkserver" if "forkserver" in methods else "spawn")
    if "forkserver" in methods:
        more = PRELOADED_TO_DERIVE if derives else ()
        context.set_forkserver_preload([*PRELOADED, *more])
    return context


def _start(process: BaseProcess) -> None:
    """Start a worker; start another server if a task killed the present one.

    Raises:
        OSError: if that fails too.
    """
    for _ in range(_TRIES):
        try:
            with _as_servers_start():
                process.start()
        except (EOFError, ConnectionError):
            time.sleep(MOMENT)  # let its end become visible
        else:
            return
    raise OSError("no worker process can be started: the process that starts them ends each time")


@contextlib.contextmanager
def _as_servers_start() -> Iterator[None]:
    """Allow the start of a server that ignores signals and imports no modules of the user.

    multiprocessing's resource tracker starts first, since its start unblocks the signals again.
    """
    if "forkserver" in multiprocessing.get_all_start_methods():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # ignore that it had to be started again
            resource_tracker.ensure_running()
    with _safe_path(), workers_defaults(), _signals_held():
        yield


@contextlib.contextmanager
def _safe_path() -> Iterator[None]:
    """Remove the working folder from the module path of processes that start meanwhile.

    A user's `types.py` there, or a file named like an engine, would replace the real module. Keep
    the folder if it contains our own packages.
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
    """Block terminating signals in processes that start meanwhile: they end with this process."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _cause_of_death(worker: _Worker) -> _Ended:
    """Return why a worker died, and the kind of the reason: a limit, or another cause."""
    code, limits = worker.process.exitcode, worker.config.limits
    if hasattr(signal, "SIGPROF") and code == -signal.SIGPROF:
        return limits.spent, "time limit"
    if code == -signal.SIGABRT and any(words in worker.printed() for words in _NO_MEMORY):
        return limits.full, "memory limit"
    if code is not None and code >= 0 and line_of_death(worker.config.trace):
        return f"it ends the process, exit code {code}; {_UNAFFECTED}", "exit"
    kind: CaseKind = "crash" if code is None or code < 0 else "exit"
    return f"the process died ({_signal(code)}); {_UNAFFECTED}", kind


def _with_line(worker: _Worker, sentence: str) -> str:
    """Add the line of the user's file that was running, if known, to a sentence."""
    line = line_of_death(worker.config.trace)
    return f"{line}: {sentence}" if line else sentence


def _signal(code: int | None) -> str:
    if code is not None and code < 0:
        with contextlib.suppress(ValueError):
            return signal.Signals(-code).name
    return f"exit code {code}"


STARVED = 0.005
"""Smallest share of the processor that a busy process gets, even on the busiest machine."""


def processor_seconds(pid: int) -> float:
    """Return the processor time of all its threads so far, seconds; 0 if unknown."""
    with contextlib.suppress(OSError, IndexError, ValueError):
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    with contextlib.suppress(OSError, ValueError):  # macOS: [[days-]hours:]minutes:seconds
        answer = subprocess.run(
            ["ps", "-o", "time=", "-p", str(pid)], capture_output=True, text=True, check=False
        ).stdout.strip()
        days, _, rest = answer.rpartition("-")
        seconds = 0.0
        for part in rest.split(":"):
            seconds = 60 * seconds + float(part)
        return 86400 * float(days or 0) + seconds
    return 0.0


def is_waiting(used: float, elapsed: float) -> bool:
    """Return whether a process used so little processor time that it must be sleeping or stuck."""
    return used < STARVED * elapsed
