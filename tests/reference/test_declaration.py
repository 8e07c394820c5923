"""Missing, unknown or impossible declarations, and files of them, are rejected."""

import dataclasses
import math
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest
import sympy as sp

from physics_crosscheck import (
    Constant,
    Coordinate,
    DeclarationError,
    Equilibrium,
    Input,
    Output,
    PublishedEquation,
    Quantity,
    Scenario,
    System,
    t,
)
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.dynamics.linearize import linearize
from physics_crosscheck.reference.load import load_system
from physics_crosscheck.sketch import Angle, Body, Link
from tests.reference.mechanisms import MODELS, NAMES, C, F, K, M, X, built_in, constant, declared

Y = Coordinate("y", "m", "another displacement")
STRAY = sp.Symbol("stray", real=True)
ZERO = constant("z", 0.0, "kg")
NEGATIVE = constant("n", -1.3, "kg")
SPEED = constant("w", 2.0, "m/s")
NOTHING: Any = None  # a value that types forbid and users may write
WORD: Any = "47"
SPATIAL: Any = (0, 0, 0)
BARE = Quantity("p", M * X.v, "kg*m/s", "momentum")


def scenario(**changed: Any) -> Scenario:
    fields: dict[str, Any] = {
        "name": "free",
        "description": "released",
        "q": {X: 0.1},
        "v": {X: 0},
        "inputs": {F: 0},
        "duration": 10.0,
    } | changed
    return Scenario(**fields)


def two(**changed: Any) -> dict[str, Any]:
    """Return the fields of a system with two coordinates, x and y."""
    return (
        declared(
            coordinates=(X, Y),
            T=M * X.v**2 / 2 + M * Y.v**2 / 2,
            equilibria=(Equilibrium("rest", {X: 0, Y: 0}, False, ""),),
        )
        | {"scenarios": (scenario(q={X: 0.1, Y: 0}, v={X: 0, Y: 0}),)}
        | changed
    )


