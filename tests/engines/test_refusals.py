"""Unsupported input is refused with the file, the place and the remedy."""

import re
from collections.abc import Mapping
from pathlib import Path

import pytest

from physics_crosscheck.engine import EngineError, ModelSpec, Spring
from physics_crosscheck.harness.engines.registry import engines
from tests.engines.protocol_models import (
    GRAVITY,
    GROUND,
    PAIRINGS,
    STEP,
    Pairing,
    joint,
    link,
    urdf_settings,
)

SETTINGS = {"step": STEP, "gravity": [0, 0, -GRAVITY]}
ON_URDF = [p for p in PAIRINGS if p.format == "urdf" and p.integrator != "RK4"]
ENDINGS = [("mujoco", ".xml"), ("mujoco", ".urdf"), ("pybullet", ".urdf"), ("pymunk", ".py")]


def refused(
    engine: str,
    path: Path,
    settings: Mapping[str, object] | None = None,
    springs: tuple[Spring, ...] = (),
) -> str:
    """Return the message of a refusal, which names the file."""
    if engine != "known":
        pytest.importorskip(engine)
    with pytest.raises(EngineError) as caught:
        engines()[engine].load(ModelSpec(path, springs, settings or {}))
    message = str(caught.value)
    assert str(path) in message
    return message


def file(tmp_path: Path, name: str, text: str) -> Path:
    path = tmp_path / name
    path.write_text(text)
    return path


def urdf(tmp_path: Path, *parts: str, head: str = "") -> Path:
    return file(tmp_path, "model.urdf", f'{head}<robot name="r">{GROUND}{"".join(parts)}</robot>')


GOOD = {
    ".xml": '<mujoco><worldbody><body><joint name="q1" type="slide"/>'
    '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>',
    ".urdf": f'<robot name="r">{GROUND}{link("b", 1)}{joint("q1", "prismatic", "b")}</robot>',
    ".py": "import pymunk\n\n\ndef build():\n    s = pymunk.Space()\n    b = pymunk.Body(1, 1)\n"
    "    s.add(b)\n    return s, {'b': b}\n",
}


@pytest.mark.parametrize(("engine", "ending"), ENDINGS[:3])
def test_broken_xml_is_refused_with_its_line(tmp_path: Path, engine: str, ending: str) -> None:
    root = "mujoco" if ending == ".xml" else "robot name='r'"
    path = file(tmp_path, f"model{ending}", f"<{root}>\n  <link>\n</{root.split()[0]}>\n")
    # MuJoCo names the line where the element opens, the others where it fails to close.
    assert re.search(r"(model.urdf:3:|[Ll]ine number=2)", refused(engine, path, SETTINGS))


@pytest.mark.parametrize(("engine", "ending"), ENDINGS)
def test_invalid_utf_8_is_refused(tmp_path: Path, engine: str, ending: str) -> None:
    path = tmp_path / f"model{ending}"
    path.write_bytes(b"\xff\xfe\x00broken")
    refused(engine, path, {"step": STEP} if ending == ".py" else SETTINGS)


@pytest.mark.parametrize(("engine", "ending"), ENDINGS)
def test_unknown_setting_is_refused_by_name(tmp_path: Path, engine: str, ending: str) -> None:
    path = file(tmp_path, f"model{ending}", GOOD[ending])
    settings = {"step": STEP} if ending == ".py" else SETTINGS
    message = refused(engine, path, settings | {"colour": 3})
    assert "colour" in message
    assert f"{path.name}.toml" in message


SLIDE = link("b", 1) + joint("q1", "prismatic", "b")
OTHER = '<mimic joint="q1" multiplier="2" offset="0.1"/>'
MOTOR = '</worldbody><actuator><motor joint="q1"/></actuator>'
ROBOT = '<robot name="r">{}{}</robot>'


