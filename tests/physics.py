"""The built-in systems, solved once in a process for all tests that ask engines about them."""

from __future__ import annotations

from functools import cache

from physics_crosscheck.harness.checks.prepare import Prepared, prepare
from physics_crosscheck.harness.modelfiles.folders import builtin


@cache
def physics(name: str) -> Prepared:
    """A system, without the formulas of a report; nobody changes anything of it."""
    return prepare(builtin() / name, described=False)