FAULTS = [
    # missing
    (declared(coordinates=()), "declares no coordinates"),
    (declared(outputs=()), "declares no outputs"),
    (declared(equilibria=()), "declares no equilibria"),
    (declared(scenarios=()), "declares no scenarios"),
    (two(scenarios=(scenario(v={X: 0, Y: 0}),)), "scenario 'free', q: no value is given for y"),
    (two(scenarios=(scenario(q={X: 0, Y: 0}),)), "scenario 'free', v: no value is given for y"),
    (
        declared(scenarios=(scenario(inputs={}),)),
        "scenario 'free', inputs: no value is given for f",
    ),
    (
        two(equilibria=(Equilibrium("rest", {X: 0}, False, ""),)),
        "equilibrium 'rest': no value is given for y",
    ),
    (
        declared(constants=(dataclasses.replace(M, description=""), C, K)),
        "the constant m has no description",
    ),
    (declared(constants=(M, C, dataclasses.replace(K, source=""))), "the constant k has no source"),
    (
        declared(constants=(M, C, dataclasses.replace(K, unit=""))),
        "write '1' for a dimensionless number",
    ),
    (declared(constants=(M, C, dataclasses.replace(K, unit=NOTHING))), "the unit None is empty"),
    (declared(inputs=(dataclasses.replace(F, on={}),)), "the input f acts on no coordinate"),
    (
        declared(outputs=(Output("x", X.q, "", "displacement"),)),
        "the output x: the unit '' is empty",
    ),
    # unknown
    (
        declared(scenarios=(scenario(q={X: 0.1, Y: 0.2}),)),
        "scenario 'free', q: 'y' is unknown here",
    ),
    (
        declared(scenarios=(scenario(inputs={F: 0, Input("g", "N", "force", {X: 1}): 1}),)),
        "inputs: 'g' is unknown here",
    ),
    (
        declared(inputs=(dataclasses.replace(F, on={Y: 1}),)),
        "the input f acts on an unknown coordinate",
    ),
    (declared(T=M * X.v**2 * STRAY), "T uses stray, which is not"),
    (declared(V=K * X.q * STRAY), "V uses stray, which is not declared"),
    (declared(D=STRAY * X.v**2), "D uses stray, which is not declared"),
    (declared(outputs=(Output("x", X.q + STRAY, "m", ""),)), "the output x uses stray"),
    (declared(inputs=(dataclasses.replace(F, on={X: STRAY}),)), "the input f uses stray"),
    (
        declared(scenarios=(scenario(q={X: STRAY}),)),
        "scenario 'free', q: the value of x depends on stray",
    ),
    (declared(scenarios=(scenario(q={X: t}),)), "the value of x depends on t"),
    (declared(scenarios=(scenario(inputs={F: -X.v}),)), "inputs: the value of f depends on x_dot"),
    (
        declared(
            published=(PublishedEquation("2.5", "x = 0", "poetry", of="x", driven=False, note=""),)
        ),
        "Eq. 2.5: unknown states 'poetry'; expected one of ['motion', 'linear', 'linear part',",
    ),
    (declared(constants=(M, C)), "V uses k, which is not declared"),
    (
        declared(quantities=(dataclasses.replace(BARE, expression=M * X.v * STRAY),)),
        "the quantity p uses stray",
    ),
    # impossible dimensions
    (
        declared(quantities=(dataclasses.replace(BARE, unit="N"),)),
        "the quantity p has the unit kg*m*s^-1",
    ),
    (
        declared(constants=(M, C, dataclasses.replace(K, unit="Nm"))),
        "the unit 'Nm' has an unknown part 'Nm'",
    ),
    (declared(T=M * X.v / 2), "T has the unit kg*m*s^-1"),
    (declared(V=K * X.q), "V has the unit kg*m*s^-2"),
    (declared(D=C * X.v * X.q), "D has the unit"),
    (declared(V=K * X.q**2 / 2 + M), "V: "),
    (declared(V=K * sp.sin(X.q) ** 2), "x in sin(x) has the unit m"),
    (declared(constants=(M, C, dataclasses.replace(K, unit="N*m"))), "V has the unit"),
    (declared(inputs=(dataclasses.replace(F, unit="N*m"),)), "the input f on x has the unit"),
    (declared(outputs=(Output("x", X.q, "rad", "displacement"),)), "the output x has the unit m"),
    # not differentiable, not mechanics
    (declared(V=K * sp.Abs(X.q) * X.q), "V is not differentiable: it has Abs(x)"),
    (declared(V=K * X.q**2 * sp.Heaviside(X.q)), "V is not differentiable"),
    (declared(V=K * sp.Piecewise((X.q**2, X.q > 0), (0, True))), "V is not differentiable"),
    (
        declared(D=C * SPEED * sp.Abs(X.v)) | {"constants": (M, C, K, SPEED)},
        "D is not differentiable: it has Abs(x_dot)",
    ),
    (declared(V=K * X.q**2 * sp.Function("h")(X.q)), "V is not differentiable"),
    (declared(V=M * X.v**2), "V must not depend on x_dot"),
    (declared(V=-F * X.q), "V must not depend on f"),
    (declared(D=M * X.v * X.a), "D must not depend on x_ddot"),
    (
        declared(D=C * X.v * SPEED, constants=(M, C, K, SPEED)),
        "D and its slope must be zero at rest",
    ),
    (
        declared(T=M * X.v**4 / SPEED**2, constants=(M, C, K, SPEED)),
        "T must be quadratic in the velocities",
    ),
    (two(T=M * (X.v + Y.v) ** 2 / 2), "the mass matrix of x, y is singular"),
    (two(T=M * X.v**2 / 2), "the mass matrix of x, y is singular"),
    (declared(T=0), "the mass matrix of x is singular"),
    (declared(T=ZERO * X.v**2 / 2, constants=(ZERO, C, K)), "the mass matrix of x is singular"),
    (
        declared(T=NEGATIVE * X.v**2 / 2, constants=(NEGATIVE, C, K)),
        "the mass matrix there is not positive definite",
    ),
    # names
    (declared(scenarios=(scenario(), scenario())), "two scenario entries named 'free'"),
    (
        declared(equilibria=(Equilibrium("rest", {X: 0}, False, ""),) * 2),
        "two equilibrium entries named 'rest'",
    ),
    (
        declared(outputs=(Output("x", X.q, "m", "displacement"),) * 2),
        "two output entries named 'x'",
    ),
    (declared(constants=(M, C, K, K)), "'k' is a constant and a con"),
    (declared(constants=(M, C, K, constant("x", 1.0, "m"))), "'x' is a coordinate and a constant"),
    (declared(inputs=(Input("m", "N", "force", {X: 1}),)), "'m' is a constant and a input"),
    (declared(constants=(M, C, K, constant("t", 1.0, "s"))), "'t' is the time"),
    (declared(constants=(M, C, K, constant("x_dot", 1.0, "m"))), "'x_dot' is a velocity"),
    (declared(constants=(M, C, K, constant("x_ddot", 1.0, "m"))), "'x_ddot' is an acceleration"),
    (
        declared(quantities=(dataclasses.replace(BARE, name="k"),)),
        "'k' is a constant and a quantity",
    ),
    (
        declared(quantities=(dataclasses.replace(BARE, description=""),)),
        "the quantity p has no description",
    ),
    (declared(constants=(M, C, K, constant("m 2", 1.0, "kg"))), "'m 2' is not an identifier"),
    # numbers
    (declared(constants=(M, C, dataclasses.replace(K, value=math.inf))), "the constant k is inf"),
    (declared(constants=(M, C, dataclasses.replace(K, value=math.nan))), "the constant k is nan"),
    (
        declared(constants=(M, C, Constant("k2", WORD, "N/m", "stiffness", "a test"))),
        "the constant k2 has no numeric value",
    ),
    (
        declared(constants=(M, C, dataclasses.replace(K, value=True))),
        "the constant k has no numeric value",
    ),
    (declared(scenarios=(scenario(duration=0.0),)), "the duration is 0"),
    (declared(scenarios=(scenario(duration=-1.0),)), "the duration is -1"),
    (
        declared(sketch=(Link("rope", (0, 0), (X.q, 0)),)),
        "shape 1 of the sketch: unknown kind 'rope'; expected one of ['spring',",
    ),
    (declared(sketch=((0, 0),)), "shape 1 of the sketch: (0, 0) is not a Link, Body or Angle"),
    (
        declared(sketch=(Body("disc", SPATIAL, 1, 1),)),
        "shape 1 of the sketch: a point must be a pair (x, y)",
    ),
    (
        declared(sketch=(Link("rod", (0, 0), (1, 0)), Body("disc", (STRAY, 0), 1, 1))),
        "shape 2 of the sketch, at x, uses stray, which is not declared",
    ),
    (
        declared(sketch=(Angle((0, 0), 1, 0, X.v),)),
        "shape 1 of the sketch, end, uses x_dot, which is not declared",
    ),
    (
        declared(sketch=(Body("block", (0, sp.exp(X.q)), 1, 1),)),
        "shape 1 of the sketch, at y: exp(x) can't be drawn",
    ),
    (declared(scenarios=(scenario(duration=1e-300),)), "the duration is 1e-300 s, shorter than"),
    (
        declared(scenarios=(scenario(name="a\nb"),)),
        "the scenario name 'a\\nb' has unprintable characters",
    ),
    (declared(title="\ud800"), "'\\ud800' is not Unicode text"),
    (declared(scenarios=(scenario(duration=math.inf),)), "duration is inf"),
]


