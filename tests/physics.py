"""The built-in systems, solved once in a process for all tests that ask engines about them."""

from __future__ import annotations

from functools import cache

from physics_crosscheck.harness.checks.prepare import PreparedSystem, prepare_system
from physics_crosscheck.harness.modelfiles.folders import builtin


@cache
def physics(name: str) -> PreparedSystem:
    """A system, without the formulas of a report; nobody changes anything of it."""
    return prepare_system(builtin() / name, described=False)
