"""The inside of a worker process: one task after the other, each with its limits.

The output of a task, including that of C code, goes to the worker's log file. The Python stack of a
crash goes to another file, which `Workers` reads.
"""

from __future__ import annotations

import contextlib
import faulthandler
import gc
import multiprocessing
import os
import shutil
import signal
import sys
import tempfile
import threading
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.reduction import ForkingPickler
from pathlib import Path
from typing import Any, NoReturn

from .failure import Failure, failure_of, user_line
from .limits import Limits
from .stop import SIGNALS

MOST_WRITTEN = 2**28
"""Maximum size of a file that a worker writes, bytes; endless output cannot fill the disk."""

GARBAGE_THRESHOLD = 100_000
"""New objects between two searches for garbage: rows of states are many small lists."""

_APPEND = os.O_WRONLY | os.O_CREAT | os.O_APPEND

try:
    import resource
except ImportError:  # Windows has none of these limits
    _LIMITED = False
else:
    _LIMITED = True


@dataclass(frozen=True, kw_only=True)
class WorkerConfig:
    """The configuration of a worker.

    Attributes:
        cwd: working folder of the program that started it.
        scratch: folder for temporary files, removed with the last worker.
        log: file for printed output.
        trace: file for the stack of a crash.
        limits: limits of each task.
    """

    cwd: str
    scratch: Path
    log: Path
    trace: Path
    limits: Limits


def serve(tasks: Connection, config: WorkerConfig) -> NoReturn:
    """Run tasks until no more arrive: the main function of a worker process.

    End without a message if the program has ended: other workers then remove the scratch folder.
    """
    try:
        _prepare(config)
        _run_tasks(tasks, config)
    except OSError:
        program = multiprocessing.parent_process()
        if program is not None and not program.is_alive():
            os._exit(1)
        raise


def _prepare(config: WorkerConfig) -> None:
    """Set up the process: signals, output, limits, and its end with the program."""
    gc.freeze()  # collecting what the server imported would copy all its memory
    gc.set_threshold(GARBAGE_THRESHOLD)
    with contextlib.suppress(OSError):
        os.setpgid(0, 0)  # child processes of a task end with it; only the program handles Ctrl-C
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)  # blocked by the parent process
    threading.Thread(target=_end_with_the_program, args=[config.scratch], daemon=True).start()
    with contextlib.suppress(OSError):
        os.chdir(config.cwd)
    tempfile.tempdir = str(config.scratch)
    _redirect(config)
    _limit(config.limits)


def _run_tasks(tasks: Connection, config: WorkerConfig) -> NoReturn:
    initial = _ProcessState.now()
    while True:
        try:
            function, argument = tasks.recv()
        except EOFError:
            os._exit(0)
        except Exception as error:
            _answer(tasks, Failure(f"its task can't be sent: {_error_text(error)}", ""), last=False)
            continue
        value, full = _done(function, argument, config)
        if os.getpid() != initial.process:
            os._exit(0)  # a forked copy of a task has no answer
        initial.restore(config)
        # After an out-of-memory error memory is not released, so the next task gets another worker.
        _answer(tasks, value, last=full)


@dataclass(frozen=True, kw_only=True)
class _ProcessState:
    """The process state that a worker's tasks share; a task may change it."""

    process: int
    path: tuple[str, ...]
    environment: Mapping[str, str]

    @staticmethod
    def now() -> _ProcessState:
        """Return the present state."""
        return _ProcessState(
            process=os.getpid(), path=tuple(sys.path), environment=dict(os.environ)
        )

    def restore(self, config: WorkerConfig) -> None:
        """Restore the state."""
        sys.path[:] = self.path
        if os.environ != self.environment:
            os.environ.clear()
            os.environ.update(self.environment)
        with contextlib.suppress(OSError):
            os.chdir(config.cwd)
        sys.stdout, sys.stderr = sys.__stdout__, sys.__stderr__
        _redirect_streams(config)


def _end_with_the_program(scratch: Path) -> None:
    """Clean up if the program that started the worker has ended, for example was killed."""
    program = multiprocessing.parent_process()
    if program is not None:
        program.join()
        shutil.rmtree(scratch, ignore_errors=True)
        os._exit(1)