@pytest.mark.parametrize(("engine", "ending", "text", "settings", "word"), [
    ("pybullet", ".urdf", GOOD[".urdf"], {"gravity": [0, 0, 0]}, "must set step"),
    ("pymunk", ".py", GOOD[".py"], {}, "must set step"),
    ("pybullet", ".urdf", GOOD[".urdf"], {"step": STEP}, "must set gravity"),
    ("mujoco", ".xml", GOOD[".xml"], {"integrator": "leapfrog"}, "'leapfrog'"),
    ("mujoco", ".xml", GOOD[".xml"].replace("</worldbody>", MOTOR), {}, "actuators"),
    *((engine, ".urdf", ROBOT.format(GROUND, link("b", 1) + joint("q1", kind, "b")), SETTINGS, "")
      for engine, kind in (
          ("mujoco", "spherical"), ("pybullet", "floating"), ("pybullet", "planar"),
      )),
    ("pybullet", ".urdf", ROBOT.format(
        GROUND, SLIDE + link("c", 1) + joint("q2", "prismatic", "c", extra=OTHER)
    ), SETTINGS, "offset"),
])  # fmt: skip
def test_unsupported_input_is_refused_by_name(
    tmp_path: Path, engine: str, ending: str, text: str, settings: dict[str, object], word: str
) -> None:
    assert word in refused(engine, file(tmp_path, f"model{ending}", text), settings)


SPRING = '<gazebo reference="{}"><springStiffness>{}</springStiffness></gazebo>'


@pytest.mark.parametrize("pairing", ON_URDF, ids=str)
@pytest.mark.parametrize(("head", "parts", "words"), [
    ("", link("b", 1) + joint("stuck", "fixed", "b"), ["no moving joint"]),
    ('<!DOCTYPE robot [<!ENTITY a "b">]>', SLIDE, ["entities or a DTD"]),
    ('<!DOCTYPE robot SYSTEM "http://localhost/x.dtd">', SLIDE, ["entities or a DTD"]),
    ('<!DOCTYPE robot [<!ENTITY f SYSTEM "file:///etc/hostname">]>', SLIDE, ["entities or a DTD"]),
    *(("", SLIDE + SPRING.format("q1", word), ["'q1'", repr(word)])
      for word in ("stiff", "nan", "1 2")),
    ("", SLIDE + SPRING.format("gone", 3), ["'gone'"]),
])  # fmt: skip
def test_invalid_urdf_is_refused_by_name(
    tmp_path: Path, pairing: Pairing, head: str, parts: str, words: list[str]
) -> None:
    message = refused(pairing.engine, urdf(tmp_path, parts, head=head), urdf_settings(pairing))
    assert all(word in message for word in words)


@pytest.mark.parametrize("pairing", ON_URDF, ids=str)
def test_other_roots_and_springs_on_missing_joints_are_refused(
    tmp_path: Path, pairing: Pairing
) -> None:
    path = file(tmp_path, "model.urdf", "<sdf><model/></sdf>")
    message = refused(pairing.engine, path, urdf_settings(pairing))
    assert "not <robot>" in message or "'sdf'" in message
    spring = Spring({"away": 1.0}, 3.0, 0.0, 0.0)
    path = urdf(tmp_path, SLIDE)
    assert "away" in refused(pairing.engine, path, urdf_settings(pairing), (spring,))


def test_mujoco_splits_a_planar_joint_into_two_slides_and_a_hinge(tmp_path: Path) -> None:
    path = urdf(tmp_path, link("b", 1), joint("flat", "planar", "b"))
    model = engines()["mujoco"].load(ModelSpec(path, (), SETTINGS))
    assert model.coordinates == ("flat_TX", "flat_TY", "flat_RZ")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("def build(:\n", ":1: SyntaxError"),
        ("import pymunk\nwrong\n", ":2: NameError"),
        ("x = 1\n", "must define build()"),
        ("def build():\n    return 1 / 0\n", ":2: build() fails: division by zero"),
        ("def build():\n    return 3, 4\n", "must return (Space, {name: Body})"),
        ("import pymunk\ndef build():\n    return pymunk.Space(), {}\n", "at least one Body"),
        ("import pymunk\ndef build():\n    s = pymunk.Space()\n    b = pymunk.Body()\n"
         "    s.add(b)\n    return s, {'b': b}\n", "mass"),
    ],
)  # fmt: skip
def test_space_that_cannot_be_built_is_refused_with_its_line(
    tmp_path: Path, text: str, expected: str
) -> None:
    assert expected in refused("pymunk", file(tmp_path, "space.py", text), {"step": STEP}).replace(
        "Mass", "mass"
    )
