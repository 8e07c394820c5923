"""Physically impossible inertias are reported by link and line."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from physics_crosscheck.engine import Engine, LoadedModel, ModelSpec
from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.findings import inertia_findings
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.inertias import impossible_inertias
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.records import Outcome
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
def test_impossible_inertias_are_reported(
    tmp_path: Path, mass: str, moments: str, products: str, kinds: list[str]
) -> None:
    turned = '<origin xyz="1 2 3" rpy="0.3 0.4 0.5"/>'
    body = link("odd", inertial(mass, moments, products, turned))
    robot = read(tmp_path, link("base"), "<!-- a\ncomment -->", body)
    issues = impossible_inertias(robot)
    assert [issue.kind for issue in issues] == kinds
    assert {(issue.link, issue.line) for issue in issues} <= {("odd", 5)}
    for issue in issues:
        assert str(issue).startswith(f"{tmp_path / 'robot.urdf'}:5: link 'odd' has ")
        assert issue.remedy


def test_rounding_of_a_point_mass_is_accepted(tmp_path: Path) -> None:
    """Cover a tensor shifted to the center of mass, as in the file of iCub's head."""
    robot = read(tmp_path, link("head", inertial("1.3", "0 0 0", "0 2.4e-18 0", FAR)))
    assert impossible_inertias(robot) == ()
    near = read(tmp_path, link("head", inertial("1.3", "0 0 0", "0 2.4e-18 0")))
    assert [one.kind for one in impossible_inertias(near)] == ["moments"]


FAR = '<origin xyz="0.02 -0.11 0"/>'


def test_impossible_inertia_still_makes_a_tree(tmp_path: Path) -> None:
    body = link("odd", inertial("1", "1 1 3"))
    robot = read(tmp_path, link("base"), body, joint("j", "base", "odd"))
    assert tree_of(robot).nv == 1
    (issue,) = impossible_inertias(robot)
    assert issue.sentence == "link 'odd' has the principal moments of inertia 1, 1 and 3 kg m^2"


@pytest.mark.parametrize(
    ("moments", "products", "rounded"),
    [("0.123456 0.234567 0.358024", "0 0 0", True), ("0.0521 0.0521 0.1043", "0.0 0 0.0", True),
     ("0.333333 0.333334 0.000000", "0 0 0", True), ("0.123456 0.234567 0.358026", "0 0 0", False),
     ("0.300000 0.300000 0.300000", "0.000000 0.300001 0", True), ("1 1 3", "0 0 0", False)],
)  # fmt: skip
def test_rounded_digits_of_a_tensor_are_advice(
    tmp_path: Path, moments: str, products: str, rounded: bool
) -> None:
    """Catch a thin plate that is impossible in its last written digit only."""
    body = link("odd", inertial("1", moments, products))
    robot = read(tmp_path, link("base"), body, joint("j", "base", "odd"))
    assert [one.rounded for one in impossible_inertias(robot)] == [rounded]
    assert [one.severity for one in inertia_findings(robot)] == ["note" if rounded else "finding"]


def test_dominant_negative_mass_makes_no_tree(tmp_path: Path) -> None:
    body = link("odd", inertial("-1", "0 0 0", origin='<origin xyz="0 1 0"/>'))
    robot = read(tmp_path, link("base"), body, joint("j", "base", "odd"))
    assert robot.tree is None
    assert [one.kind for one in impossible_inertias(robot)] == ["negative mass"]


def _change_in_pybullet(model: Any) -> None:
    import pybullet as p

    mass, _, moments = p.getDynamicsInfo(model._body, 0)[:3]
    p.changeDynamics(model._body, 0, mass=1.5 * mass)
    p.changeDynamics(model._body, 0, localInertiaDiagonal=moments)


def _change_in_mujoco(model: Any) -> None:
    model.model.body_mass[1] *= 1.5


@pytest.mark.parametrize(
    ("engine", "change"), [("pybullet", _change_in_pybullet), ("mujoco", _change_in_mujoco)]
)
def test_mass_on_an_axis_is_compared_although_no_motion_shows_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, engine: str, change: Callable[[Any], None]
) -> None:
    read(tmp_path, link("base"), link("wheel", inertial("2", "1 1 1")), joint("j", "base", "wheel"))
    task = model_task(prepare_tree(tmp_path / "robot.urdf", states=4), engine)
    adapter = type(engines()[engine])
    load = adapter.load

    def changed(self: Engine, spec: ModelSpec) -> LoadedModel:
        model = load(self, spec)
        change(model)
        return model

    assert run_case(task).outcome is Outcome.AGREES
    monkeypatch.setattr(adapter, "load", changed)
    case = run_case(task)
    assert case.outcome is Outcome.DIFFERS
    assert "robot.urdf:3: mass of wheel is 2 by the file, and 3 as compiled" in case.reason


def test_all_impossible_inertias_of_a_refused_mjcf_are_named(tmp_path: Path) -> None:
    """Catch a negative mass that the first complaint of the compiler hides."""
    inertials = ('mass="1" diaginertia="1 0.1 0.1"', 'mass="-1" fullinertia="1 1 1 0 0 0"')
    bodies = "\n".join(f'<body><joint/><inertial pos="0 0 0" {one}/></body>' for one in inertials)
    file = tmp_path / "robot.xml"
    file.write_text(f"<mujoco><worldbody>\n{bodies}</worldbody></mujoco>")
    findings = inertia_findings(read_robot(file))
    assert [(one.kind, one.location and one.location.line) for one in findings] == [
        ("triangle", 2),
        ("negative mass", 3),
    ]