def _redirect(config: WorkerConfig) -> None:
    """Redirect all output to the log, and the stack of a crash to the trace."""
    sys.stdout.flush()
    sys.stderr.flush()
    _redirect_streams(config)
    trace = os.open(config.trace, _APPEND)
    faulthandler.enable(trace, all_threads=False)
    for name in ("SIGPROF", "SIGTERM"):
        if hasattr(signal, name) and hasattr(faulthandler, "register"):
            faulthandler.register(getattr(signal, name), trace, all_threads=False, chain=True)
    leave = os._exit

    def report_exit(status: int) -> NoReturn:
        """Record the caller before `os._exit`, which leaves no trace."""
        faulthandler.dump_traceback(trace, all_threads=False)
        leave(status)

    os._exit = report_exit


def _redirect_streams(config: WorkerConfig) -> None:
    log = os.open(config.log, _APPEND)
    os.dup2(log, 1)
    os.dup2(log, 2)
    if log > 2:  # a closed descriptor may already have this number
        os.close(log)


def _limit(limits: Limits) -> None:
    """Set the limits for the whole life of a worker, which the operating system enforces."""
    if not _LIMITED:
        return
    data = int(limits.memory * 2**30) + _held()
    for kind, limit in (
        (resource.RLIMIT_DATA, data),
        (resource.RLIMIT_FSIZE, MOST_WRITTEN),
        (resource.RLIMIT_CORE, 0),
    ):
        _, highest = resource.getrlimit(kind)
        limit = limit if highest == resource.RLIM_INFINITY else min(limit, highest)
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(kind, (limit, highest))


def _held() -> int:
    """Return the memory of a worker before its first task, bytes; libraries reserve some per
    processor.
    """
    try:
        return int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
    except (OSError, IndexError, ValueError):
        return 0


def _done(
    function: Callable[[Any], Any], argument: object, config: WorkerConfig
) -> tuple[object, bool]:
    """Return the value or the `Failure` of a task, and whether memory ran out.

    Convert every exception to a sentence: some exceptions cannot be pickled, and a `sys.exit` in a
    model file would end the process.
    """
    for file in (config.log, config.trace):
        with contextlib.suppress(OSError):
            os.truncate(file, 0)
    _count_down(config.limits.seconds)
    try:
        return function(argument), False
    except BaseException as error:
        return _failure(error, config.limits), _shortage(error) is not None
    finally:
        _count_down(0.0)
        with contextlib.suppress(Exception):
            sys.stdout.flush()
            sys.stderr.flush()


def _count_down(seconds: float) -> None:
    """End this process by a signal after some processor time, even in C code; 0: never."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_PROF, seconds)


def _failure(error: BaseException, limits: Limits) -> Failure:
    """Convert an exception to a failure."""
    shortage = _shortage(error)
    if shortage is not None:
        return Failure(_with_line(shortage, limits.full), "", kind="memory limit")
    # Our own errors carry a sentence; other exceptions are reported with their type.
    ours = type(error).__module__.startswith("physics_crosscheck.")
    if ours and isinstance(error, ValueError | RuntimeError):
        return failure_of(error, _words(error))
    # Other BaseExceptions would normally end the program: name the file that raised them.
    message = _error_text(error)
    return Failure(message if isinstance(error, Exception) else _with_line(error, message), "")


def _shortage(error: BaseException) -> MemoryError | None:
    """Return the memory error behind an exception, even if another one was raised for it."""
    seen: set[int] = set()
    cause: BaseException | None = error
    while cause is not None and id(cause) not in seen:
        if isinstance(cause, MemoryError):
            return cause
        seen.add(id(cause))
        cause = cause.__cause__ or cause.__context__
    return None


def _with_line(error: BaseException, sentence: str) -> str:
    """Add the line of the user's file that was running, if any, to a sentence."""
    frames = [(f.filename, f.lineno) for f in traceback.extract_tb(error.__traceback__)]
    line = user_line(reversed(frames))
    return f"{line}: {sentence}" if line else sentence


def _error_text(error: BaseException) -> str:
    words = _words(error)
    return f"{type(error).__name__}: {words}" if words else type(error).__name__


def _words(error: BaseException) -> str:
    try:
        return str(error)
    except BaseException as worse:
        return f"its message can't be shown ({type(worse).__name__})"


def _answer(tasks: Connection, value: object, *, last: bool) -> None:
    """Send a value, and whether it is the last; send a failure if it cannot be pickled."""
    try:
        data = ForkingPickler.dumps((value, last))
    except BaseException as error:
        lost = Failure(f"its value can't be sent: {_error_text(error)}", "")
        data = ForkingPickler.dumps((lost, last))
    try:
        tasks.send_bytes(data)
    except OSError:  # the program no longer reads
        os._exit(1)
