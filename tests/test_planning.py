"""Planning names the work that workers do, and imports none of it."""

import subprocess
import sys

import pytest

from physics_crosscheck.harness.planning import tasks
from physics_crosscheck.harness.planning.cache import KINDS
from physics_crosscheck.harness.planning.prepared import task_function


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_of_work_is_a_function_of_tasks(kind: str) -> None:
    function = task_function(kind)
    assert callable(getattr(tasks, kind))
    assert function.func.path == f"{tasks.__name__}.{kind}"  # type: ignore[attr-defined]


@pytest.mark.parametrize("module", ["run", "audits", "gate.gate"])
def test_planning_imports_no_equations_and_no_engine(module: str) -> None:
    heavy = ("sympy", "scipy", "mujoco", "pybullet", "pymunk")
    code = (
        f"import sys, physics_crosscheck.harness.{module}\n"
        f"print([name for name in {heavy!r} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
