"""Hooks and fixtures of all tests."""

import contextlib
import gc
import io
import pickle
import sys
import warnings
from collections.abc import Iterator
from dataclasses import replace
from multiprocessing.reduction import ForkingPickler
from typing import Any

import pytest

from physics_crosscheck.harness.checks import prepare
from physics_crosscheck.harness.commands.compare import states
from physics_crosscheck.harness.jobs.executor import Pending
from physics_crosscheck.harness.jobs.worker import _failure
from physics_crosscheck.harness.jobs.workers import Workers
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.samples import samples
from physics_crosscheck.reference.solving.segments import Segments

IN_THIS_PROCESS = {
    "audit", "campaigns", "cases", "cli", "gate", "installed", "notebook", "pytest_plugin",
    "report", "scaffold", "sweep",
}  # fmt: skip
"""Folders whose tests need what workers return, but no processes unless `slow` or `workers`."""

_REAL = {"begin": Workers.begin, "turn": Workers.turn}


def pytest_collection_finish() -> None:
    """Exclude modules and collected tests from garbage collection, a seventh of the time."""
    gc.freeze()
    gc.set_threshold(100_000)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Run tasks in this process, three times faster: a new one has to rebuild sympy's terms."""
    marks = {mark.name for mark in item.iter_markers()}
    here = item.path.parent.name in IN_THIS_PROCESS and not marks & {"slow", "workers"}
    for name, function in {"begin": _wait, "turn": _run_next}.items() if here else _REAL.items():
        setattr(Workers, name, function)


def _wait(_: Workers) -> None:
    """Start no server process."""


def _run_next(workers: Workers) -> list[Pending[Any]]:
    """Run the next task with a copy of its argument, as a worker would; return it."""
    pending, path, printed = workers._waiting.popleft(), [*sys.path], io.StringIO()
    try:
        data = ForkingPickler.dumps((pending.function, pending.argument))
        function, argument = ForkingPickler.loads(data)
        with (
            contextlib.redirect_stdout(printed),
            contextlib.redirect_stderr(printed),
            warnings.catch_warnings(action="ignore"),
        ):
            value = function(argument)
        value = ForkingPickler.loads(ForkingPickler.dumps(value))
    except (Exception, SystemExit) as error:
        value = replace(_failure(error, workers._limits), stdout=printed.getvalue().strip())
    sys.path[:] = path
    pending.end(value)
    return [pending]


@pytest.fixture(autouse=True, scope="session")
def outside_ci() -> Iterator[None]:
    """Unset the variables of CI, in which `accept` is rejected; a test of that sets them."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("CI", "GITHUB_ACTIONS"):
            patch.delenv(name, raising=False)
        yield


@pytest.fixture(autouse=True, scope="session")
def one_worker() -> Iterator[None]:
    """Start one worker process for each run: pytest already has one on every core."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("os.cpu_count", lambda: 1)
        yield


@pytest.fixture(autouse=True, scope="session")
def samples_of_equal_trees() -> Iterator[None]:
    """Sample and solve equal trees once in each process; many tests prepare the same text."""
    cache = dict[bytes, Segments]()

    def cached_samples(
        equations: TreeEquations, limits: Array, home: Array, count: int, seed: int
    ) -> Segments:
        system = replace(equations.system, source="")
        key = pickle.dumps((system, limits, home, count, seed))
        if key not in cache:
            cache[key] = samples(equations, limits, home, count, seed)
        return cache[key]

    with pytest.MonkeyPatch.context() as patch:
        for module in (prepare, states):
            patch.setattr(module, "samples", cached_samples)
        yield
