"""An ambiguous or invalid URDF is rejected by line before an engine loads it."""

import dataclasses
import os
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.engine import EngineError, ModelSpec
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.engines.urdf import load_urdf
from tests.models import written

INERTIA = '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>'
BODY = f'<inertial><mass value="1"/>{INERTIA}</inertial>'
GOOD = f"""<robot name="r">
<link name="g">{BODY}</link>
<link name="a">{BODY}</link>
<joint name="j" type="revolute"><parent link="g"/><child link="a"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="9"/><dynamics damping="0.1"/></joint>
</robot>
"""


def joint(name: str, parent: str, child: str) -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="continuous">{ends}</joint>'


def added(text: str) -> tuple[str, str]:
    return "</robot>", f"{text}\n</robot>"


REFUSED = [
    (added('<link name="z"/>'), ":6: it has 2 root links, 'g', 'z'"),
    (('damping="0.1"', 'damping="0,1"'), ":5: damping of <dynamics> of joint 'j' is '0,1'"),
    (('<mass value="1"/>', '<mass value="inf"/>'), ":2: value of <mass> of link 'g' is 'inf'"),
    (('ixx="0.01"', 'ixx="1_0"'), ":2: ixx of <inertia> of link 'g' is '1_0'"),
    (
        (f"{BODY}</link>", f'{BODY}<visual><origin xyz="a"/></visual></link>'),
        ":2: xyz of <origin> of link 'g' is 'a'",
    ),
    (("</robot>", "</robot><robot/>"), ":6: not XML at column 9: junk after document element"),
    (added("<a>" * 300 + "</a>" * 300), ":6: refused: more than 300 nested elements"),
]
"""Flaws beyond those of `tests/robots/test_obstacles.py`, which has the same reader."""


@pytest.mark.parametrize(("change", "message"), REFUSED)
def test_invalid_urdfs_are_rejected(change: tuple[str, str], message: str, tmp_path: Path) -> None:
    path = written(tmp_path, "robot.urdf", GOOD)
    load_urdf(path)
    assert change[0] in GOOD
    path.write_text(GOOD.replace(*change, 1))
    with pytest.raises(EngineError) as caught:
        load_urdf(path)
    assert f"{path}{message}" in str(caught.value)


READ_BY_BOTH = [
    f'\n\n<?xml version="1.0"?>\n{GOOD}'.encode(),
    f"\ufeff{GOOD}".encode(),
    f"{GOOD}\0".encode(),
    f"<!-- two -- hyphens -->{GOOD}".encode(),
    f'<?xml version="1.0" encoding="ISO-8859-1"?><!-- é -->{GOOD}'.encode("latin-1"),
]
COMMAS = '<origin xyz="0.5, 0, 0"/><axis xyz="0, 1, 0"/>'
READ_BY_PYBULLET = [
    (GOOD.replace('<axis xyz="0 1 0"/>', COMMAS), "bad format"),
    (GOOD.replace("</joint>", '<axis xyz="1 0 0"/></joint>'), "repeated element"),
]
SPEC = ModelSpec(Path("robot.urdf"), settings={"step": 0.002, "gravity": [0, 0, 0]})


def loaded(name: str, text: bytes, path: Path) -> tuple[str, ...]:
    pytest.importorskip(name)
    path.write_bytes(text)
    for smooth in (False, True):  # the file itself, and a copy of it
        settings = {**SPEC.settings, "smooth": smooth}
        model = engines()[name].load(dataclasses.replace(SPEC, path=path, settings=settings))
    return model.coordinates


@pytest.mark.parametrize("text", READ_BY_BOTH)
@pytest.mark.parametrize("name", ["mujoco", "pybullet"])
def test_ignored_xml_deviations_are_accepted(name: str, text: bytes, tmp_path: Path) -> None:
    assert loaded(name, text, tmp_path / "robot.urdf") == ("j",)


