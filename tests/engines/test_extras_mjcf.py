"""How Pinocchio and Drake read an MJCF, as listed in `docs/engines/`."""

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.engine import EngineError, ModelSpec
from physics_crosscheck.harness.engines.protocol import UnsupportedError
from physics_crosscheck.harness.engines.registry import engines
from tests.engines.extras import need
from tests.engines.mjcf import AWAY, EXACT, INERTIAL, PARTIAL_READERS, ends, hinge, mjcf, off, write

CONTINUOUS: Mapping[str, Mapping[str, object]] = {
    "pinocchio": {},
    "drake": {"stepping": "continuous"},
}
TWO = f'<body>{hinge()}{AWAY}<body pos="0.1 0 -0.4">{hinge("k")}{AWAY}</body></body>'
ARM = f"<body>{hinge()}{AWAY}</body>"
TENDON = (
    '<tendon><fixed name="t" {}><joint joint="j" coef="2"/><joint joint="k" coef="-1"/></fixed>'
)
STILL = np.zeros((1, 1))


@pytest.mark.parametrize("name", PARTIAL_READERS)
def test_file_sets_step_gravity_and_zero_unless_the_sidecar_does(name: str, tmp_path: Path) -> None:
    bodies = ARM.replace(hinge(), hinge(more='ref="0.4"'))
    path = write(tmp_path, bodies, '<option timestep="0.003" gravity="0 0 -5"/>')
    model = mjcf(name, path)
    assert (model.step, model.gravity) == (0.003, (0.0, 0.0, -5.0))
    assert model.home == pytest.approx([0.4])
    assert off(model, mjcf("mujoco", path)) < 1e-14
    count = sum("ignores <option" in one.message for one in model.remarks(STILL, STILL))
    assert count == {"pinocchio": 2, "drake": 1}[name]
    other = mjcf(name, path, {"step": 0.001, "gravity": [0.0, 0.0, -1.0]})
    assert (other.step, other.gravity) == (0.001, (0.0, 0.0, -1.0))


@pytest.mark.parametrize("name", PARTIAL_READERS)
@pytest.mark.parametrize(("setting", "more", "extra"), [
    ("springs", 'stiffness="3" springref="0.2"', ""),
    ("tendons", "", TENDON.format('stiffness="3" damping="0.2" springlength="0.1"') + "</tendon>"),
    ("tendons", 'springref="0.3"', TENDON.format('stiffness="3"') + "</tendon>"),
    ("tendons", 'springref="0.3"', TENDON.format('stiffness="3" springlength="-0.5"')
     + "</tendon>"),
])  # fmt: skip
def test_springs_and_tendons_are_added_by_default(
    name: str, setting: str, more: str, extra: str, tmp_path: Path
) -> None:
    path = write(tmp_path, TWO.replace(hinge(), hinge(more=more)), extra)
    mujoco, model = mjcf("mujoco", path), mjcf(name, path)
    assert off(model, mujoco) < 1e-14
    assert model.corrective_settings == {}
    without = mjcf(name, path, {setting: False})
    assert off(without, mujoco) > 1e-3
    assert list(without.corrective_settings.values()) == [{setting: True}]
    two = np.zeros((1, 2))
    assert any(one.fault for one in without.remarks(two, two))


@pytest.mark.parametrize(("name", "settings", "within"), [
    ("pinocchio", {}, 1e-12), ("drake", {"stepping": "continuous"}, 1e-12), ("drake", {}, 1e-5),
    ("drake", {"stepping": "tamsi"}, None), ("pinocchio", {"equalities": False}, None),
])  # fmt: skip
def test_joints_follow_others_by_an_equality(
    name: str, settings: dict[str, object], within: float | None, tmp_path: Path
) -> None:
    extra = '<equality><joint joint1="k" joint2="j" polycoef="0.1 2 0 0 0"/></equality>'
    bodies = TWO.replace(hinge("k"), hinge("k", 'ref="0.3"'))
    model = mjcf(name, write(tmp_path, bodies, extra), settings)
    (z, w) = ends(model, np.array([0.1, 0.1 + 0.3 + 0.2]), np.array([0.5, 1.0]))
    follows = float(abs(z[1] - (0.3 + 0.1 + 2 * z[0])) + abs(w[1] - 2 * w[0]))
    assert (follows < (within or 1e-3)) is (within is not None)
    assert bool(model.corrective_settings) is (within is None)
    let = mjcf(name, tmp_path / "sample.xml", {**settings, "couplings": False})
    assert let.corrective_settings == {}


