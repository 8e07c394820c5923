"""The built-in systems, solved once in a process for all tests that ask engines about them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

from physics_crosscheck.harness.checks.prepare import PreparedSystem, prepare_system
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.parametric_file import parametric_model_file
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.reference.mechanism.system import System


@cache
def physics(name: str) -> PreparedSystem:
    """A system, without the formulas of a report; nobody changes anything of it."""
    return prepare_system(builtin() / name, described=False)


def redrawn(
    system: System, sidecar: Sidecar, constants: Mapping[str, float], into: Path
) -> Sidecar:
    """A copy of a model at other constants, as a sweep writes it."""
    declared = {c.name: float(c.value) for c in system.constants}
    model_file = parametric_model_file(system, sidecar, constants, ())
    return model_file.write(declared | dict(constants), into)
