"""The built-in systems, solved once in each process for all tests."""

import atexit
import os
import pickle
import shutil
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from tempfile import gettempdir

from physics_crosscheck import System
from physics_crosscheck.harness.checks.prepare import PreparedSystem, prepare_system
from physics_crosscheck.harness.modelfiles.bindings import parametric_model_file
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar


@cache
def physics(name: str) -> PreparedSystem:
    """Prepare a built-in system without formulas; callers must not modify it.

    The workers of one run of pytest share it.
    """
    run = os.environ.get("PYTEST_XDIST_TESTRUNUID", os.getpid())
    shared = Path(gettempdir()) / f"crosscheck-{run}"
    stored = shared / name
    if stored.is_file():
        prepared: PreparedSystem = pickle.loads(stored.read_bytes())
        return prepared
    prepared = prepare_system(builtin() / name, described=False)
    stored.parent.mkdir(parents=True, exist_ok=True)  # a name may contain a folder
    atexit.register(shutil.rmtree, shared, ignore_errors=True)
    partial = shared / f"{name}.{os.getpid()}"
    partial.write_bytes(pickle.dumps(prepared))
    partial.replace(stored)
    return prepared


def copy_with_constants(
    system: System, sidecar: Sidecar, constants: Mapping[str, float], into: Path
) -> Sidecar:
    """Write a copy of a model with other constants, as a sweep does."""
    declared = {c.name: float(c.value) for c in system.constants}
    model_file = parametric_model_file(system, sidecar, constants, ())
    return model_file.write(declared | dict(constants), into)
