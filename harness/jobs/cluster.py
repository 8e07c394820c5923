"""Tasks on an existing cluster of dask.distributed.

A task is sent as bytes to a worker that dask selects, and runs there in a separate process: see
`harness.jobs.remote_workers`. It reads its files from a folder that the machines share. A worker
that does not know the run reports this, gets the run, and the task is sent again. dask sends a task
to another worker if its worker is lost.
"""

import contextlib
import logging
import os
import pickle
import queue
import sys
import time
import uuid
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from itertools import accumulate, groupby
from pathlib import Path
from typing import Any

from .executor import MOMENT, ClusterError, Executor, Pending
from .failure import Failure
from .limits import Limits
from .remote_workers import RunConfig, contents, installed

try:
    import distributed
except ImportError as error:
    raise ClusterError(
        f"--scheduler needs dask.distributed, which can't be imported ({error}). "
        "Run: pip install 'physics-crosscheck[cluster]'"
    ) from None

ANSWER = 10.0
"""Timeout for an answer of the scheduler, seconds."""

REFRESH_SECONDS = 2.0
"""Interval between two updates of the list of workers, seconds."""

PREFETCH = 4
"""Maximum number of submitted tasks per thread of the cluster; below half of it, more are sent."""

FEWEST = 4
"""Number of submitted tasks while there are almost no threads."""

MESSAGE = 2**22
"""Size of the tasks in one message, bytes, above which the next one starts; dask warns at 10 MB."""

_TRIES = 5
"""Number of times that a task may reach workers that do not know the run, since workers come and
go.
"""

_STRANGE = f"{_TRIES + 1} workers of the cluster took this task and left before they had the run"


_Sent = tuple[Pending[Any], bytes, int]
"""A submitted task with its payload, and how often it reached a worker that did not know
the run.
"""