@pytest.mark.parametrize("name", PARTIAL_READERS)
def test_defaults_come_from_the_class_or_the_enclosing_body(name: str, tmp_path: Path) -> None:
    extra = (
        '<default><joint stiffness="1" damping="0.1"/><default class="a"><joint stiffness="4"/>'
        '<default class="b"><joint springref="0.3" damping="0.3"/></default></default></default>'
    )
    bodies = TWO.replace("<body>", '<body childclass="a">', 1).replace(
        hinge("k"), hinge("k", 'class="b"')
    )
    path = write(tmp_path, bodies, extra)
    assert off(mjcf(name, path), mjcf("mujoco", path)) < 1e-14


@pytest.mark.parametrize("name", PARTIAL_READERS)
@pytest.mark.parametrize(("old", "new", "why"), [
    ('pos="0.1 -0.2 0.3"', 'pos="0.1 nan 0"', "2: <inertial pos> is '0.1 nan 0'; expected finite"),
    ('pos="0.1 -0.2 0.3"', 'pos="0.1 0"', "2: <inertial pos> is '0.1 0'; expected 3 numbers"),
    ('mass="2"', 'mass="1 2"', "2: <inertial mass> is '1 2'; expected 1 number"),
    ('mass="2"', 'mass="-2"', "2: <inertial mass> is '-2', which is less than 0"),
    ("<body>", '<body quat="0 0 0 0">', "2: <body quat> is zero"),
    ("<body>", '<body quat="1 0 0 0" euler="1 0 0">', "2: <body> is turned twice, by quat and eul"),
    ("</body>", "\n" + INERTIAL + "</body>", "3: a second <inertial> in one body"),
    (AWAY, '<geom size="-0.1"/>', "2: <geom size> is '-0.1', which is less than 0"),
    (AWAY, '<geom type="capsule" size="1" fromto="1 2 3 1 2 3"/>', "which has no length"),
    ("</body>", f"<body><freejoint/>{AWAY}</body></body>", "a free joint of a body within another"),
])  # fmt: skip
def test_mistakes_that_parsers_misread_are_rejected_by_line(
    name: str, old: str, new: str, why: str, tmp_path: Path
) -> None:
    path = write(tmp_path, ARM.replace(old, new, 1))
    with pytest.raises(EngineError, match=re.escape(why)):
        mjcf(name, path)


@pytest.mark.parametrize("name", PARTIAL_READERS)
def test_global_coordinates_and_unknown_words_are_rejected(name: str, tmp_path: Path) -> None:
    with pytest.raises(UnsupportedError, match="coordinates that are not local"):
        mjcf(name, write(tmp_path, ARM, '<compiler coordinate="global"/>'))
    with pytest.raises(EngineError, match="'grad', not degree or radian"):
        mjcf(name, write(tmp_path, ARM, '<compiler angle="grad"/>'))


@pytest.mark.parametrize("name", PARTIAL_READERS)
def test_unknown_elements_are_listed_as_ignored(name: str, tmp_path: Path) -> None:
    bodies = ARM.replace("<body>", '<body weight="3"><rope/>').replace("<joint", '<joint drag="1"')
    path = write(tmp_path, bodies, "<gadget/>")
    messages = [one.message for one in mjcf(name, path).remarks(STILL, STILL)]
    for line, what in (("1", "gadget"), ("2", "rope"), ("2", "body weight"), ("2", "joint drag")):
        assert any(f"{line}: {name.title()} ignores <{what}>" in one for one in messages)
    plain = mjcf(name, write(tmp_path, ARM)).remarks(STILL, STILL)
    assert not any("ignores" in one.message for one in plain)


