"""Bindings: literals that stand for expressions of constants, and their text."""

import math
import os
import re
import shutil
import sys
from fractions import Fraction
from pathlib import Path
from typing import Any, Protocol

import pytest
import sympy as sp

from physics_crosscheck import DeclarationError, System
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.bindings import (
    at_constants,
    bindings,
    locate,
    mismatches,
    rewrite,
    with_literals,
)
from physics_crosscheck.harness.modelfiles.expressions import parse
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, SidecarError, read_sidecar
from physics_crosscheck.reference.load import load_system
from tests.physics import copy_with_constants

URDF = """<!-- Rod: <mass value="0.8"/>, gravity in the sidecar; à la carte. -->
<robot name="r"><link name="rod"><inertial>
  <mass value='0.8'/><origin xyz="0\t0  -0.3"/><inertia ixx="0.024" iyy="0.02400"/>
</inertial></link></robot>
"""
SIDECAR = """engines = ["pybullet"] # ü
[settings]
step = 0.002
gravity = [0, 0, -9.81]
[bindings]
"sidecar:settings.gravity[2]" = "-g"
"mass@value" = "m"
"inertia@ixx" = "m*l**2/12"
"inertia@iyy" = "m*l**2/12"
"origin@xyz[2]" = "-l/2"
"""
NAMES = ["sidecar:settings.gravity[2]", "mass@value", "inertia@ixx", "inertia@iyy", "origin@xyz[2]"]


class Write(Protocol):
    """Writes the model and its sidecar, with changes and line ends, and reads the sidecar."""

    def __call__(self, *changes: tuple[str, str], end: str = "\n") -> Sidecar: ...


@pytest.fixture(scope="module")
def drum() -> System:
    return load_system(builtin() / "drum_pendulum")


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def make(*changes: tuple[str, str], end: str = "\n") -> Sidecar:
        texts = [URDF, SIDECAR]
        for old, new in changes:
            assert old in "".join(texts)
            texts = [text.replace(old, new) for text in texts]
        folder = tmp_path / "model"
        folder.mkdir(exist_ok=True)
        for name, text in zip(("robot.urdf", "robot.urdf.toml"), texts, strict=True):
            (folder / name).write_bytes(text.replace("\n", end).encode())
        return read_sidecar(folder / "robot.urdf.toml")

    return make


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


# Expected values of literals.


def test_binding_has_actual_and_expected_value(drum: System, write: Write) -> None:
    bound = bindings(drum, write(('ixx="0.024"', 'ixx="0.025"')))
    assert [b.address for b in bound] == NAMES
    gravity, mass, inertia = bound[:3]
    assert (gravity.value, gravity.expected) == (-9.81, -9.81)
    assert gravity.place.file.name == "robot.urdf.toml"
    assert (mass.expression, mass.value, str(mass.place)[-12:]) == ("m", 0.8, "robot.urdf:3")
    assert inertia.expected == pytest.approx(0.024, rel=1e-15)
    assert inertia.error == pytest.approx(1 / 24)
    assert mismatches(bound) == (inertia,)


def test_expected_value_is_correctly_rounded(drum: System, write: Write) -> None:
    changes = ("'0.8'", "'0.4'"), ('"mass@value" = "m"', '"mass@value" = "M/6"')
    axle = bindings(drum, write(*changes))[1]
    assert axle.expected == float(Fraction(2.4) / 6)
    assert axle.expected != 0.4  # 2.4 is no double
    assert axle.exact
    root = bindings(drum, write(('"mass@value" = "m"', '"mass@value" = "sqrt(l**2 + 0.28)"')))[1]
    assert root.expected == pytest.approx(0.8, rel=2e-16)
    assert root.exact


def ulps(value: float, count: int) -> float:
    for _ in range(abs(count)):
        value = math.nextafter(value, math.copysign(math.inf, count))
    return value


@pytest.mark.parametrize(("literal", "kind"), [
    ("0.024", "exact"),
    (repr(ulps(0.024, 1)), "exact"),
    (repr(ulps(0.024, 9)), "wrong"),
    (repr(ulps(0.024, -9)), "wrong"),
    ("0.024000001", "wrong"),
    ("2.4000001e-2", "wrong"),
    ("-0.024", "wrong"),
    ("0.0240000", "exact"),
])  # fmt: skip
def test_literal_is_exact_within_rounding(
    drum: System, write: Write, literal: str, kind: str
) -> None:
    bound = bindings(drum, write(('ixx="0.024"', f'ixx="{literal}"')))
    assert bound[2].exact == (kind == "exact")
    assert mismatches(bound) == (() if kind == "exact" else (bound[2],))


