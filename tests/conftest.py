"""The surroundings that every test starts from."""

from __future__ import annotations

import gc
import pickle
from collections.abc import Iterator
from dataclasses import replace

import pytest

from physics_crosscheck.harness.checks import prepare
from physics_crosscheck.harness.commands.compare import states
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.samples import samples
from physics_crosscheck.reference.solving.segments import Segments


def pytest_collection_finish() -> None:
    """Leave modules and collected tests out of the search for garbage, a seventh of the time."""
    gc.freeze()
    gc.set_threshold(100_000)


@pytest.fixture(autouse=True, scope="session")
def outside_ci() -> Iterator[None]:
    """`accept` is refused in CI, where this suite runs too: a test of that sets the variable."""
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
    kept = dict[bytes, Segments]()

    def once(
        equations: TreeEquations, limits: Array, home: Array, count: int, seed: int
    ) -> Segments:
        system = replace(equations.system, source="")
        key = pickle.dumps((system, limits, home, count, seed))
        if key not in kept:
            kept[key] = samples(equations, limits, home, count, seed)
        return kept[key]

    with pytest.MonkeyPatch.context() as patch:
        for room in (prepare, states):
            patch.setattr(room, "samples", once)
        yield