@pytest.mark.parametrize("name", PARTIAL_READERS)
def test_included_files_are_read_and_their_lines_reported(name: str, tmp_path: Path) -> None:
    (tmp_path / "part.xml").write_text(f"<mujocoinclude>\n{ARM}\n</mujocoinclude>")
    path = write(tmp_path, '<include file="part.xml"/>')
    assert off(mjcf(name, path), mjcf("mujoco", path)) < 1e-14
    ball = ARM.replace(hinge(), '<joint type="ball"/>')
    (tmp_path / "part.xml").write_text(f"<mujocoinclude>\n{ball}</mujocoinclude>")
    with pytest.raises(EngineError, match=r"part\.xml:2: a ball joint"):
        mjcf(name, path)
    (tmp_path / "part.xml").write_text('<mujocoinclude><include file="part.xml"/></mujocoinclude>')
    with pytest.raises(EngineError, match=r"part\.xml:1: <include file>"):
        mjcf(name, path)


@pytest.mark.parametrize("name", PARTIAL_READERS)
def test_last_compiler_counts_and_later_defaults_keep_earlier_classes(
    name: str, tmp_path: Path
) -> None:
    (tmp_path / "part.xml").write_text(
        '<mujocoinclude><compiler angle="degree"/><compiler angle="radian" eulerseq="zyx"/>'
        '<default><joint damping="2"/><default class="a"><joint stiffness="4"/></default></default>'
        '<option gravity="1 2 3"/></mujocoinclude>'
    )
    bodies = TWO.replace("<body>", '<body euler="0.3 0.4 0.5">').replace(
        hinge("k"), hinge("k", 'class="a" springref="0.7"')
    )
    extra = (
        '<compiler angle="degree"/><include file="part.xml"/><compiler autolimits="true"/>'
        '<option timestep="0.01"/><default><joint damping="5" armature="0.3"/></default>'
    )
    path = write(tmp_path, bodies, extra)
    model = mjcf(name, path)
    assert off(model, mjcf("mujoco", path)) < 1e-14
    assert (model.step, model.gravity, model.corrective_settings) == (0.01, (1.0, 2.0, 3.0), {})
    two = np.zeros((1, 2))
    messages = [one.message for one in model.remarks(two, two)]
    assert any("5 <compiler> elements are merged" in one for one in messages)
    assert any("2 <default> elements are written into each element" in one for one in messages)


@pytest.mark.parametrize("name", PARTIAL_READERS)
@pytest.mark.parametrize("flag", ["spring", "damper", "actuation", "gravity", "constraint"])
def test_flag_disables_its_feature(name: str, flag: str, tmp_path: Path) -> None:
    extra = (
        f'<option><flag {flag}="disable"/></option>'
        + TENDON.format('stiffness="3" damping="0.4"')
        + '</tendon><actuator><motor joint="j"/></actuator>'
    )
    bodies = TWO.replace("<body ", '<body gravcomp="0.7" ').replace(
        hinge("k"), hinge("k", 'damping="0.3" stiffness="2" springref="0.3"')
    )
    if flag == "constraint":
        extra += '<equality><joint joint1="j" joint2="k"/></equality>'
    path = write(tmp_path, bodies, extra)
    settings: dict[str, object] = {"smooth": True, "controls": [0.6]}
    assert off(mjcf(name, path, settings), mjcf("mujoco", path, settings)) < 1e-14
    on = write(tmp_path, bodies, extra.replace("disable", "enable"), "on.xml")
    if flag != "constraint":
        assert off(mjcf(name, path, settings), mjcf("mujoco", on, settings)) > 1e-3


MESH = (
    '<asset><mesh name="m" vertex="0 0 0 0.3 0 0 0 0.5 0 0 0 0.7 0.2 0.3 0.4"/></asset>'
    '<default><geom size="0.1 0.2 0.3"/></default>'
)