@pytest.mark.parametrize(("text", "reason"), READ_BY_PYBULLET)
def test_mujoco_rejects_syntax_that_pybullet_reads(text: str, reason: str, tmp_path: Path) -> None:
    """Match the message of MuJoCo."""
    path = tmp_path / "robot.urdf"
    assert loaded("pybullet", text.encode(), path) == ("j",)
    with pytest.raises(EngineError, match=f"MuJoCo can't load it: .*{reason}"):
        loaded("mujoco", text.encode(), path)


LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="9"/>'
DYNAMICS = '<dynamics damping="0.1"/>'


@pytest.mark.parametrize(("engine", "old", "new", "reason"), [
    ("pybullet", LIMIT, "", "joint 'j' has no <limit>; add one"),
    ("pinocchio", DYNAMICS, "<dynamics dampin='1'/>", "<dynamics> of joint 'j' states no damping"),
    ("mujoco", "FORM", '<mesh filename="no.stl"/>', "mesh 'no.stl' does not exist in"),
    ("pybullet", "FORM", '<mesh filename="no.stl"/>', "mesh 'no.stl' does not exist in"),
    ("mujoco", "FORM", '<mesh filename="bad.stl"/>', "mesh 'bad.stl' can't be read; convert it"),
    ("mujoco", "FORM", '<sphere radius="1m"/>', "radius '1m' of <sphere> is not positive"),
])  # fmt: skip
def test_refusal_begins_with_a_reason_and_a_line(
    engine: str, old: str, new: str, reason: str, tmp_path: Path
) -> None:
    (tmp_path / "bad.stl").write_text("no mesh")
    form = new if old == "FORM" else '<sphere radius="1"/>'
    shape = f"{BODY}<collision><geometry>{form}</geometry></collision>"
    text = GOOD.replace(BODY, shape).replace(old, new)
    with pytest.raises(EngineError, match=rf"robot.urdf:\d+: {reason}.* \(.* can't load it: \w."):
        loaded(engine, text.encode(), tmp_path / "robot.urdf")


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_refusal_of_an_inertia_has_the_line_of_its_link(engine: str, tmp_path: Path) -> None:
    text = 'izz="9"'.join(GOOD.rsplit('izz="0.01"', 1))
    with pytest.raises(EngineError, match=r"robot.urdf:3: .*inertia"):
        loaded(engine, text.encode(), tmp_path / "robot.urdf")