class Cluster(Executor):
    """The workers of a cluster; use it as a context manager.

    Args:
        address: address of the scheduler.
        jobs: maximum number of submitted tasks; 0: some for each thread of the cluster.
        limits: limits of each task.
        files: files and folders that tasks read; each worker must see the same content.
        engines: engines whose versions must be the same on the cluster; empty: all installed here.

    Raises:
        ClusterError: if the scheduler does not answer, or the installed versions differ.
    """

    def __init__(
        self,
        address: str,
        *,
        jobs: int = 0,
        limits: Limits | None = None,
        files: Sequence[Path] = (),
        engines: Sequence[str] = (),
    ) -> None:
        super().__init__()
        self._address, self._jobs = address, jobs
        self._run = f"crosscheck-{uuid.uuid4().hex[:16]}"
        config = RunConfig(
            run=self._run,
            limits=limits or Limits(),
            cwd=str(Path.cwd()),
            files=contents(map(os.path.abspath, files)),
            versions=installed(tuple(engines)),
            engines=tuple(engines),
        )
        self._setup = pickle.dumps(config)
        self._flying: dict[Any, _Sent] = {}
        self._ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._threads, self._looked = 0, -REFRESH_SECONDS
        self._call = _by_value()
        self._client = _connected(address)
        try:
            self._check(self._client)
            self._receive()
        except BaseException:
            self.close()
            raise

    def turn(self) -> list[Pending[Any]]:
        """Send tasks, wait briefly for an event, and return the tasks that ended.

        Raises:
            ClusterError: if the scheduler is lost, or a new worker has other versions.
        """
        ended = self._send()
        if ended:
            return ended
        futures = []
        with contextlib.suppress(queue.Empty):
            futures.append(self._ended.get(timeout=MOMENT))
            while True:
                futures.append(self._ended.get_nowait())
        return self._take(futures)

    def close(self) -> None:
        """Cancel the submitted tasks, end the running ones, and disconnect from the cluster."""
        with contextlib.suppress(Exception):
            if self._flying:
                self._client.cancel(list(self._flying), force=True)
        self._flying.clear()
        with contextlib.suppress(Exception):
            if self._client.status == "running":  # closing waits for a scheduler that is gone
                self._client.run(self._call, "leave", self._run, on_error="ignore")
        with contextlib.suppress(Exception):
            self._client.close(timeout=ANSWER)

    def _check(self, client: Any) -> None:
        """Reject other versions of the communication libraries, Python first."""
        installed = client.get_versions()
        here = _talking(installed["client"])
        others = {"its scheduler": installed["scheduler"], **installed["workers"]}
        for name, there in others.items():
            other = [
                f"{what} {version} (here {here[what]})"
                for what, version in _talking(there).items()
                if version != here[what]
            ]
            if other:
                raise self._other(name, ", ".join(other))

    def _other(self, worker: str, what: str) -> ClusterError:
        return ClusterError(
            f"--scheduler {self._address}: {worker} has {what}, so its results "
            "could differ from this machine's; install the same version there, or "
            "choose other engines with --engine"
        )

    def _without(self, worker: str, error: ImportError) -> ClusterError:
        return ClusterError(
            f"--scheduler {self._address}: {worker} can't import physics-crosscheck ({error}):"
            " install it there, in the same version"
        )

    def _receive(self, workers: Sequence[str] | None = None) -> None:
        """Send the run to workers; None: to all."""
        given = "receive", self._setup
        answers = self._client.run(self._call, *given, workers=workers, on_error="return")
        for worker, answer in answers.items():
            if isinstance(answer, ImportError):
                raise self._without(worker, answer)
            if isinstance(answer, OSError) and workers is not None:
                continue  # the worker is gone; its tasks go elsewhere
            if isinstance(answer, BaseException):
                message = f"{type(answer).__name__}: {answer}"
                raise ClusterError(
                    f"--scheduler {self._address}: {worker} can't take the run: {message}"
                )
            versions, path = answer
            if versions:
                raise self._other(worker, versions)
            if path:
                raise ClusterError(
                    f"--scheduler {self._address}: {worker} does not see {path} as it is here;"
                    " put it in a folder that all machines share, at the same path"
                )

    def _room(self) -> int:
        """Return the maximum number of submitted tasks."""
        if self._jobs:
            return self._jobs
        if time.monotonic() - self._looked > REFRESH_SECONDS:
            threads = sum(self._client.nthreads().values())
            if not threads and (self._threads or self._looked < 0):
                print(
                    f"crosscheck: the cluster at {self._address} has no workers; waiting for one",
                    file=sys.stderr,
                )
            self._threads, self._looked = threads, time.monotonic()
        return max(FEWEST, PREFETCH * self._threads)

    def _send(self) -> list[Pending[Any]]:
        """Send waiting tasks while there is room; return those that cannot be sent."""
        lost: list[Pending[Any]] = []
        room = self._room() if self._waiting else 0
        if len(self._flying) > room // 2:
            return lost
        sent: list[_Sent] = []
        while self._waiting and len(self._flying) + len(sent) < room:
            pending = self._waiting.popleft()
            task = (pending.function, pending.argument)
            try:
                sent.append((pending, pickle.dumps(task, protocol=pickle.HIGHEST_PROTOCOL), 0))
            except Exception as error:
                pending.end(Failure(f"{type(error).__name__}: {error}", ""))
                lost.append(pending)
        self._fly(sent)
        return lost

    def _fly(self, sent: Sequence[_Sent]) -> None:
        """Send many tasks at once, because each message costs the scheduler as much as several
        tasks.
        """
        ends = accumulate(len(data) for _, data, _ in sent)
        together = groupby(zip(ends, sent, strict=True), key=lambda pair: pair[0] // MESSAGE)
        for message in ([task for _, task in group] for _, group in together):
            keys = [f"{_name(one.function)}-{uuid.uuid4().hex}" for one, _, _ in message]
            tasks = [data for _, data, _ in message]
            do = partial(self._call, "do", self._run)
            futures = self._client.map(do, tasks, key=keys, pure=False)
            self._flying |= zip(futures, message, strict=True)
            for future in futures:
                future.add_done_callback(self._ended.put)

    def _take(self, futures: Sequence[Any]) -> list[Pending[Any]]:
        """End and return the tasks of finished futures; resend those whose worker did not know the
        run.
        """
        ended, strangers = [], dict[str, None]()
        again = []
        for future, reply in self._replies(futures):
            pending, data, tries = self._flying.pop(future)
            value, stranger = self._value(reply)
            if stranger and tries < _TRIES:
                strangers[stranger] = None
                again.append((pending, data, tries + 1))
                continue
            pending.end(value)
            ended.append(pending)
        if strangers:
            self._receive(list(strangers))
        self._fly(again)
        return ended

    def _replies(self, futures: Sequence[Any]) -> list[tuple[Any, Callable[[], Any]]]:
        """Return the finished futures, each with a function that returns or raises its reply.

        All replies are fetched at once.
        """
        with contextlib.suppress(Exception):  # the error of each future is reported separately
            fetched = self._client.gather(list(futures))
            return [
                (one, partial(_same, reply)) for one, reply in zip(futures, fetched, strict=True)
            ]
        return [(one, one.result) for one in futures]

    def _value(self, reply_of: Callable[[], Any]) -> tuple[Any, str]:
        """Return the value or failure of a task, and the worker that does not know the run."""
        try:
            address, reply = reply_of()
        except distributed.CancelledError:
            raise ClusterError(
                f"--scheduler {self._address}: the scheduler stopped or dropped the "
                "run's tasks; with --cache DIR, the next run reuses finished cases"
            ) from None
        except ImportError as error:
            raise self._without("a new worker", error) from None
        except distributed.KilledWorker as error:
            return Failure(f"several workers were lost while they ran it: {error}", ""), ""
        except Exception as error:
            return Failure(f"the cluster: {type(error).__name__}: {error}", ""), ""
        if reply is None:
            return Failure(_STRANGE, ""), address
        try:
            return reply if isinstance(reply, Failure) else pickle.loads(reply), ""
        except Exception as error:
            return Failure(f"its value can't be read: {type(error).__name__}: {error}", ""), ""


def _name(function: object) -> str:
    """Return the task's name for the dashboard; dask takes the part before the last `-` as its
    kind.
    """
    return str(getattr(getattr(function, "func", function), "__name__", "task"))


def _same(value: Any) -> Any:
    return value


def _connected(address: str) -> Any:
    """Connect a client to the scheduler.

    Raises:
        ClusterError: if it does not answer.
    """
    # We report lost connections ourselves, or dask recovers from them.
    for name in ("distributed", "distributed.client", "distributed.core"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # other versions are reported below
            return distributed.Client(
                address, timeout=ANSWER, set_as_default=False, name="physics-crosscheck"
            )
    except (OSError, ValueError, TypeError, RuntimeError, ImportError) as error:
        message = " ".join(str(error).split()) or type(error).__name__
        raise ClusterError(
            f"--scheduler {address}: no scheduler answers there ({message}). Start one "
            "with `dask scheduler`, which prints its address (tcp://HOST:8786)"
        ) from None


def _talking(installed: Any) -> dict[str, str]:
    """Return the versions that must be equal for communication."""
    if not isinstance(installed, dict):
        return {"dask.distributed": f"of an unknown version ({installed})"}
    host, packages = installed["host"], installed["packages"]
    return {
        "Python": ".".join(host["python"].split(".")[:2]),
        "dask.distributed": str(packages["distributed"]),
    }


def _by_value() -> Callable[..., Any]:
    """Return a function that calls one of `harness.jobs.remote_workers` in a worker.

    It is sent as code, not by name. The scheduler reads it too and need not have this package, and
    a worker must bind the names to our packages before it looks them up.
    """

    def call(name: str, *arguments: Any) -> Any:
        from . import remote_workers

        return getattr(remote_workers, name)(*arguments)

    return call