@pytest.mark.parametrize("name", PARTIAL_READERS)
@pytest.mark.parametrize(("geoms", "compiler", "count"), [
    ('<geom type="mesh" mesh="m" pos="0.1 0 0.2" euler="0.1 0.2 0.3"/>', "", 1),
    ('<geom type="box" mesh="m" pos="0.1 0 0.2"/>', "", 1),
    ('<geom type="box" shellinertia="true" pos="0.1 0 0.2"/>', "", 1),
    ('<frame pos="0.1 0 0.2"><geom type="box"/></frame>', "", 1),
    ('<geom size="0.1"/><geom type="box" size="0.1" fromto="0 0 0 1 0.2 0.5"/>', "", 0),
    ('<geom size="0.1"/><geom type="ellipsoid" size="0.1" fromto="0 0 0 1 0.2 0.5"/>', "", 0),
    ('<geom type="box"/>', 'settotalmass="7"', 2),
    ('<geom type="box"/>', 'boundmass="9"', 2),
    ('<geom type="box"/><geom group="3" pos="1 0 0"/>', 'inertiagrouprange="0 2"', 2),
    (AWAY.replace("0.25", "0.35"), 'balanceinertia="true"', 2),
    ('<geom type="box"/>', "", 0),
])  # fmt: skip
def test_compiled_inertias_are_written_into_the_copy(
    name: str, geoms: str, compiler: str, count: int, tmp_path: Path
) -> None:
    bodies = (
        f'<body pos="0.2 0 0" euler="0.1 0.2 0.3">{hinge()}{geoms}'
        f'<body pos="0.1 0 -0.4">{hinge("k")}{AWAY}</body></body>'
    )
    path = write(tmp_path, bodies, MESH + f"<compiler {compiler}/>")
    model = mjcf(name, path)
    count += name == "drake" and "fromto" in geoms  # Drake ignores these shapes between two points
    assert off(model, mjcf("mujoco", path)) < 1e-13
    bodies_are = "1 body is" if count == 1 else f"{count} bodies are"
    expected = (f"the inertia of {bodies_are} as MuJoCo compiles the file",) if count else ()
    assert model.reservations == expected
    two = np.zeros((1, 2))
    remarks = [one.message for one in model.remarks(two, two) if "compiles the file" in one.message]
    assert len(remarks) == len(expected)


@pytest.mark.parametrize("name", PARTIAL_READERS)
def test_meshes_without_a_compiler_are_rejected_by_line(name: str, tmp_path: Path) -> None:
    need(name)
    body = f'<body>{hinge()}<geom type="mesh" mesh="m"/></body>'
    path, engine = write(tmp_path, body, MESH), engines()[name]
    engine.compilers = {}
    with pytest.raises(UnsupportedError, match=r"2: a mass of a mesh: .*needs an installed engine"):
        engine.load(ModelSpec(path))


@pytest.mark.parametrize("name", PARTIAL_READERS)
def test_body_without_mass_and_inertia_is_massless(name: str, tmp_path: Path) -> None:
    nothing = '<inertial pos="0 0 0" mass="0" diaginertia="0 0 0"/><geom size="0.3"/>'
    path = write(tmp_path, f'{TWO}<body pos="1 0 0">{nothing}</body>')
    assert off(mjcf(name, path), mjcf("mujoco", path)) < 1e-14


@pytest.mark.parametrize("name", PARTIAL_READERS)
@pytest.mark.parametrize("root", ["", "<freejoint/>"])
def test_gravity_compensation_is_added_by_default(name: str, root: str, tmp_path: Path) -> None:
    geoms = '<geom type="box" size="0.1 0.2 0.3" pos="0.1 0.2 0"/><geom size="0.1" pos="1 0 0"/>'
    bodies = (
        f'<body gravcomp="0.4" euler="0.1 0.2 0.3">{root or hinge("i")}{AWAY}'
        f'<body gravcomp="1.2" pos="0 0 0.3" euler="0.5 0 0">{AWAY}</body>'
        f'<body gravcomp="-0.3" pos="0.1 0 -0.4">{hinge("k")}{geoms}</body></body>'
    )
    path = write(tmp_path, bodies, '<option gravity="1 2 -9"/>')
    mujoco, model = mjcf("mujoco", path, EXACT), mjcf(name, path, CONTINUOUS[name])
    assert off(model, mujoco) < 1e-13
    without = mjcf(name, path, {**CONTINUOUS[name], "gravcomp": False})
    assert off(without, mujoco) > 1e-2
    assert list(without.corrective_settings.values()) == [{"gravcomp": True}]
    z, w = np.random.default_rng(1).normal(size=(2, len(mujoco.coordinates)))
    order = [mujoco.coordinates.index(one) for one in model.coordinates]
    for actual, expected in zip(ends(model, z[order], w[order]), ends(mujoco, z, w), strict=True):
        np.testing.assert_allclose(actual, expected[order], atol=1e-9)


