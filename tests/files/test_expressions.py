"""Expressions in sidecars: exact arithmetic of declared names, and no way to run code."""

import pytest
import sympy as sp

from physics_crosscheck.harness.modelfiles.expressions import parse
from physics_crosscheck.harness.modelfiles.sidecar import SidecarError

m, r, angle, arm = sp.symbols("m r angle arm")
NAMES = {"m": m, "r": r, "bob.angle": angle, "left arm.x": arm}


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
    assert parse(text, NAMES, "here") == expected


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
        parse(text, NAMES, "f.toml: [bindings] a")
    assert str(refused.value).startswith("f.toml: [bindings] a: ")
