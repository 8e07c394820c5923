"""The built-in systems, solved once in a process for all tests that ask engines about them."""

from __future__ import annotations

import atexit
import os
import pickle
import shutil
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from tempfile import gettempdir

from physics_crosscheck.harness.checks.prepare import PreparedSystem, prepare_system
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.parametric_file import parametric_model_file
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.reference.mechanism.system import System


@cache
def physics(name: str) -> PreparedSystem:
    """A system, without the formulas of a report; nobody changes anything of it.

    The workers of one run of pytest share it.
    """
    run = os.environ.get("PYTEST_XDIST_TESTRUNUID", os.getpid())
    shared = Path(gettempdir()) / f"crosscheck-{run}"
    kept = shared / name
    if kept.is_file():
        found: PreparedSystem = pickle.loads(kept.read_bytes())
        return found
    found = prepare_system(builtin() / name, described=False)
    kept.parent.mkdir(parents=True, exist_ok=True)  # a name may contain a folder
    atexit.register(shutil.rmtree, shared, ignore_errors=True)
    own = shared / f"{name}.{os.getpid()}"
    own.write_bytes(pickle.dumps(found))
    own.replace(kept)
    return found


def redrawn(
    system: System, sidecar: Sidecar, constants: Mapping[str, float], into: Path
) -> Sidecar:
    """A copy of a model at other constants, as a sweep writes it."""
    declared = {c.name: float(c.value) for c in system.constants}
    model_file = parametric_model_file(system, sidecar, constants, ())
    return model_file.write(declared | dict(constants), into)
