"""Inertias that no body can have are told by link and line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.harness.modelfiles.inertias import impossible_inertias
from physics_crosscheck.harness.modelfiles.robot import LinkPart, Robot
from physics_crosscheck.reference.mechanism.bodies import RigidBody
from tests.robots.files import inertial, joint, link, read, tree_of


@pytest.mark.parametrize(
    ("mass", "moments", "products", "kinds"),
    [
        ("1", "1 1 2", "0 0 0", []),
        ("1", "1 1 2.000000001", "0 0 0", []),
        ("1", "1 1 2.00000001", "0 0 0", ["triangle"]),
        ("1", "0 1 1", "0 0 0", []),
        ("1", "0 0 0", "0 0 0", []),
        ("0", "0 0 0", "0 0 0", []),
        ("1", "1 1 1", "0.4 0 0", []),
        ("1", "1 1 1", "0.6 0 0", ["triangle"]),
        ("1", "1 1 1", "1.1 0 0", ["moments"]),
        ("1", "-1 1 1", "0 0 0", ["moments"]),
        ("-1", "1 1 1", "0 0 0", ["negative mass"]),
        ("-1", "1 1 3", "0 0 0", ["negative mass", "triangle"]),
        ("0", "1 1 1", "0 0 0", ["massless"]),
        ("1e-300", "1e-300 1e-300 3e-300", "0 0 0", ["triangle"]),
        ("1", "1e300 1e300 3e300", "0 0 0", ["triangle"]),
    ],
)
def test_the_rules_of_bodies(
    tmp_path: Path, mass: str, moments: str, products: str, kinds: list[str]
) -> None:
    turned = '<origin xyz="1 2 3" rpy="0.3 0.4 0.5"/>'
    body = link("odd", inertial(mass, moments, products, turned))
    robot = read(tmp_path, link("base"), "<!-- a\ncomment -->", body)
    found = impossible_inertias(robot)
    assert [one.kind for one in found] == kinds
    assert {(one.link, one.line) for one in found} <= {("odd", 5)}
    for one in found:
        assert str(one).startswith(f"{tmp_path / 'robot.urdf'}:5: link 'odd' has ")
        assert one.remedy


def test_what_rounding_leaves_of_a_point_mass_is_none(tmp_path: Path) -> None:
    """As iCub's head has it: brought to its center of mass from where its moments were 0.01."""
    robot = read(tmp_path, link("head", inertial("1.3", "0 0 0", "0 2.4e-18 0", FAR)))
    assert impossible_inertias(robot) == ()
    near = read(tmp_path, link("head", inertial("1.3", "0 0 0", "0 2.4e-18 0")))
    assert [one.kind for one in impossible_inertias(near)] == ["moments"]


FAR = '<origin xyz="0.02 -0.11 0"/>'


def test_what_is_impossible_is_no_obstacle_while_there_are_accelerations(tmp_path: Path) -> None:
    body = link("odd", inertial("1", "1 1 3"))
    robot = read(tmp_path, link("base"), body, joint("j", "base", "odd"))
    assert tree_of(robot).nv == 1
    (found,) = impossible_inertias(robot)
    assert found.sentence == "link 'odd' has the principal moments of inertia 1, 1 and 3 kg m^2"


def test_a_negative_mass_that_no_position_outweighs_is_in_the_way(tmp_path: Path) -> None:
    body = link("odd", inertial("-1", "0 0 0", origin='<origin xyz="0 1 0"/>'))
    robot = read(tmp_path, link("base"), body, joint("j", "base", "odd"))
    assert robot.tree is None
    assert [one.kind for one in impossible_inertias(robot)] == ["negative mass"]


def test_numbers_that_are_not_finite_are_told(tmp_path: Path) -> None:
    huge = RigidBody(name="x", parent=None, mass=1.0, inertia=(1.7e308,) * 6, inertia_rpy=(1, 1, 1))
    part = LinkPart(link=huge, line=3)
    none = np.zeros(0)
    robot = Robot(name="r", file=tmp_path, tree=None, parts=(part,), limits=(none, none), home=none,
                  left_out=(), obstacles=())  # fmt: skip
    assert [one.kind for one in impossible_inertias(robot)] == ["not finite"]
