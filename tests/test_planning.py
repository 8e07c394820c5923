"""Planning refers to worker functions by name and does not import them."""

import subprocess
import sys
from itertools import permutations
from pkgutil import resolve_name

import pytest

from physics_crosscheck.harness.planning.model_checks import AUDIT, CHECKS, COVERAGE, ModelCheck
from physics_crosscheck.harness.planning.result_builder import ResultBuilder
from physics_crosscheck.harness.records.coverage import Coverage
from physics_crosscheck.harness.records.survey import Audit
from physics_crosscheck.records import Model
from tests.records.made import finding

MECHANICS = next(check for check in CHECKS if check.kind == "mechanics")


@pytest.mark.parametrize("check", CHECKS, ids=[check.kind for check in CHECKS])
def test_each_check_names_a_function(check: ModelCheck) -> None:
    for path in {check.function, check.of_bodies or check.function}:
        assert callable(resolve_name(f"physics_crosscheck.harness.{path}"))


def test_kinds_of_checks_are_unique() -> None:
    assert len({check.kind for check in CHECKS}) == len(CHECKS)


def test_record_does_not_depend_on_the_order_of_checks() -> None:
    values = {
        AUDIT: Audit(findings=(finding(subject=("mass",)),), left_out=("friction",)),
        MECHANICS: Audit(findings=(finding(subject=("gravity",)),)),
        COVERAGE: Coverage(motion=3),
    }
    model = Model(system="s", model="m.urdf", engine="e", folder="f", text="", sidecar="")
    records = []
    for order in permutations(values):
        results = ResultBuilder(lambda *_: None)
        results.begin(model)
        for check in order:
            results.enter(model.key, check, values[check])
        records.append(results.models[model.key])
    assert all(record == records[0] for record in records)
    assert [each.subject for each in records[0].audit or ()] == [("mass",), ("gravity",)]
    assert records[0].coverage == Coverage(motion=3, left_out=("friction",))


def test_planning_imports_no_equations_and_no_engine() -> None:
    heavy = ("sympy", "scipy", "mujoco", "pybullet", "pymunk")
    modules = ("run", "audits", "commands.gate.gate")
    code = "".join(
        f"import sys, physics_crosscheck.harness.{module}\n"
        f"print({module!r}, *[name for name in {heavy!r} if name in sys.modules])\n"
        for module in modules
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [*modules]
