"""The record of a system, its sketch, and a folder that cannot run."""

from functools import cache
from pathlib import Path

import msgspec
import numpy as np
import pytest
import sympy as sp

from physics_crosscheck import System
from physics_crosscheck.harness.checks.not_run import failed_case
from physics_crosscheck.harness.checks.prepare import PreparedSystem, prepare_system
from physics_crosscheck.harness.checks.system_record import sketch_record
from physics_crosscheck.harness.jobs.workers import Failure
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.records import system as records
from physics_crosscheck.harness.render.html.systems import drawing, evaluate
from physics_crosscheck.records import CaseId
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.load import load_system
from physics_crosscheck.sketch import Link

NAMES = ("mass_spring_damper", "free_pair")


@cache
def prepared(name: str) -> PreparedSystem:
    return prepare_system(builtin() / name)


def names(system: System) -> dict[str, sp.Symbol]:
    symbols = (*system.q, *system.v, *system.a, *system.u, *system.values)
    return {symbol.name: symbol for symbol in symbols}


@pytest.mark.parametrize("name", NAMES)
def test_record_is_classed_and_round_trips_through_json(name: str) -> None:
    record = prepared(name).record
    assert record.kind == {"mass_spring_damper": "SISO", "free_pair": "SIMO"}[name]
    assert record.folder == str(builtin() / name)
    assert record.seconds > 0
    assert msgspec.json.decode(msgspec.json.encode(record), type=records.SystemResult) == record


def test_undescribed_record_has_no_derivation() -> None:
    whole, undescribed = (
        prepared("free_pair").record,
        prepare_system(builtin() / "free_pair", described=False),
    )
    assert undescribed.record.derivation is None
    put_back = msgspec.structs.replace(
        undescribed.record, derivation=whole.derivation, seconds=whole.seconds
    )
    assert put_back == whole


@pytest.mark.parametrize("name", NAMES)
def test_text_of_the_equations_parses_to_the_derivation(name: str) -> None:
    setup = prepared(name)
    derivation = setup.record.derivation
    assert derivation is not None
    read = names(setup.system)
    for formula, residual in zip(derivation.equations, derive(setup.system).residual, strict=True):
        equation = sp.sympify(formula.text, locals=read)
        assert sp.expand(equation.lhs - equation.rhs - residual) == 0
    (linearization,) = derivation.linearizations
    equation = sp.sympify(linearization.formula.text, locals=read)
    sides = sp.Matrix(equation.lhs) - sp.Matrix(equation.rhs)
    zeros = dict.fromkeys(setup.system.q, 0)
    linear = derive(setup.system).residual
    assert zeros.keys() == set(setup.system.q)
    assert sp.expand(sides - linear) == sp.zeros(len(zeros), 1), "these equations are linear"


def test_transfer_functions_have_descending_powers() -> None:
    derivation = prepared("mass_spring_damper").record.derivation
    assert derivation is not None
    (linearization,) = derivation.linearizations
    (transfer,) = linearization.transfer_functions
    assert (transfer.output, transfer.input) == ("x", "f")
    assert transfer.formula.latex == r"\frac{1}{m \, s^{2} + c \, s + k}"
    assert linearization.formula.latex == r"m \, \ddot{x} + c \, \dot{x} + k \, x = f"
    assert np.array(linearization.matrices["K"]).shape == (1, 1)


def test_zero_matrices_are_left_out_of_the_formula() -> None:
    derivation = prepared("free_pair").record.derivation
    assert derivation is not None
    (linearization,) = derivation.linearizations
    assert linearization.formula.latex.startswith(
        r"\begin{bmatrix} m_{1} & 0 \\ 0 & m_{2} \end{bmatrix}"
        r" \begin{bmatrix} \ddot{x}_{1} \\ \ddot{x}_{2} \end{bmatrix} + "
    )
    assert derivation.equations[0].latex.endswith("+ f"), "the inputs come last"


CASE = CaseId(system="s", model="robot.urdf", scenario="free", engine="mujoco")


@pytest.mark.parametrize("reason", [
    "the process died (SIGKILL); other cases are not affected",
    "it used up its limit of 120 processor seconds; --limit raises it",
])  # fmt: skip
def test_reason_without_a_file_gets_the_file_of_the_case(reason: str) -> None:
    actual = failed_case(CASE, "folder", Failure(reason, "")).reason
    assert actual == f"{Path('folder') / 'robot.urdf'}: {reason}"


def test_reason_with_a_file_is_unchanged() -> None:
    reason = "folder/robot.urdf:7: <mass value> is 'a', where a finite number"
    assert failed_case(CASE, "folder", Failure(reason, "")).reason == reason


SKETCHED = sorted(path.parent.name for path in builtin().glob("*/system.py"))


@pytest.mark.parametrize("name", SKETCHED)
def test_builtin_sketches_show_every_coordinate(name: str) -> None:
    """Compare trees with their expressions at a random position."""
    system = load_system(builtin() / name)
    record = sketch_record(system)
    assert record is not None
    kinds = {shape.kind for shape in record.shapes}
    assert kinds & {"spring", "rod", "spiral"}
    labels = {shape.label for shape in record.shapes}
    assert {c.name for c in system.coordinates} <= labels
    random = np.random.default_rng(3)
    q = list(random.uniform(-2, 2, len(system.coordinates)))
    values = dict(zip(system.q, map(float, q), strict=True)) | system.values
    for shape, declared in zip(record.shapes, system.sketch, strict=True):
        if shape.center is not None:
            assert not isinstance(declared, Link)
            for actual, expected in zip(shape.center, declared.at, strict=True):
                exact = float(sp.sympify(expected).subs(values))
                assert evaluate(actual, q) == pytest.approx(exact, abs=1e-7)
    assert drawing(record, [c.name for c in system.coordinates]).description


def test_unknown_operation_of_a_sketch_is_refused() -> None:
    with pytest.raises(ValueError, match="unknown operation 'exec'"):
        evaluate(["exec", 1.0], [0.0])