@pytest.mark.parametrize(("fields", "sentence"), FAULTS)
def test_invalid_declaration_is_rejected_with_a_reason(
    fields: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(DeclarationError) as caught:
        System(**fields)
    assert sentence in str(caught.value)
    assert "system 'oscillator'" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_valid_system_passes() -> None:
    assert System(**declared()).values == {
        M.symbol: sp.Rational(1.3),
        C.symbol: sp.Rational(0.9),
        K.symbol: 47,
    }
    assert System(**two()).q == (X.q, Y.q)


# Sketches, quantities, frames and interactions are optional.
@pytest.mark.parametrize(
    "field",
    [
        f.name
        for f in dataclasses.fields(System)
        if f.name not in ("sketch", "quantities", "frames", "interactions")
    ],
)
def test_no_field_of_a_system_has_a_default(field: str) -> None:
    fields = declared()
    del fields[field]
    with pytest.raises(TypeError, match=f"missing 1 required keyword-only argument: '{field}'"):
        System(**fields)


@pytest.mark.parametrize(
    "kind",
    [Constant, Coordinate, Input, Output, Equilibrium, Scenario, PublishedEquation, Quantity],
)
def test_no_field_of_a_declared_item_has_a_default(kind: type) -> None:
    for field in dataclasses.fields(kind):
        assert field.default is dataclasses.MISSING
        assert field.default_factory is dataclasses.MISSING


def test_wrong_equilibrium_is_rejected_with_its_force() -> None:
    system = System(**declared(equilibria=(Equilibrium("off", {X: 0.01}, False, ""),)))
    with pytest.raises(
        DeclarationError, match=r"'off': is not an equilibrium: the force on x there is -.*k"
    ):
        linearize(derive(system), system.equilibria[0])


def test_search_without_equilibrium_is_rejected() -> None:
    slope = constant("a", 3.0, "N")
    system = System(
        **declared(
            V=slope * X.q,
            constants=(M, C, K, slope),
            equilibria=(Equilibrium("nowhere", {X: 0}, True, ""),),
        )
    )
    with pytest.raises(DeclarationError, match="'nowhere': no rest position found"):
        linearize(derive(system), system.equilibria[0])


def test_unknown_scenario_is_rejected_with_the_known_ones() -> None:
    with pytest.raises(KeyError, match="no scenario 'frei'; it has free"):
        System(**declared()).scenario("frei")


def test_constants_are_exact_doubles() -> None:
    assert built_in("mass_spring_damper").values[M.symbol] == sp.Rational(1.3)
    assert sp.Rational(1.3) != sp.Rational(13, 10)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Copy a built-in folder's declaration, to spoil it."""
    shutil.copy(MODELS / "mass_spring_damper" / "system.py", tmp_path)
    return tmp_path


def spoil(folder: Path, old: str, new: str) -> None:
    path = folder / "system.py"
    text = path.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))