@pytest.mark.parametrize(("literal", "rounded"), [
    ("5.555556", True),
    ("5.55556", True),
    ("0.555556e1", True),
    ("5.555555", False),  # cut off
    ("5.555557", False),
    ("5.5556", False),  # too few digits to be taken for a rounding
    ("6", False),
    ("5.555555555555555", False),  # exact, so not rounded
])  # fmt: skip
def test_short_literal_passes_if_correctly_rounded(
    drum: System, write: Write, literal: str, rounded: bool
) -> None:
    bound = bindings(drum, write(('ixx="0.024"', f'ixx="{literal}"'), ('"m*l**2/12"', '"1/r"')))
    assert bound[2].rounded == rounded
    assert (bound[2] in mismatches(bound)) == (not rounded and literal != "5.555555555555555")
    if rounded:
        assert bound[2].error == pytest.approx((float(literal) - 1 / 0.18) * 0.18, rel=1e-9)


def test_wrong_zero_and_wrong_nonzero_literal_differ(drum: System, write: Write) -> None:
    changes = ("0\t0  -0.3", "0\t0  0.0000000"), ('"mass@value" = "m"', '"mass@value" = "m - m"')
    bound = bindings(drum, write(*changes))
    assert mismatches(bound) == (bound[1], bound[4])
    assert bound[1].error == 0.8


def test_correction_is_the_shortest_correct_decimal(drum: System, write: Write) -> None:
    bound = bindings(drum, write())
    assert [repr(b.correction) for b in bound] == ["-9.81", "0.8", "0.024", "0.024", "-0.3"]


@pytest.mark.parametrize(("change", "sentence"), [
    (('"mass@value" = "m"', '"mass@value" = "n"'), "n is neither a coordinate nor a constant"),
    (('"mass@value" = "m"', '"mass@value" = "theta"'), "theta is neither"),
    (('"mass@value" = "m"', '"mass@value" = "m*"'), "can't read 'm\\*'"),
    (('"mass@value" = "m"', '"mass@value" = "m/0"'), "not a finite real number"),
    (('"mass@value" = "m"', '"mass@value" = "sqrt(-m)"'), "not a finite real number"),
    (('"mass@value" = "m"', '"mass@value" = "log(m - m)"'), "not a finite real number"),
    (('"mass@value" = "m"', '"mass@value" = "m"\n"link/inertial/mass@value" = "m"'),
     r"'link/inertial/mass@value' is the same number as 'mass@value' \(.*urdf:3\); keep one"),
])  # fmt: skip
def test_invalid_binding_is_refused(
    drum: System, write: Write, change: tuple[str, str], sentence: str
) -> None:
    sidecar = write(change)
    with pytest.raises(SidecarError, match=sentence) as refused:
        bindings(drum, sidecar)
    place, _, rest = str(refused.value).partition(": [bindings] '")
    assert re.fullmatch(rf"{re.escape(str(sidecar.model))}\.toml:\d+", place), rest


def test_binding_to_a_missing_address_is_refused(drum: System, write: Write) -> None:
    with pytest.raises(LocationError, match=r"robot\.urdf: .*no masses; nearest: mass"):
        bindings(drum, write(('"mass@value"', '"masses@value"')))
    with pytest.raises(LocationError, match=r"robot\.urdf\.toml: 'settings\.gravitas"):
        bindings(drum, write(("settings.gravity", "settings.gravitas")))


def test_sidecar_without_bindings_has_none(drum: System, write: Write) -> None:
    assert bindings(drum, write((SIDECAR[SIDECAR.index("[bindings]") :], ""))) == ()


# Copies.


@pytest.mark.parametrize("end", ["\n", "\r\n"], ids=["LF", "CRLF"])
def test_copy_differs_only_in_the_literals(write: Write, tmp_path: Path, end: str) -> None:
    sidecar = write(end=end)
    before = contents(sidecar.model.parent)
    copy = with_literals(
        sidecar,
        {"origin@xyz[2]": -1 / 3, "mass@value": 1e-7, "sidecar:settings.gravity[2]": -10.0},
        tmp_path / "copy",
    )
    assert contents(sidecar.model.parent) == before
    after = contents(tmp_path / "copy")
    assert after["robot.urdf"] == before["robot.urdf"].replace(
        b"value='0.8'", b"value='1e-07'"
    ).replace(b"-0.3", b"-0.3333333333333333")
    assert after["robot.urdf.toml"] == before["robot.urdf.toml"].replace(b"-9.81]", b"-10.0]")
    assert copy.model == tmp_path / "copy" / "robot.urdf"
    assert copy.settings["gravity"] == [0, 0, -10.0]
    assert locate(copy, ["origin@xyz[2]"])["origin@xyz[2]"].value == -1 / 3


