"""A system's record: whole, the same when it is read back, and fit for sympy to read."""

from functools import cache

import msgspec
import numpy as np
import pytest
import sympy as sp

from physics_crosscheck import System
from physics_crosscheck.harness.checks.prepare import PreparedSystem, prepare_system
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.records import system as records
from physics_crosscheck.reference.dynamics.derive import derive

NAMES = ("mass_spring_damper", "free_pair")


@cache
def prepared(name: str) -> PreparedSystem:
    return prepare_system(builtin() / name)


def names(system: System) -> dict[str, sp.Symbol]:
    symbols = (*system.q, *system.v, *system.a, *system.u, *system.values)
    return {symbol.name: symbol for symbol in symbols}


@pytest.mark.parametrize("name", NAMES)
def test_a_record_that_is_written_is_read_as_the_same(name: str) -> None:
    record = prepared(name).record
    assert record.folder == str(builtin() / name)
    assert record.seconds > 0
    assert msgspec.json.decode(msgspec.json.encode(record), type=records.SystemResult) == record


def test_without_a_description_nothing_derived_is_recorded() -> None:
    whole, brief = (
        prepared("free_pair").record,
        prepare_system(builtin() / "free_pair", described=False),
    )
    assert brief.record.derivation is None
    put_back = msgspec.structs.replace(
        brief.record, derivation=whole.derivation, seconds=whole.seconds
    )
    assert put_back == whole


@pytest.mark.parametrize("name", NAMES)
def test_the_text_of_the_equations_is_what_was_derived(name: str) -> None:
    found = prepared(name)
    derivation = found.record.derivation
    assert derivation is not None
    read = names(found.system)
    for formula, residual in zip(derivation.equations, derive(found.system).residual, strict=True):
        equation = sp.sympify(formula.text, locals=read)
        assert sp.expand(equation.lhs - equation.rhs - residual) == 0
    (one,) = derivation.linearizations
    equation = sp.sympify(one.formula.text, locals=read)
    sides = sp.Matrix(equation.lhs) - sp.Matrix(equation.rhs)
    at = dict.fromkeys(found.system.q, 0)
    linear = derive(found.system).residual
    assert at.keys() == set(found.system.q)
    assert sp.expand(sides - linear) == sp.zeros(len(at), 1), "these equations are linear"


def test_transfer_functions_are_shown_by_falling_powers() -> None:
    derivation = prepared("mass_spring_damper").record.derivation
    assert derivation is not None
    (one,) = derivation.linearizations
    (transfer,) = one.transfer_functions
    assert (transfer.output, transfer.input) == ("x", "f")
    assert transfer.formula.latex == r"\frac{1}{m \, s^{2} + c \, s + k}"
    assert one.formula.latex == r"m \, \ddot{x} + c \, \dot{x} + k \, x = f"
    assert np.array(one.matrices["K"]).shape == (1, 1)


def test_matrices_are_written_out_and_those_of_zeros_left_out() -> None:
    derivation = prepared("free_pair").record.derivation
    assert derivation is not None
    (one,) = derivation.linearizations
    assert one.formula.latex.startswith(
        r"\begin{bmatrix} m_{1} & 0 \\ 0 & m_{2} \end{bmatrix}"
        r" \begin{bmatrix} \ddot{x}_{1} \\ \ddot{x}_{2} \end{bmatrix} + "
    )
    assert derivation.equations[0].latex.endswith("+ f"), "the inputs come last"