def test_drake_steps_include_gravity_compensation(tmp_path: Path) -> None:
    path = write(tmp_path, ARM.replace("<body>", '<body gravcomp="1">'))
    z, w = ends(mjcf("drake", path), np.array([0.3]), np.array([0.0]))
    np.testing.assert_allclose([z[0], w[0]], [0.3, 0.0], atol=1e-13)


@pytest.mark.parametrize("name", PARTIAL_READERS)
@pytest.mark.parametrize(("joint", "compiler", "child", "aligned"), [
    ('<freejoint name="f" align="true"/>', "", "", True),
    ('<freejoint name="f"/>', 'alignfree="true"', "", True),
    ('<joint name="f" type="free"/>', 'alignfree="true"', "", True),
    ('<freejoint name="f" align="false"/>', 'alignfree="true"', "", False),
    ('<freejoint name="f" align="true"/>', "", f'<body pos="0 0 1">{INERTIAL}</body>', False),
])  # fmt: skip
def test_free_body_is_aligned_with_its_inertia_as_in_mujoco(
    name: str, joint: str, compiler: str, child: str, aligned: bool, tmp_path: Path
) -> None:
    geom = '<geom type="box" size="0.1 0.2 0.3" pos="0.1 0.2 0.3" euler="0.4 0.5 0.6"/>'
    bodies = f'<body name="b" pos="1 2 3" euler="0.1 0.2 0.3">{joint}{geom}{child}</body>'
    path = write(tmp_path, bodies, f"<compiler {compiler}/>")
    model, mujoco = mjcf(name, path, CONTINUOUS[name]), mjcf("mujoco", path, EXACT)
    assert bool(model.reservations) is aligned
    assert off(model, mujoco) < 1e-13
    np.testing.assert_allclose(model.home, mujoco.home, atol=1e-14)
    for actual, expected in zip(
        model.poses(["body:b"], model.home[None]), mujoco.poses(["body:b"], mujoco.home[None]),
        strict=True,
    ):  # fmt: skip
        np.testing.assert_allclose(actual, expected, atol=1e-14)


@pytest.mark.parametrize("name", PARTIAL_READERS)
@pytest.mark.parametrize(("bodies", "extra", "why"), [
    (ARM, '<option density="1.2"/>', "1: a medium"),
    (ARM.replace('"hinge"', '"ball"'), "", "2: a ball joint"),
    (f'<frame pos="1 0 0">{ARM}</frame>', "", "2: <frame> with content that moves"),
    (ARM.replace('mass="2"', 'mass="0"'), "", "2: an inertia without mass"),
    (ARM.replace(hinge(), hinge(more='stiffness="1 2"')), "", "polynomials are not supported"),
    (ARM.replace(hinge(), hinge(more='damping="abc"')), "", "finite numbers"),
    (ARM.replace(hinge(), hinge(more='class="none"')), "", "not among the defaults"),
    (ARM, '<actuator><motor joint="j"/></actuator>', "1: it has actuators"),
    (ARM, '<equality><weld body1="b"/></equality>', "an equality <weld>"),
    (TWO, '<equality><joint joint1="j" joint2="k" polycoef="0 1 2"/></equality>', "not linear"),
    (TWO, TENDON.format('stiffness="3" springlength="0 1"') + "</tendon>", "is slack between"),
    (TWO, TENDON.format('stiffness="3" springlength="-1 1"') + "</tendon>", "is slack between"),
])  # fmt: skip
def test_unsupported_features_are_rejected_by_line(
    name: str, bodies: str, extra: str, why: str, tmp_path: Path
) -> None:
    path = write(tmp_path, bodies, extra)
    with pytest.raises(EngineError, match=why) as error:
        mjcf(name, path)
    assert str(path) in str(error.value)
    mistaken = any(one in why for one in ("finite numbers", "not among the"))
    assert isinstance(error.value, UnsupportedError) is not mistaken