@pytest.mark.parametrize("name", NAMES)
def test_built_in_folder_is_named_as_its_system(name: str) -> None:
    assert built_in(name).name == name


def test_folder_without_a_declaration_is_refused_naming_the_file(tmp_path: Path) -> None:
    with pytest.raises(DeclarationError, match=r"system\.py: no such file"):
        load_system(tmp_path)


MUTE = "type('Mute', (ValueError,), {'__str__': lambda self: 1 / 0})"
ENERGY = "V=k * x.q**2 / 2"
CALL = "system = System("


@pytest.mark.parametrize(("old", "new", "place", "sentence"), [
    ('x = Coordinate("x",', 'x = = Coordinate("x",', "x = =", "SyntaxError: invalid syntax"),
    (ENERGY, "V=kk * x.q**2 / 2", "V=kk", "NameError: name 'kk'"),
    (ENERGY, f"V=(_ for _ in ()).throw({MUTE}())", "V=(_ for",
     r"Mute: its message can't be shown \(ZeroDivisionError\)"),
    # A call is placed at its first line.
    ("    D=c * x.v**2 / 2,\n", "", CALL, ".*missing 1 field: 'D'"),
    (ENERGY, "V=k * x.q", CALL, "system 'mass_.*V has the u"),
])  # fmt: skip
def test_wrong_declaration_is_refused_with_file_and_line(
    folder: Path, old: str, new: str, place: str, sentence: str
) -> None:
    spoil(folder, old, new)
    line = (folder / "system.py").read_text().split(place)[0].count("\n") + 1
    with pytest.raises(DeclarationError, match=rf"system\.py:{line}: {sentence}"):
        load_system(folder)


def test_file_that_declares_no_system_is_refused_with_the_remedy(folder: Path) -> None:
    spoil(folder, CALL, "other = System(")
    with pytest.raises(DeclarationError, match=r"must end with `system = System\(\.\.\.\)`"):
        load_system(folder)


def test_two_folders_share_no_module_and_no_path(
    folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    other = tmp_path_factory.mktemp("other")
    shutil.copy(folder / "system.py", other)
    spoil(other, 'Constant("k", 47.0', 'Constant("k", 48.0')
    before = list(sys.path)
    first, second = load_system(folder), load_system(other)
    assert first.constants[2].value == 47.0
    assert second.constants[2].value == 48.0
    assert sys.path == before
