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


@pytest.mark.parametrize(("engine", "ending"), ENDINGS)
def test_missing_file_is_refused(tmp_path: Path, engine: str, ending: str) -> None:
    settings = {"step": STEP} if ending == ".py" else SETTINGS
    refused(engine, tmp_path / f"nowhere{ending}", settings)


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


@pytest.mark.parametrize(("engine", "ending"), ENDINGS[2:])
def test_step_that_the_format_lacks_is_required(tmp_path: Path, engine: str, ending: str) -> None:
    path = file(tmp_path, f"model{ending}", GOOD[ending])
    assert "must set step" in refused(
        engine, path, {"gravity": [0, 0, 0]} if ending == ".urdf" else {}
    )


def test_gravity_is_required_for_a_urdf_in_pybullet(tmp_path: Path) -> None:
    path = file(tmp_path, "model.urdf", GOOD[".urdf"])
    assert "must set gravity" in refused("pybullet", path, {"step": STEP})


def test_unknown_integrator_is_refused_by_name(tmp_path: Path) -> None:
    path = file(tmp_path, "model.xml", GOOD[".xml"])
    assert "'leapfrog'" in refused("mujoco", path, {"integrator": "leapfrog"})


@pytest.mark.parametrize(
    ("engine", "kind"),
    [("mujoco", "spherical"), ("pybullet", "floating"), ("pybullet", "planar")],
)
def test_other_joint_types_of_a_urdf_are_refused(tmp_path: Path, engine: str, kind: str) -> None:
    path = urdf(tmp_path, link("b", 1), joint("loose", kind, "b"))
    refused(engine, path, SETTINGS)


def test_mujoco_splits_a_planar_joint_into_two_slides_and_a_hinge(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    path = urdf(tmp_path, link("b", 1), joint("flat", "planar", "b"))
    model = engines()["mujoco"].load(ModelSpec(path, (), SETTINGS))
    assert model.coordinates == ("flat_TX", "flat_TY", "flat_RZ")


def test_actuators_are_refused_since_inputs_act_on_joints(tmp_path: Path) -> None:
    text = GOOD[".xml"].replace(
        "</worldbody>", '</worldbody><actuator><motor joint="q1"/></actuator>'
    )
    assert "actuators" in refused("mujoco", file(tmp_path, "model.xml", text))


@pytest.mark.parametrize("pairing", ON_URDF, ids=str)
def test_urdf_without_moving_joints_is_refused(tmp_path: Path, pairing: Pairing) -> None:
    path = urdf(tmp_path, link("b", 1), joint("stuck", "fixed", "b"))
    assert "no moving joint" in refused(pairing.engine, path, urdf_settings(pairing))


@pytest.mark.parametrize("pairing", ON_URDF, ids=str)
@pytest.mark.parametrize(
    "head",
    ['<!DOCTYPE robot [<!ENTITY a "b">]>', '<!DOCTYPE robot SYSTEM "http://localhost/x.dtd">',
     '<!DOCTYPE robot [<!ENTITY f SYSTEM "file:///etc/hostname">]>'],
)  # fmt: skip
def test_urdf_with_a_dtd_or_entities_is_refused(
    tmp_path: Path, pairing: Pairing, head: str
) -> None:
    path = urdf(tmp_path, link("b", 1), joint("q1", "prismatic", "b"), head=head)
    assert "entities or a DTD" in refused(pairing.engine, path, urdf_settings(pairing))


@pytest.mark.parametrize("pairing", ON_URDF, ids=str)
def test_xml_other_than_urdf_is_refused(tmp_path: Path, pairing: Pairing) -> None:
    path = file(tmp_path, "model.urdf", "<sdf><model/></sdf>")
    message = refused(pairing.engine, path, urdf_settings(pairing))
    assert "not <robot>" in message or "'sdf'" in message


@pytest.mark.parametrize("words", ["stiff", "nan", "1 2"])
@pytest.mark.parametrize("pairing", ON_URDF, ids=str)
def test_invalid_spring_stiffness_is_refused_by_joint(
    tmp_path: Path, pairing: Pairing, words: str
) -> None:
    extra = f'<gazebo reference="q1"><springStiffness>{words}</springStiffness></gazebo>'
    path = urdf(tmp_path, link("b", 1), joint("q1", "prismatic", "b"), extra)
    message = refused(pairing.engine, path, urdf_settings(pairing))
    assert "'q1'" in message
    assert repr(words) in message


@pytest.mark.parametrize("pairing", ON_URDF, ids=str)
def test_springs_on_missing_joints_are_refused(tmp_path: Path, pairing: Pairing) -> None:
    extra = '<gazebo reference="gone"><springStiffness>3</springStiffness></gazebo>'
    path = urdf(tmp_path, link("b", 1), joint("q1", "prismatic", "b"), extra)
    assert "'gone'" in refused(pairing.engine, path, urdf_settings(pairing))
    path = urdf(tmp_path, link("b", 1), joint("q1", "prismatic", "b"))
    spring = Spring({"away": 1.0}, 3.0, 0.0, 0.0)
    assert "away" in refused(pairing.engine, path, urdf_settings(pairing), (spring,))


def test_pybullet_refuses_a_mimic_with_an_offset(tmp_path: Path) -> None:
    mimic = '<mimic joint="q1" multiplier="2" offset="0.1"/>'
    path = urdf(
        tmp_path,
        link("a", 1),
        joint("q1", "prismatic", "a"),
        link("b", 1),
        joint("q2", "prismatic", "b", extra=mimic),
    )
    assert "offset" in refused("pybullet", path, SETTINGS)


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