@pytest.mark.parametrize("name", PARTIAL_READERS)
@pytest.mark.parametrize("motor", [
    '<motor joint="j" gear="3"/>', '<position joint="k" kp="5" kv="0.2" gear="2"/>',
    '<velocity joint="j" kv="0.7"/>', '<motor tendon="t" gear="2"/>',
    '<general joint="j" gear="2" gainprm="3" biastype="affine" biasprm="0.3 -2 -0.4"/>',
    '<position joint="k" kp="5" dampratio="0.7"/>', '<position class="mixed" joint="j" kv="0.1"/>',
    '<motor class="mixed" joint="j"/>',
])  # fmt: skip
def test_actuators_act_at_constant_controls(name: str, motor: str, tmp_path: Path) -> None:
    extra = TENDON.format("") + f"</tendon><actuator>{motor}</actuator>"
    mixed = '<default class="mixed"><position kp="7"/><general gear="2"/></default>'
    path = write(tmp_path, TWO, f"<default>{mixed}</default>{extra}")
    settings: dict[str, object] = {"smooth": True, "controls": [0.6]}
    mujoco, model = mjcf("mujoco", path, settings), mjcf(name, path, settings)
    assert off(model, mujoco) < 1e-14
    assert off(mjcf(name, path, {**settings, "actuators": False}), mujoco) > 1e-3
    with pytest.raises(EngineError, match="expected 1 number"):
        mjcf(name, path, {"smooth": True, "controls": [0.6, 1.0]})


@pytest.mark.parametrize("name", PARTIAL_READERS)
def test_actuator_with_a_state_is_rejected(name: str, tmp_path: Path) -> None:
    extra = '<actuator><general joint="j" dyntype="filter" dynprm="1"/></actuator>'
    with pytest.raises(EngineError, match="an actuator with a state"):
        mjcf(name, write(tmp_path, ARM, extra), {"smooth": True})


@pytest.mark.parametrize("name", PARTIAL_READERS)
def test_held_joint_stays_at_its_initial_position(name: str, tmp_path: Path) -> None:
    bodies = TWO.replace(hinge("k"), hinge("k", 'ref="0.3" stiffness="7"'))
    path = write(tmp_path, bodies, TENDON.format('stiffness="3" springlength="0"') + "</tendon>")
    model = mjcf(name, path, {"held": ["k"]})
    assert model.coordinates == ("j",)
    tendon = '<tendon><fixed stiffness="3" springlength="0.3"><joint joint="j" coef="2"/></fixed>'
    file = write(tmp_path, TWO.replace(hinge("k"), ""), tendon + "</tendon>", "known.xml")
    assert off(model, mjcf("mujoco", file)) < 1e-14
    with pytest.raises(EngineError, match="'l', which is not a joint"):
        mjcf(name, path, {"held": ["l"]})


@pytest.mark.parametrize("name", PARTIAL_READERS)
def test_floating_bodies_have_the_same_coordinates_as_in_mujoco(name: str, tmp_path: Path) -> None:
    child = f'<body pos="0.1 0.2 0.3" euler="0.3 0.2 0.1">{hinge(axis="0 1 1")}{AWAY}</body>'
    bodies = (
        f'<body name="a" pos="4 1 2" euler="0.1 0.2 0.3"><freejoint name="e"/>{AWAY}</body>'
        f'<body><joint name="s" type="slide" axis="1 0 0"/>{AWAY}</body>'
        f'<body name="b" pos="1 2 3" euler="0.3 -0.4 0.5"><freejoint name="f"/>{AWAY}{child}</body>'
    )
    path = write(tmp_path, bodies)
    model, mujoco = mjcf(name, path, CONTINUOUS[name]), mjcf("mujoco", path, EXACT)
    order = [mujoco.coordinates.index(one) for one in model.coordinates]
    np.testing.assert_allclose(model.home, mujoco.home[order], atol=1e-14)
    assert off(model, mujoco) < 1e-13
    rng = np.random.default_rng(1)
    z, w = rng.normal(size=(2, len(order)))
    places = ["body:a", "body:b"]
    for actual, expected in zip(
        model.poses(places, z[order][None]), mujoco.poses(places, z[None]), strict=True
    ):
        np.testing.assert_allclose(actual, expected, atol=1e-13)
    for actual, expected in zip(ends(model, z[order], w[order]), ends(mujoco, z, w), strict=True):
        np.testing.assert_allclose(actual, expected[order], atol=1e-9)


