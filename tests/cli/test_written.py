"""What results.json has of a system to look at: mathematics and the sketch."""

import math
from xml.etree.ElementTree import fromstring

import numpy as np
import pytest
import sympy as sp

from harness.cases.sketch import sketch_record, tree
from harness.files.folders import builtin
from harness.report.drawing import drawing, evaluate
from harness.text.mathml import matrix, rational, writer
from reference.load import load_system
from reference.modes import s

NAMES = sorted(path.parent.name for path in builtin().glob("*/system.py"))


def flat(mathml: str) -> str:
    """The text of written mathematics, its structure as brackets."""

    def walk(element) -> str:
        inner = [walk(child) for child in element]
        match element.tag:
            case "mfrac":
                return f"({inner[0]})/({inner[1]})"
            case "msup":
                return f"{inner[0]}^{inner[1]}"
            case "msub":
                return f"{inner[0]}_{inner[1]}"
            case "mover":
                return f"{inner[0]}{inner[1]}"
        return (element.text or "") * (not inner) + "".join(inner)

    return walk(fromstring(mathml)).replace("\u2062", " ")


@pytest.fixture(scope="module")
def drum():
    return load_system(builtin() / "drum_pendulum")


def test_derivatives_have_dots_and_greek_names_are_letters(drum):
    write = writer(drum)
    (x, theta) = drum.coordinates
    assert flat(write(x.v)) == "x\u02d9"
    assert flat(write(theta.a**2)) == "θ\u00a8^2"
    assert flat(write(sp.Rational(3, 2) * x.q)) == "(3 x)/(2)"
    pair = load_system(builtin() / "free_pair")
    assert flat(writer(pair)(pair.coordinates[0].v)) == "x\u02d9_1", "the dot is on the letter"


def test_a_transfer_function_has_falling_powers_and_a_positive_highest_one(drum):
    write = writer(drum)
    k, m = (next(c.symbol for c in drum.constants if c.name == name) for name in "km")
    assert flat(rational(write, -1 / (k - m * s**2), s)) == "(1)/(m s^2−k)"
    assert flat(rational(write, sp.Integer(0), s)) == "0"
    assert flat(matrix(write, [[k, 0], [0, m]])) == "[k00m]"


def test_what_is_written_is_well_formed_without_entities(drum):
    for expression in (drum.T, drum.V, sp.Eq(drum.T, drum.V)):
        assert "&" not in writer(drum)(expression).replace("&#", "")
        fromstring(writer(drum)(expression))


@pytest.mark.parametrize("name", NAMES)
def test_the_built_in_sketches_show_every_coordinate_and_stay_together(name):
    """The trees say what the expressions say, in any position."""
    system = load_system(builtin() / name)
    record = sketch_record(system)
    kinds = {shape["kind"] for shape in record["shapes"]}
    assert kinds & {"spring", "rod", "spiral"}
    labels = {shape["label"] for shape in record["shapes"]}
    assert {c.name for c in system.coordinates} <= labels
    random = np.random.default_rng(3)
    q = random.uniform(-2, 2, len(system.coordinates))
    values = dict(zip(system.q, map(float, q), strict=True)) | system.values
    for shape, declared in zip(record["shapes"], system.sketch, strict=True):
        if "at" in shape:
            for found, expected in zip(shape["at"], declared.at, strict=True):
                exact = float(sp.sympify(expected).subs(values))
                assert evaluate(found, q) == pytest.approx(exact, abs=1e-7)
    assert drawing(record, [c.name for c in system.coordinates]).told


def test_a_tree_is_small_and_has_the_constants_in_it(drum):
    length = next(c for c in drum.constants if c.name == "l")
    theta = drum.coordinates[1]
    assert tree(length * sp.sin(theta.q), drum) == ["*", 0.6, ["sin", ["q", 1]]]
    assert tree(sp.pi / 2, drum) == pytest.approx(math.pi / 2)


def test_a_strange_operation_in_a_sketch_is_refused():
    with pytest.raises(ValueError, match="no operation 'exec' is known"):
        evaluate(["exec", 1.0], [0.0])
