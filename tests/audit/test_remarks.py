"""What engines do on their own is told, with the line that it stands in."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from physics_crosscheck.harness.checks.audit import where
from physics_crosscheck.harness.engines.mujoco import MujocoModel
from physics_crosscheck.harness.engines.protocol import Array, LoadedModel
from physics_crosscheck.harness.engines.remark import Remark
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.harness.records.base import SourceLine
from tests.audit.models import MODELS, Look, said


def test_what_a_model_remarks_on_itself_is_told_with_its_line(
    look: Look, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def remarks(self: LoadedModel, z: Array, w: Array) -> Iterator[Remark]:
        yield Remark(message="a word")
        yield Remark(message="a number", address="body/joint[theta]@damping", value=2.0)
        yield Remark(message="the file", address="")

    monkeypatch.setattr(MujocoModel, "remarks", remarks)
    found = [f for f in look("simple_pendulum", "mujoco.xml", "mujoco") if f.kind == "default"]
    assert [f.message for f in found] == ["a word", "a number", "the file"]
    assert found[0].location is None
    assert [f.location and Path(f.location.file).name for f in found[1:]] == ["mujoco.xml"] * 2
    assert found[1].location is not None
    assert found[1].location.line is not None
    assert found[2].location == SourceLine(file=str(tmp_path / "mujoco.xml"))


def test_a_model_that_has_nothing_to_say_of_itself_says_nothing() -> None:
    silent: Any = None
    assert tuple(LoadedModel.remarks(silent, np.zeros((1, 1)), np.zeros((1, 1)))) == ()


SWITCHED_ON = [
    ("link_damping = 0.04", "damping of links", "link damping (0.04)", False),
    ("motors = true", "motors", "joint motors", True),
    ("inertia_from_file = false", "inertias of collision shapes", "inertia from", False),
]


@pytest.mark.parametrize(("setting", "called", "part", "fault"), SWITCHED_ON)
def test_what_a_setting_leaves_on_in_pybullet_is_not_said_to_be_off(
    look: Look, setting: str, called: str, part: str, fault: bool
) -> None:
    change = ("[settings]\n", f"[settings]\n{setting}\n")
    found = look("simple_pendulum", "robot.urdf", "pybullet", change)
    off = next(f for f in found if "are switched off by the adapter" in f.message)
    for _, _, other, _ in SWITCHED_ON:
        assert (other in off.message) == (other != part)
    assert "speed limit" in off.message
    on = next(f for f in found if "left on" in f.message)
    assert on.message.startswith(f"PyBullet's own {called}, left on by the setting")
    assert on.location is not None
    toml = Path(on.location.file)
    assert toml.name == "robot.urdf.toml"
    assert toml.read_text().splitlines()[(on.location.line or 0) - 1] == setting
    if fault:
        assert on.severity == "finding"


def test_nothing_is_said_to_be_left_on_where_all_is_off(look: Look) -> None:
    found = look("simple_pendulum", "robot.urdf", "pybullet")
    off = next(f for f in found if "are switched off" in f.message)
    assert off.message == (
        "PyBullet's own link damping (0.04), joint motors, speed limit, inertia from collision"
        " shapes and gravity are switched off by the adapter"
    )
    assert not any("left on" in f.message for f in found)


def test_a_damping_that_the_sidecar_sets_is_told_with_its_line(look: Look) -> None:
    found = look(
        "simple_pendulum", "space.py", "pymunk", ("[settings]\n", "[settings]\ndamping = 0.99\n")
    )
    damped = next(f for f in found if "Space.damping is 0.99" in f.message)
    assert "space.py.toml:" in str(damped.location)


def line_with(file: Path, text: str) -> int:
    """The line, counted from 1, of the one line that has a text."""
    (found,) = [i for i, line in enumerate(file.read_text().splitlines(), 1) if text in line]
    return found


def test_a_comment_or_a_look_alike_before_a_joint_is_not_taken_for_it(
    look: Look, tmp_path: Path
) -> None:
    armed = '<joint name="theta" type="hinge" armature="0.001"'
    found = look(
        "simple_pendulum",
        "mujoco.xml",
        "mujoco",
        (
            "<worldbody>",
            """<!-- <joint name="theta" armature="1"/> -->
  <custom><numeric name="theta" data="1"/></custom>
  <equality><joint name="theta" joint1="theta" active="false"/></equality>
  <worldbody>""",
        ),
        ('<joint name="theta" type="hinge"', armed),
    )
    where = next(f.location for f in found if f.message.startswith("armature of theta"))
    file = tmp_path / "mujoco.xml"
    assert where == SourceLine(file=str(file), line=line_with(file, armed))


def test_a_transmission_before_a_joint_of_a_urdf_is_not_taken_for_it(
    look: Look, tmp_path: Path
) -> None:
    found = look(
        "mass_spring_damper",
        "robot.urdf",
        "pybullet",
        (
            '<link name="mass"',
            '<!-- <joint name="x"> -->\n  <transmission name="t"><joint name="x"/></transmission>\n'
            '  <link name="mass"',
        ),
        ('friction="0"', 'friction="0.4"'),
    )
    where = next(f.location for f in found if "ignores it" in f.message)
    file = tmp_path / "robot.urdf"
    line = line_with(file, '<joint name="x" type')
    assert where == SourceLine(file=str(file), line=line)


def test_a_comment_is_no_statement_of_gravity(look: Look) -> None:
    changes = (('gravity="0 0 -9.81"', ""), ("<worldbody>", '<!-- gravity="0" -->\n<worldbody>'))
    found = look("simple_pendulum", "mujoco.xml", "mujoco", *changes)
    assert "the file sets no gravity" in said(found, "default", "note")


def test_a_gravity_that_an_included_file_states_is_stated(look: Look, tmp_path: Path) -> None:
    (tmp_path / "own.xml").write_text('<mujoco><option gravity="0 0 -9.81"/></mujoco>')
    changes = (
        ('gravity="0 0 -9.81"', ""),
        ("<worldbody>", '<include file="own.xml"/>\n<worldbody>'),
    )
    found = look("simple_pendulum", "mujoco.xml", "mujoco", *changes)
    assert "the file sets no gravity" not in said(found, "default", "note")


def test_a_comment_or_a_look_alike_in_python_is_not_taken_for_the_damping_of_a_space(
    look: Look, tmp_path: Path
) -> None:
    text = """    # space.damping = 0.5
    spring = pymunk.DampedRotarySpring(space.static_body, pymunk.Body(1, 1), 0, 0, 0)
    spring.damping = 0.0
    note = "space.damping = 0.7"
    space.damping = 0.99