def test_bodies_without_names_are_counted_as_in_mujoco(tmp_path: Path) -> None:
    path = write(tmp_path, f'{ARM}<body pos="1 0 0" euler="0 90 0">{AWAY}</body>')
    places, z = ["body:body_1", "body:body_2"], np.zeros((1, 1))
    for actual, expected in zip(
        mjcf("pinocchio", path).poses(places, z), mjcf("mujoco", path).poses(places, z), strict=True
    ):
        np.testing.assert_allclose(actual, expected, atol=1e-14)


def test_armature_damping_and_springs_of_free_joints_act_as_in_mujoco(tmp_path: Path) -> None:
    child = f'<body pos="0.1 0.2 0.3">{hinge()}{AWAY}</body>'
    free = '<joint name="f" type="free" armature="2" damping="3" stiffness="4"/>'
    bodies = f'<body pos=".3 .2 .1" euler="20 30 40">{free}{AWAY}{child}</body>'
    light = bodies.replace('"f"', '"g"').replace('"2"', '"0.3"', 1).replace('"j"', '"k"')
    path = write(tmp_path, bodies + light.replace('"4"', '"7"').replace("20 30", "70 -50"))
    model, mujoco = mjcf("pinocchio", path), mjcf("mujoco", path, EXACT)
    assert off(model, mujoco) < 1e-13
    for key in ("armature", "stiffness"):
        with pytest.raises(UnsupportedError, match=f"2: {key} of a free joint, which Drake"):
            mjcf("drake", write(tmp_path, f'<body><joint type="free" {key}="2"/>{AWAY}</body>'))


@pytest.mark.parametrize("name", PARTIAL_READERS)
def test_frames_match_the_file(name: str, tmp_path: Path) -> None:
    bodies = TWO.replace("<body>", '<body name="a" pos="0 0 1" euler="0.1 0.2 0.3">').replace(
        '<body pos="0.1 0 -0.4">', '<body name="b" pos="0.1 0 -0.4">'
    )
    path = write(tmp_path, bodies)
    model, mujoco = mjcf(name, path), mjcf("mujoco", path)
    places, z = ["body:a", "centre:a", "body:b", "centre:b"], np.array([[0.3, -0.8]])
    assert set(places) <= set(model.places)
    assert "body:world" not in model.places or name == "pinocchio"
    for actual, expected in zip(model.poses(places, z), mujoco.poses(places, z), strict=True):
        np.testing.assert_allclose(actual, expected, atol=1e-14)


@pytest.mark.parametrize("name", PARTIAL_READERS)
def test_friction_is_ignored_and_reported(name: str, tmp_path: Path) -> None:
    model = mjcf(name, write(tmp_path, ARM.replace(hinge(), hinge(more='frictionloss="3"'))))
    assert any("ignores it" in one.message for one in model.remarks(STILL, STILL))
    assert off(model, mjcf("mujoco", write(tmp_path, ARM))) < 1e-14


GEOMS = (
    '<geom type="sphere" size="0.1" pos="0 0 0.5"/>'
    '<geom type="box" size="0.1 0.2 0.3" pos="0.2 0 0" contype="0" conaffinity="0"/>'
)


@pytest.mark.parametrize(("name", "setting", "bodies"), [
    ("pinocchio", "damping", ARM.replace(hinge(), hinge(more='damping="0.3"'))),
    ("drake", "armature", TWO.replace(hinge("k"), hinge("k", 'armature="0.3"'))),
    ("pinocchio", "all_geoms", f"<body>{hinge()}{GEOMS}</body>"),
])  # fmt: skip
def test_setting_restores_what_an_engine_leaves_out(
    name: str, setting: str, bodies: str, tmp_path: Path
) -> None:
    path = write(tmp_path, bodies)
    mujoco, model = mjcf("mujoco", path), mjcf(name, path, {setting: False})
    for complete in (mjcf(name, path), mjcf("pinocchio", path)):
        assert off(complete, mujoco) < 1e-14
    assert off(model, mujoco) > 1e-3
    assert list(model.corrective_settings.values()) == [{setting: True}]


def test_setting_restores_pinocchio_with_only_the_first_root(tmp_path: Path) -> None:
    path = write(tmp_path, ARM + ARM.replace('"j"', '"k"'))
    assert mjcf("pinocchio", path).coordinates == ("j", "k")
    model = mjcf("pinocchio", path, {"all_roots": False})
    assert model.coordinates == ("j",)
    assert list(model.corrective_settings.values()) == [{"all_roots": True}]