@pytest.mark.parametrize("words", ["0.5,0,0", "0.5 ,0 ,0", "0.5, 0, 0,"])
def test_commas_that_an_engine_reads_as_zeros_are_rejected(words: str, tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(GOOD.replace('<axis xyz="0 1 0"/>', f'<origin xyz="{words}"/>'))
    with pytest.raises(EngineError, match="expected 3 finite numbers"):
        load_urdf(path)


@pytest.mark.parametrize("name", ["mujoco", "pybullet"])
def test_no_engine_loads_an_invalid_urdf(name: str, tmp_path: Path) -> None:
    pytest.importorskip(name)
    path = written(tmp_path, "robot.urdf", GOOD.replace(*added('<link name="z"/>')))
    settings = {"step": 0.002, "gravity": [0, 0, 0]}
    with pytest.raises(EngineError, match="2 root links"):
        engines()[name].load(ModelSpec(path, settings=settings))


@pytest.mark.parametrize(
    ("name", "ending"),
    [("mujoco", ".xml"), ("mujoco", ".urdf"), ("pybullet", ".urdf"), ("pymunk", ".py")],
)
def test_named_pipe_is_rejected(name: str, ending: str, tmp_path: Path) -> None:
    pytest.importorskip(name)
    path = tmp_path / f"pipe{ending}"
    os.mkfifo(path)
    settings: dict[str, object] = {"step": 0.002}
    if ending == ".urdf":
        settings["gravity"] = [0, 0, 0]
    with pytest.raises(EngineError, match=r"pipe.*it is a named pipe; expected a file"):
        engines()[name].load(ModelSpec(path, settings=settings))


def notes(name: str, text: str, folder: Path) -> list[str]:
    pytest.importorskip(name)
    path = written(folder, "robot.urdf", text)
    settings = {"step": 0.002, "gravity": [0, 0, 0]}
    model = engines()[name].load(ModelSpec(path, settings=settings))
    z = np.zeros((1, 1))
    return [remark.message for remark in model.remarks(z, z)]


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("mujoco", ('lower="-1" upper="1"', 'lower="0" upper="0"'), "[0, 0] of j have no effect"),
        ("mujoco", ('lower="-1" upper="1"', 'lower="1" upper="-1"'), "[1, -1] of j have no effect"),
        ("pybullet", ('lower="-1" upper="1"', 'lower="1" upper="-1"'), "[1, -1] of j have no"),
        ("mujoco", ('"revolute"', '"continuous"'), "[-1, 1] of j have no effect: it is continuous"),
        ("pybullet", ('"revolute"', '"continuous"'), "of j have no effect: it is continuous"),
        ("pybullet", ('xyz="0 1 0"', 'xyz="0 2 0"'), "the axis of j has the length 2"),
        ("mujoco", added('<transmission name="t"/>'), "<transmission> has no effect here"),
        ("pybullet", ("</joint>", '<safety_controller k_velocity="1"/></joint>'),
         "<safety_controller> has no effect here"),
    ],
)  # fmt: skip
def test_ignored_attributes_are_reported(
    name: str, change: tuple[str, str], message: str, tmp_path: Path
) -> None:
    assert message not in "\n".join(notes(name, GOOD, tmp_path))
    assert message in "\n".join(notes(name, GOOD.replace(*change), tmp_path))


def test_error_quotes_the_reason_of_pybullet(tmp_path: Path) -> None:
    with pytest.raises(EngineError, match="REVOLUTE but it does not specify limits"):
        notes("pybullet", GOOD.replace('<limit lower="-1" upper="1" effort="1" velocity="9"/>', ""),
             tmp_path)  # fmt: skip


@pytest.mark.parametrize("mass", ["1", "0"])
def test_zeroed_inertia_is_rejected_for_any_mass(mass: str, tmp_path: Path) -> None:
    """Report zeroed moments of a rotor without mass, because no other message explains them."""
    thin = BODY.replace('ixx="0.01"', 'ixx="0.1"').replace('mass value="1"', f'mass value="{mass}"')
    assert f'mass value="{mass}"' in thin
    fixed = joint("f", "a", "b").replace("continuous", "fixed")
    text = GOOD.replace(*added(f'<link name="b">{thin}</link>{fixed}'))
    with pytest.raises(EngineError, match="inertia of link 'b' to zero; its principal moments"):
        notes("pybullet", text, tmp_path)


def test_all_links_with_zeroed_inertia_are_named(tmp_path: Path) -> None:
    data = pytest.importorskip("pybullet_data")
    text = (Path(data.getDataPath()) / "TwoJointRobot_w_fixedJoints.urdf").read_text()
    with pytest.raises(EngineError, match="inertia of links 'link_1', 'link_2' to zero; their"):
        notes("pybullet", text, tmp_path)


def test_link_without_inertia_is_not_reported_as_zeroed(tmp_path: Path) -> None:
    none = BODY.replace("0.01", "0")
    assert GOOD.count(BODY) > 1
    head, tail = GOOD.rsplit(BODY, 1)
    with pytest.raises(EngineError, match="joint 'j' moves nothing with inertia"):
        notes("pybullet", f"{head}{none}{tail}", tmp_path)


def test_mimic_with_multiplier_zero_is_rejected(tmp_path: Path) -> None:
    follower = joint("k", "g", "b").replace("</joint>", '<mimic joint="j" multiplier="0"/></joint>')
    with pytest.raises(EngineError, match="multiplier 0"):
        notes("pybullet", GOOD.replace(*added(f'<link name="b">{BODY}</link>{follower}')), tmp_path)
