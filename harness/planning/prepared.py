"""Facts about prepared targets, and the tasks that use them.

Workers resolve a task by its name in `planning.tasks`, so that planning imports no equations.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from pkgutil import resolve_name
from typing import Any, Literal

from physics_crosscheck.harness.records.base import Record
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.harness.records.system import SystemResult

TASKS = "physics_crosscheck.harness.planning.tasks"


class TargetFacts(Record, frozen=True, kw_only=True):
    """Facts about a prepared folder or robot file, without its equations.

    Attributes:
        record: its entry in the results.
        declares: what its equations come from.
        reads: states of the files that `system.py` reads, by name relative to the folder.
        left_out: statements of a robot file that the equations omit.
        findings: what is wrong with a robot file by reading it.
    """

    record: SystemResult
    declares: Literal["energies", "bodies", "robot file"]
    reads: dict[str, str]
    left_out: tuple[str, ...] = ()
    findings: tuple[AuditFinding, ...] = ()


@dataclass(frozen=True)
class Preparation:
    """The facts of a folder or a file, and its solved equations, pickled.

    The planning process only passes them on: reading them would import sympy there.
    """

    facts: TargetFacts
    solved: bytes


@lru_cache(maxsize=1)
def unpacked(solved: bytes) -> Any:
    """Return solved equations; a worker reads them once for all its tasks."""
    return pickle.loads(solved)


@dataclass(frozen=True)
class NamedFunction:
    """A function named by its dotted path, and imported when it is called in a worker."""

    path: str

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """Import and call the function."""
        return resolve_name(self.path)(*arguments, **options)

    @property
    def __name__(self) -> str:
        return self.path.rpartition(".")[-1]


def task_function(name: str, **options: object) -> Callable[[Any], Any]:
    """Return a function of `planning.tasks` by its name, with options bound."""
    return partial(NamedFunction(f"{TASKS}.{name}"), **options)