"""
    built = "    space = pymunk.Space()\n"
    found = look("simple_pendulum", "space.py", "pymunk", (built, built + text))
    where = next(f.location for f in found if "Space.damping is 0.99" in f.message)
    file = tmp_path / "space.py"
    line = line_with(file, "space.damping = 0.99")
    assert where == SourceLine(file=str(file), line=line)


def test_a_comment_is_not_taken_for_a_joint_in_python(look: Look, tmp_path: Path) -> None:
    change = ("rod.error_bias = 1e-10", "pass")
    built = "    space = pymunk.Space()\n"
    comment = built + "    # pymunk.PinJoint( is what holds the bob\n"
    found = look("simple_pendulum", "space.py", "pymunk", change, (built, comment))
    where = next(f.location for f in found if "error_bias of a PinJoint" in f.message)
    file = tmp_path / "space.py"
    line = line_with(file, "= pymunk.PinJoint(")
    assert where == SourceLine(file=str(file), line=line)


def test_a_setting_of_one_engine_is_found_in_its_own_table() -> None:
    sidecar = read_sidecar(MODELS / "drum_pendulum" / "mujoco.xml.toml")
    shared = replace(sidecar, settings={"step": 1.0}, engine_settings={"mujoco": {"step": 2.0}})
    assert where(Remark(message="", address=None), shared, "mujoco") is None
    missing = Remark(message="", address="sidecar:settings.step")
    assert where(missing, shared, "mujoco") == SourceLine(file=f"{sidecar.model}.toml")


def test_a_gravity_that_a_sidecar_overrides_is_told_with_both_lines(
    look: Look, tmp_path: Path
) -> None:
    change = ("[bindings]", "[settings]\ngravity = [0, 0, -1.62]\n\n[bindings]")
    found = look("simple_pendulum", "mujoco.xml", "mujoco", change)
    (one,) = [f for f in found if "overrides" in f.message]
    file, beside = tmp_path / "mujoco.xml", tmp_path / "mujoco.xml.toml"
    assert one.location == SourceLine(file=str(file), line=line_with(file, "gravity="))
    assert "0 0 -9.81" in one.message
    assert one.message.endswith(f"({beside}:{line_with(beside, 'gravity =')})")
    assert one.severity == "finding"  # the equations have another
