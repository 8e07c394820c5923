"""The sketch of a system as data: trees of positions with the constants inserted."""

import math

import numpy as np
import pytest
import sympy as sp

from physics_crosscheck import System
from physics_crosscheck.harness.checks.system_record import sketch_record, tree
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.render.html.systems import drawing, evaluate
from physics_crosscheck.reference.load import load_system
from physics_crosscheck.sketch import Link

NAMES = sorted(path.parent.name for path in builtin().glob("*/system.py"))


@pytest.fixture(scope="module")
def drum() -> System:
    return load_system(builtin() / "drum_pendulum")


@pytest.mark.parametrize("name", NAMES)
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


def test_tree_of_an_expression_contains_the_constants(drum: System) -> None:
    length = next(c for c in drum.constants if c.name == "l")
    theta = drum.coordinates[1]
    assert tree(length * sp.sin(theta.q), drum) == ["*", 0.6, ["sin", ["q", 1]]]
    assert tree(sp.pi / 2, drum) == pytest.approx(math.pi / 2)


def test_unknown_operation_of_a_sketch_is_refused() -> None:
    with pytest.raises(ValueError, match="unknown operation 'exec'"):
        evaluate(["exec", 1.0], [0.0])