def test_literal_with_an_equal_value_is_not_rewritten(write: Write, tmp_path: Path) -> None:
    sidecar = write()
    with_literals(sidecar, {"inertia@iyy": 0.024, "mass@value": 0.8}, tmp_path / "copy")
    assert contents(tmp_path / "copy") == contents(sidecar.model.parent)


def test_unbound_number_can_be_replaced(write: Write, tmp_path: Path) -> None:
    copy = with_literals(write(), {"origin@xyz[0]": 0.1}, tmp_path / "copy")
    assert b'xyz="0.1\t0  -0.3"' in copy.model.read_bytes()


def test_copy_has_the_other_files_of_the_folder(write: Write, tmp_path: Path) -> None:
    sidecar = write()
    folder = sidecar.model.parent
    (folder / "meshes").mkdir()
    (folder / "meshes" / "rod.stl").write_text("solid")
    (folder / "other.urdf").write_text(URDF)
    (folder / "system.py").write_text("raise SystemExit")
    into = folder / "copies" / "one"
    with_literals(sidecar, {"mass@value": 1.0}, into)
    assert (into / "meshes" / "rod.stl").read_text() == "solid"
    assert {path.name for path in into.iterdir()} == {
        "robot.urdf",
        "robot.urdf.toml",
        "meshes",
        "other.urdf",
    }
    # A copy of another model in the same folder replaces the link, not its target.
    shutil.copy(folder / "robot.urdf.toml", folder / "other.urdf.toml")
    other = read_sidecar(folder / "other.urdf.toml")
    with_literals(other, {"mass@value": 2.0}, into)
    assert (folder / "other.urdf").read_text() == URDF
    assert "2.0" in (into / "other.urdf").read_text()


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_value_that_is_not_finite_is_refused(write: Write, tmp_path: Path, value: float) -> None:
    with pytest.raises(ValueError, match="'mass@value' can't be"):
        with_literals(write(), {"mass@value": value}, tmp_path / "copy")
    assert not (tmp_path / "copy").exists()


def test_copy_never_overwrites_the_original(write: Write) -> None:
    sidecar = write()
    before = contents(sidecar.model.parent)
    with pytest.raises(ValueError, match="choose another folder for the copies"):
        with_literals(sidecar, {"mass@value": 1.0}, sidecar.model.parent / "." / "")
    assert contents(sidecar.model.parent) == before


def test_two_addresses_of_one_number_must_agree(write: Write, tmp_path: Path) -> None:
    with pytest.raises(LocationError, match="the same number as one that is set"):
        with_literals(write(), {"mass@value": 1.0, "inertial/mass@value": 2.0}, tmp_path / "copy")


def test_changed_constants_update_every_dependent_literal(
    drum: System, write: Write, tmp_path: Path
) -> None:
    sidecar = write()
    copy = copy_with_constants(drum, sidecar, {"l": 0.9}, tmp_path / "copy")
    assert {a: p.value for a, p in locate(copy, NAMES).items()} == {
        "sidecar:settings.gravity[2]": -9.81,
        "mass@value": 0.8,
        "origin@xyz[2]": -0.45,
        "inertia@ixx": pytest.approx(0.054, rel=1e-15),
        "inertia@iyy": pytest.approx(0.054, rel=1e-15),
    }
    changed = at_constants(drum, {"l": 0.9})
    assert mismatches(bindings(changed, copy)) == ()
    assert len(mismatches(bindings(drum, copy))) == 3


def test_system_at_other_constants_keeps_its_equations(drum: System) -> None:
    changed = at_constants(drum, {"l": 1.2, "g": 1.62})
    assert {c.name: c.value for c in changed.constants} == {
        "M": 2.4,
        "r": 0.18,
        "m": 0.8,
        "l": 1.2,
        "k": 65.0,
        "g": 1.62,
    }
    assert changed.T == drum.T
    assert changed.values.keys() == drum.values.keys()
    assert drum.constants[3].value == 0.6


@pytest.mark.parametrize(("constants", "sentence"), [
    ({"L": 1.0}, "drum_pendulum has no constant 'L'; it has M, r, m, l, k, g"),
    ({"l": -1.0}, r"l is declared positive and can't be varied to -1\.0"),
    ({"l": 0.0}, "can't be varied to 0"),
    ({"l": math.nan}, "can't be varied to nan"),
])  # fmt: skip
def test_invalid_constants_are_refused(
    drum: System, constants: dict[str, float], sentence: str
) -> None:
    with pytest.raises(DeclarationError, match=sentence):
        at_constants(drum, constants)


