"""Sweep of a folder that declares bodies: numbers of its model files are drawn."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from physics_crosscheck.harness.extras.sweep import trees
from physics_crosscheck.harness.extras.sweep.case import run_block, swept
from physics_crosscheck.harness.extras.sweep.factors import SweepError
from physics_crosscheck.harness.extras.sweep.plan import CasePlan
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.jobs.workers import Workers
from physics_crosscheck.harness.modelfiles.numbers import copy_with_texts
from physics_crosscheck.harness.records.sweep import SweepRow
from physics_crosscheck.records import Outcome
from tests.mutation.test_trees import MODEL, SYSTEM
from tests.robots.files import inertial, joint, link
from tests.sweep.made import options, plan_of

MASS, DAMPING = "body[arm]/inertial@mass=1:4", "joint[swing]@damping=0.05:0.4"

BRANCHES = """from physics_crosscheck import Joint, MultibodySystem, RigidBody


def arm(name: str, mass: float, damping: float, parent: str | None = None) -> RigidBody:
    return RigidBody(
        name=name, parent=parent, position=(0.0, 0.0, 0.2), mass=mass, center=(0.3, 0.0, 0.0),
        inertia=(0.1, 0.2, 0.3, 0.0, 0.0, 0.0),
        joints=(Joint(name=f"j_{name}", kind="hinge", axis=(0.0, 1.0, 0.0), damping=damping),),
    )


base = arm("base", 2.0, 0.1)
system = MultibodySystem(
    name="branches", title="two arms on one", source="a test", gravity=(0.0, 0.0, -9.81),
    bodies=(base, arm("left", 1.0, 0.2, "base"), arm("right", 3.0, 0.3, "base")),
)
"""
HINGE = (
    '<joint name="j_{0}" axis="0 1 0" damping="{1}"/>'
    '<inertial mass="{2}" pos="0.3 0 0" diaginertia="0.1 0.2 0.3"/>'
)
OTHER_ORDER = (
    '<mujoco><option timestep="0.002"/><worldbody><body name="base" pos="0 0 0.2">'
    + HINGE.format("base", 0.1, 2)
    + '<body name="right" pos="0 0 0.2">' + HINGE.format("right", 0.3, 3) + "</body>"
    + '<body name="left" pos="0 0 0.2">' + HINGE.format("left", 0.2, 1) + "</body>"
    + "</body></worldbody></mujoco>"
)  # fmt: skip
URDF = "\n".join((
    '<robot name="swing"><link name="world"/>',
    link("arm", inertial("2.0", "0.1 0.2 0.3", origin='<origin xyz="0.3 0 0"/>')),
    joint("swing", "world", "arm",
          '<origin xyz="0 0 1"/><axis xyz="0 1 0"/><dynamics damping="0.1"/>'),
    "</robot>",
))  # fmt: skip


@pytest.fixture(scope="module")
def workers() -> Iterator[Workers]:
    with Workers(2) as pool:
        yield pool


def model(folder: Path, name: str, text: str, more: str = "") -> None:
    (folder / name).write_text(text)
    sidecar = f'engines = ["mujoco"]\n\n[settings]\nsmooth = true\n{more}'
    (folder / f"{name}.toml").write_text(sidecar)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Create one arm on a hinge: its declared bodies and an MJCF."""
    folder = tmp_path / "swing"
    folder.mkdir()
    (folder / "system.py").write_text(SYSTEM)
    model(folder, "m.xml", MODEL)
    return folder


def plan(folder: Path, workers: Workers, *vary: str) -> CasePlan:
    return plan_of(folder, replace(options(*vary), engines=("mujoco",)), workers)


def rows(whole: CasePlan) -> list[SweepRow]:
    swept.cache_clear()
    return [row for block in whole.blocks(bytes(whole.count)) for row in run_block(block)]


def test_drawn_numbers_of_a_model_file_agree_and_move_the_arm(
    folder: Path, workers: Workers
) -> None:
    results = rows(plan(folder, workers, MASS, DAMPING))
    assert [row.outcome for row in results] == [Outcome.AGREES] * 3
    assert len({row.discrepancy for row in results}) == 3
    assert {row.scenario for row in results} == {"states"}
    assert all(1 <= row.constants["body[arm]/inertial@mass"] <= 4 for row in results)


def test_wrong_number_in_a_drawn_copy_differs(
    folder: Path, workers: Workers, monkeypatch: pytest.MonkeyPatch
) -> None:
    def copy_with_fault(file: Path, texts: Mapping[Path, bytes], place: Path) -> Path:
        copy = copy_with_texts(file, texts, place)
        copy.write_text(
            copy.read_text().replace('diaginertia="0.1 0.2', 'diaginertia="0.1 0.20001')
        )
        return copy

    monkeypatch.setattr(trees, "copy_with_texts", copy_with_fault)
    results = rows(plan(folder, workers, MASS))
    assert [row.outcome for row in results] == [Outcome.DIFFERS] * 3


def test_joints_in_another_order_are_matched_by_name(folder: Path, workers: Workers) -> None:
    (folder / "system.py").write_text(BRANCHES)
    model(folder, "m.xml", OTHER_ORDER)
    results = rows(plan(folder, workers, "joint[j_left]@damping=0.1:2"))
    assert [row.outcome for row in results] == [Outcome.AGREES] * 3
    assert [row.outcome for row in rows(plan(folder, workers))] == [Outcome.AGREES]


def test_model_without_varied_numbers_is_skipped(folder: Path, workers: Workers) -> None:
    model(folder, "m.urdf", URDF)
    whole = plan(folder, workers, MASS)
    assert whole.left_out == ("swing/m.urdf [mujoco] has none of the varied numbers",)
    assert {row.model for row in rows(whole)} == {"m.xml"}
    both = rows(plan(folder, workers, "*mass*=x0.5:x2"))
    assert {(row.model, *row.constants) for row in both} == {
        ("m.xml", "body[arm]/inertial@mass"),
        ("m.urdf", "link[arm]/inertial/mass@value"),
    }
    assert {row.outcome for row in both} == {Outcome.AGREES}


def test_address_with_two_values_is_rejected(folder: Path, workers: Workers) -> None:
    model(folder, "other.xml", MODEL.replace('mass="2.0"', 'mass="2.5"'))
    with pytest.raises(SweepError, match=r"inertial@mass is 2\.0 or 2\.5, depending on the model"):
        plan(folder, workers, MASS)


SPRING = "\n[[spring]]\njoints = { swing = 1 }\nstiffness = 1.0\ndamping = 0\nrest = 0\n"


@pytest.mark.parametrize(
    ("name", "text", "more"),
    [
        ("m.xml", MODEL.replace('mass="2.0"', 'mass="2.00001"'), ""),
        ("m.urdf", URDF, SPRING),  # it would need the spring's effect at each drawn mass
    ],
)
def test_file_that_differs_from_the_declaration_is_rejected(
    folder: Path, capsys: pytest.CaptureFixture[str], name: str, text: str, more: str
) -> None:
    if more:
        spring = 'name="swing", kind="hinge", stiffness=1.0,'
        declared = SYSTEM.replace('name="swing", kind="hinge",', spring)
        (folder / "system.py").write_text(declared)
    model(folder, name, text, more)
    arguments = ["sweep", str(folder / name), "--vary", "*mass*=1:4", "--draws", "2"]
    assert main([*arguments, "--out", str(folder.parent / "out")]) == 2
    message = " ".join(capsys.readouterr().err.split())
    assert f"{name}: the file alone differs from system.py by" in message
    assert "crosscheck run" in message