@pytest.mark.parametrize(("name", "defaults", "class_name"), [
    ("pinocchio", '<geom mass="0.3"/>', ""),
    ("pinocchio", '<geom size="0.1"/><default class="a"><geom pos="0.3 0 0.1"/></default>', "a"),
    ("pinocchio", '<geom size="0.1"/><default class="a"><joint damping="2"/></default>'
     '<default class="b"/>', "a"),
    ("pinocchio", '<geom size="0.1"/><joint pos="0.3 0 0.1"/>', ""),
    ("drake", '<joint damping="2"/><default class="a"><geom size="0.1"/></default>', "a"),
    ("drake", '<joint pos="0.3 0 0.1"/><default class="a"><geom size="0.1"/></default>', "a"),
])  # fmt: skip
def test_lost_defaults_are_a_cause_with_a_corrective_setting(
    name: str, defaults: str, class_name: str, tmp_path: Path
) -> None:
    inner = hinge("k", 'class="b"' if 'class="b"' in defaults else "")
    size = "" if "size" in defaults else 'size="0.1"'
    under = f'childclass="{class_name}"' if class_name else ""
    bodies = (
        f"<body {under}>{hinge()}<geom {size}/>"
        f'<body pos="0 0 0.5">{inner}<geom {size}/></body></body>'
    )
    path = write(tmp_path, bodies, f"<default>{defaults}</default>")
    mujoco, model = mjcf("mujoco", path), mjcf(name, path)
    assert off(model, mujoco) > 1e-3
    (cause,) = model.corrective_settings
    assert "own reading of defaults" in cause
    corrected = mjcf(name, path, model.corrective_settings[cause])
    assert off(corrected, mujoco) < 1e-14
    assert corrected.corrective_settings == {}
    two = np.zeros((1, 2))
    assert any("loses numbers that classes give" in one.message for one in model.remarks(two, two))


def test_drake_misplaces_the_first_joints_of_a_body_unless_chained(tmp_path: Path) -> None:
    joints = hinge() + hinge("k", 'pos="0 0 0.1" armature="0.1"', "1 0 0")
    path = write(tmp_path, f'<body pos="0.3 0 0" euler="0.1 0 0.2">{joints}{AWAY}</body>')
    mujoco = mjcf("mujoco", path)
    assert off(mjcf("pinocchio", path), mujoco) < 1e-14
    model = mjcf("drake", path)
    assert off(model, mujoco) > 1e-3
    (remedy,) = model.corrective_settings.values()
    assert remedy == {"chained": True}
    chained = mjcf("drake", path, remedy)
    assert off(chained, mujoco) < 1e-13
    assert chained.corrective_settings == {}
    slides = joints.replace('"hinge"', '"slide"', 1)
    agreed = mjcf("drake", write(tmp_path, f'<body pos="0.3 0 0">{slides}{AWAY}</body>'))
    assert agreed.corrective_settings == {}
    assert off(agreed, mjcf("mujoco", tmp_path / "sample.xml")) < 1e-14


def test_limits_act_in_discrete_drake_plants_unless_crossed(tmp_path: Path) -> None:
    path = write(tmp_path, ARM.replace(hinge(), hinge(more='range="-0.5 0.5"')))
    begin = np.array([0.49]), np.array([1.0])
    for name, settings, stopped in (
        ("pinocchio", {}, False), ("drake", {}, True), ("drake", {"smooth": True}, False),
    ):  # fmt: skip
        model = mjcf(name, path, {"gravity": [0.0, 0.0, 0.0], **settings})
        assert (ends(model, *begin)[1][0] < 0.5) == stopped
        assert np.isfinite(model.limits).all() == stopped
        assert model.sampling_range.tolist() == [[-0.5, 0.5]]
    remarks = list(mjcf("drake", path).remarks(STILL + 0.7, STILL))
    assert any("the limit stops the joint" in one.message for one in remarks)
    crossed = write(tmp_path, ARM.replace(hinge(), hinge(more='range="0.5 -0.5"')))
    model = mjcf("drake", crossed, {"gravity": [0.0, 0.0, 0.0]})
    assert ends(model, *begin)[0] == pytest.approx(0.54)