@pytest.mark.skipif(engines()["pymunk"].version() is None, reason="pymunk is not installed")
def test_python_model_rewritten_within_a_second_is_reloaded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    # Python compares path, second and size, all equal here, to detect stale bytecode.
    sidecar = read_sidecar(builtin() / "torsional_disc" / "space.py.toml")
    for value in (0.022, 0.023, 0.024):
        copy = with_literals(sidecar, {"INERTIA": value}, tmp_path / "copy")
        os.utime(copy.model, (1e9, 1e9))
        model: Any = engines()["pymunk"].load(copy.spec("pymunk"))
        assert model._bodies["disc"].moment == value


# In place.


def test_model_is_corrected_in_place(drum: System, write: Write) -> None:
    sidecar = write(("'0.8'", "'0.800001'"), ("-9.81", "-9.8"))
    os.chmod(sidecar.model, 0o640)
    wrong = mismatches(bindings(drum, sidecar))
    assert len(wrong) == 2
    rewrite(sidecar, {b.address: b.correction for b in wrong})
    assert sidecar.model.read_bytes() == URDF.encode()
    assert sidecar.model.stat().st_mode & 0o777 == 0o640
    assert (sidecar.model.parent / "robot.urdf.toml").read_bytes() == SIDECAR.encode()


def test_failed_rewrite_changes_no_file(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    sidecar = write()
    before = contents(sidecar.model.parent)
    with pytest.raises(LocationError):
        rewrite(sidecar, {"mass@value": 1.0, "sidecar:settings.gravitas": 2.0})
    assert contents(sidecar.model.parent) == before

    def full(*_: object) -> None:
        raise OSError("no space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OSError, match="no space"):
        rewrite(sidecar, {"mass@value": 1.0})
    assert contents(sidecar.model.parent) == before


def test_rewrite_through_a_link_keeps_the_link(write: Write, tmp_path: Path) -> None:
    sidecar = write()
    linked = tmp_path / "linked"
    linked.mkdir()
    for name in ("robot.urdf", "robot.urdf.toml"):
        (linked / name).symlink_to(sidecar.model.parent / name)
    rewrite(read_sidecar(linked / "robot.urdf.toml"), {"mass@value": 1.0})
    assert (linked / "robot.urdf").is_symlink()
    assert b"value='1.0'" in sidecar.model.read_bytes()


m, r, angle, arm = sp.symbols("m r angle arm")
SYMBOL_NAMES = {"m": m, "r": r, "bob.angle": angle, "left arm.x": arm}


@pytest.mark.parametrize(("text", "expected"), [
    ("m", m),
    (" -r/2 ", -r / 2),
    ("m*r**2/12", m * r**2 / 12),
    ("0.1", sp.Rational(1, 10)),
    ("1e-3 * m", m / 1000),
    ("1_000", sp.Integer(1000)),
    ("2*pi*sqrt(r)", 2 * sp.pi * sp.sqrt(r)),
    ("sin(bob.angle) + atan2(m, -r)", sp.sin(angle) + sp.atan2(m, -r)),
    ("left arm.x - 1.2", arm - sp.Rational(6, 5)),
])  # fmt: skip
def test_expression_is_read_exactly(text: str, expected: sp.Expr) -> None:
    assert parse(text, SYMBOL_NAMES, "here") == expected


@pytest.mark.parametrize(("text", "sentence"), [
    ("m*", "can't read 'm\\*'"),
    ("", "can't read ''"),
    ("m^2", r"write a power as \*\*"),
    ("q", "q is neither a coordinate nor a constant"),
    ("M", "M is neither"),
    ("m.r", "'m.r' is not a number"),
    ("len(m)", "'len.m.' is not a"),
    ("sin(x=m)", "is not a number"),
    ("True", "'True' is not a"),
    ("'m'", "is not a number"),
    ("m if r else m", "is not a number"),
    ("m < r", "is not a number"),
    ("(1).__class__", "is not a number"),
    ("__import__('os').getcwd()", "is not a number"),
    ("[m for m in (r,)]", "is not a number"),
])  # fmt: skip
def test_text_other_than_arithmetic_of_declared_names_is_refused(text: str, sentence: str) -> None:
    with pytest.raises(SidecarError, match=sentence) as refused:
        parse(text, SYMBOL_NAMES, "f.toml: [bindings] a")
    assert str(refused.value).startswith("f.toml: [bindings] a: ")
