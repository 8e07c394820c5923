"""What Pinocchio and Drake make of an MJCF, as `docs/engines/` tabulates it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.harness.engines.protocol import EngineError, ModelSpec, UnsupportedError
from physics_crosscheck.harness.engines.registry import engines
from tests.engines.extras import need
from tests.engines.mjcf import AWAY, EXACT, INERTIAL, READERS, ends, hinge, mjcf, off, write

CONTINUOUS: Mapping[str, Mapping[str, object]] = {
    "pinocchio": {},
    "drake": {"stepping": "continuous"},
}
TWO = f'<body>{hinge()}{AWAY}<body pos="0.1 0 -0.4">{hinge("k")}{AWAY}</body></body>'
ONE = f"<body>{hinge()}{AWAY}</body>"
TENDON = (
    '<tendon><fixed name="t" {}><joint joint="j" coef="2"/><joint joint="k" coef="-1"/></fixed>'
)
STILL = np.zeros((1, 1))


@pytest.mark.parametrize("name", READERS)
def test_step_gravity_and_zero_are_the_files_unless_the_sidecar_says_otherwise(
    name: str, tmp_path: Path
) -> None:
    bodies = ONE.replace(hinge(), hinge(more='ref="0.4"'))
    path = write(tmp_path, bodies, '<option timestep="0.003" gravity="0 0 -5"/>')
    model = mjcf(name, path)
    assert (model.step, model.gravity) == (0.003, (0.0, 0.0, -5.0))
    assert model.home == pytest.approx([0.4])
    assert off(model, mjcf("mujoco", path)) < 1e-14
    told = sum("ignores <option" in one.message for one in model.remarks(STILL, STILL))
    assert told == {"pinocchio": 2, "drake": 1}[name]
    other = mjcf(name, path, {"step": 0.001, "gravity": [0.0, 0.0, -1.0]})
    assert (other.step, other.gravity) == (0.001, (0.0, 0.0, -1.0))


@pytest.mark.parametrize("name", READERS)
def test_a_flag_takes_gravity_away(name: str, tmp_path: Path) -> None:
    path = write(tmp_path, ONE, '<option><flag gravity="disable"/></option>')
    model = mjcf(name, path)
    assert model.gravity == (0.0, 0.0, 0.0)
    assert off(model, mjcf("mujoco", path)) < 1e-14


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize(("setting", "more", "beside"), [
    ("springs", 'stiffness="3" springref="0.2"', ""),
    ("tendons", "", TENDON.format('stiffness="3" damping="0.2" springlength="0.1"') + "</tendon>"),
    ("tendons", 'springref="0.3"', TENDON.format('stiffness="3"') + "</tendon>"),
    ("tendons", 'springref="0.3"', TENDON.format('stiffness="3" springlength="-0.5"')
     + "</tendon>"),
])  # fmt: skip
def test_springs_and_tendons_are_added_unless_told(
    name: str, setting: str, more: str, beside: str, tmp_path: Path
) -> None:
    path = write(tmp_path, TWO.replace(hinge(), hinge(more=more)), beside)
    known, model = mjcf("mujoco", path), mjcf(name, path)
    assert off(model, known) < 1e-14
    assert model.corrective_settings == {}
    without = mjcf(name, path, {setting: False})
    assert off(without, known) > 1e-3
    assert list(without.corrective_settings.values()) == [{setting: True}]
    two = np.zeros((1, 2))
    assert any(one.fault for one in without.remarks(two, two))


@pytest.mark.parametrize(("name", "settings", "within"), [
    ("pinocchio", {}, 1e-12), ("drake", {"stepping": "continuous"}, 1e-12), ("drake", {}, 1e-5),
    ("drake", {"stepping": "tamsi"}, None), ("pinocchio", {"equalities": False}, None),
])  # fmt: skip
def test_joints_follow_others_as_an_equality_says(
    name: str, settings: dict[str, object], within: float | None, tmp_path: Path
) -> None:
    beside = '<equality><joint joint1="k" joint2="j" polycoef="0.1 2 0 0 0"/></equality>'
    bodies = TWO.replace(hinge("k"), hinge("k", 'ref="0.3"'))
    model = mjcf(name, write(tmp_path, bodies, beside), settings)
    (z, w) = ends(model, np.array([0.1, 0.1 + 0.3 + 0.2]), np.array([0.5, 1.0]))
    follows = float(abs(z[1] - (0.3 + 0.1 + 2 * z[0])) + abs(w[1] - 2 * w[0]))
    assert (follows < (within or 1e-3)) is (within is not None)
    assert bool(model.corrective_settings) is (within is None)
    let = mjcf(name, tmp_path / "sample.xml", {**settings, "couplings": False})
    assert let.corrective_settings == {}


@pytest.mark.parametrize("name", READERS)
def test_defaults_are_those_of_the_class_or_of_what_is_around(name: str, tmp_path: Path) -> None:
    beside = (
        '<default><joint stiffness="1" damping="0.1"/><default class="a"><joint stiffness="4"/>'
        '<default class="b"><joint springref="0.3" damping="0.3"/></default></default></default>'
    )
    bodies = TWO.replace("<body>", '<body childclass="a">', 1).replace(
        hinge("k"), hinge("k", 'class="b"')
    )
    path = write(tmp_path, bodies, beside)
    assert off(mjcf(name, path), mjcf("mujoco", path)) < 1e-14


@pytest.mark.parametrize("name", READERS)
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
def test_mistakes_that_parsers_read_as_something_else_are_refused_by_line(
    name: str, old: str, new: str, why: str, tmp_path: Path
) -> None:
    path = write(tmp_path, ONE.replace(old, new, 1))
    with pytest.raises(EngineError, match=re.escape(why)):
        mjcf(name, path)


@pytest.mark.parametrize("name", READERS)
def test_coordinates_of_the_world_and_unknown_words_are_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(UnsupportedError, match="coordinates that are not local"):
        mjcf(name, write(tmp_path, ONE, '<compiler coordinate="global"/>'))
    with pytest.raises(EngineError, match="'grad', not degree or radian"):
        mjcf(name, write(tmp_path, ONE, '<compiler angle="grad"/>'))


@pytest.mark.parametrize("name", READERS)
def test_what_is_no_part_of_the_format_is_listed_as_not_read(name: str, tmp_path: Path) -> None:
    bodies = ONE.replace("<body>", '<body weight="3"><rope/>').replace("<joint", '<joint drag="1"')
    path = write(tmp_path, bodies, "<gadget/>")
    told = [one.message for one in mjcf(name, path).remarks(STILL, STILL)]
    for line, what in (("1", "gadget"), ("2", "rope"), ("2", "body weight"), ("2", "joint drag")):
        assert any(f"{line}: {name.title()} ignores <{what}>" in one for one in told)
    plain = mjcf(name, write(tmp_path, ONE)).remarks(STILL, STILL)
    assert not any("ignores" in one.message for one in plain)


@pytest.mark.parametrize("name", READERS)
def test_what_a_file_includes_is_read_and_its_lines_are_told(name: str, tmp_path: Path) -> None:
    (tmp_path / "part.xml").write_text(f"<mujocoinclude>\n{ONE}\n</mujocoinclude>")
    path = write(tmp_path, '<include file="part.xml"/>')
    assert off(mjcf(name, path), mjcf("mujoco", path)) < 1e-14
    ball = ONE.replace(hinge(), '<joint type="ball"/>')
    (tmp_path / "part.xml").write_text(f"<mujocoinclude>\n{ball}</mujocoinclude>")
    with pytest.raises(EngineError, match=r"part\.xml:2: a ball joint"):
        mjcf(name, path)
    (tmp_path / "part.xml").write_text('<mujocoinclude><include file="part.xml"/></mujocoinclude>')
    with pytest.raises(EngineError, match=r"part\.xml:1: <include file>"):
        mjcf(name, path)


@pytest.mark.parametrize("name", READERS)
def test_the_last_of_several_compilers_counts_and_later_defaults_spare_earlier_classes(
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
    beside = (
        '<compiler angle="degree"/><include file="part.xml"/><compiler autolimits="true"/>'
        '<option timestep="0.01"/><default><joint damping="5" armature="0.3"/></default>'
    )
    path = write(tmp_path, bodies, beside)
    model = mjcf(name, path)
    assert off(model, mjcf("mujoco", path)) < 1e-14
    assert (model.step, model.gravity, model.corrective_settings) == (0.01, (1.0, 2.0, 3.0), {})
    two = np.zeros((1, 2))
    told = [one.message for one in model.remarks(two, two)]
    assert any("5 <compiler> elements are merged" in one for one in told)
    assert any("2 <default> elements are written into each element" in one for one in told)


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize("flag", ["spring", "damper", "actuation", "gravity", "constraint"])
def test_what_a_flag_switches_off_is_off(name: str, flag: str, tmp_path: Path) -> None:
    beside = (
        f'<option><flag {flag}="disable"/></option>'
        + TENDON.format('stiffness="3" damping="0.4"')
        + '</tendon><actuator><motor joint="j"/></actuator>'
    )
    bodies = TWO.replace("<body ", '<body gravcomp="0.7" ').replace(
        hinge("k"), hinge("k", 'damping="0.3" stiffness="2" springref="0.3"')
    )
    if flag == "constraint":
        beside += '<equality><joint joint1="j" joint2="k"/></equality>'
    path = write(tmp_path, bodies, beside)
    settings: dict[str, object] = {"smooth": True, "controls": [0.6]}
    assert off(mjcf(name, path, settings), mjcf("mujoco", path, settings)) < 1e-14
    on = write(tmp_path, bodies, beside.replace("disable", "enable"), "on.xml")
    if flag != "constraint":
        assert off(mjcf(name, path, settings), mjcf("mujoco", on, settings)) > 1e-3


MESH = (
    '<asset><mesh name="m" vertex="0 0 0 0.3 0 0 0 0.5 0 0 0 0.7 0.2 0.3 0.4"/></asset>'
    '<default><geom size="0.1 0.2 0.3"/></default>'
)


@pytest.mark.parametrize("name", READERS)
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
def test_inertias_that_are_left_to_a_compiler_are_stated_in_the_copy(
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
    told = (f"the inertia of {bodies_are} as MuJoCo compiles the file",) if count else ()
    assert model.reservations == told
    two = np.zeros((1, 2))
    found = [one.message for one in model.remarks(two, two) if "compiles the file" in one.message]
    assert len(found) == len(told)


@pytest.mark.parametrize("name", READERS)
def test_without_a_compiler_such_inertias_are_refused_by_line(name: str, tmp_path: Path) -> None:
    need(name)
    body = f'<body>{hinge()}<geom type="mesh" mesh="m"/></body>'
    path, engine = write(tmp_path, body, MESH), engines()[name]
    engine.compilers = {}
    with pytest.raises(UnsupportedError, match=r"2: a mass of a mesh: .*needs an installed engine"):
        engine.load(ModelSpec(path))


@pytest.mark.parametrize("name", READERS)
def test_a_body_without_mass_and_moments_weighs_nothing(name: str, tmp_path: Path) -> None:
    nothing = '<inertial pos="0 0 0" mass="0" diaginertia="0 0 0"/><geom size="0.3"/>'
    path = write(tmp_path, f'{TWO}<body pos="1 0 0">{nothing}</body>')
    assert off(mjcf(name, path), mjcf("mujoco", path)) < 1e-14


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize("root", ["", "<freejoint/>"])
def test_gravity_compensation_is_added_unless_told(name: str, root: str, tmp_path: Path) -> None:
    geoms = '<geom type="box" size="0.1 0.2 0.3" pos="0.1 0.2 0"/><geom size="0.1" pos="1 0 0"/>'
    bodies = (
        f'<body gravcomp="0.4" euler="0.1 0.2 0.3">{root or hinge("i")}{AWAY}'
        f'<body gravcomp="1.2" pos="0 0 0.3" euler="0.5 0 0">{AWAY}</body>'
        f'<body gravcomp="-0.3" pos="0.1 0 -0.4">{hinge("k")}{geoms}</body></body>'
    )
    path = write(tmp_path, bodies, '<option gravity="1 2 -9"/>')
    known, model = mjcf("mujoco", path, EXACT), mjcf(name, path, CONTINUOUS[name])
    assert off(model, known) < 1e-13
    without = mjcf(name, path, {**CONTINUOUS[name], "gravcomp": False})
    assert off(without, known) > 1e-2
    assert list(without.corrective_settings.values()) == [{"gravcomp": True}]
    z, w = np.random.default_rng(1).normal(size=(2, len(known.coordinates)))
    order = [known.coordinates.index(one) for one in model.coordinates]
    for found, right in zip(ends(model, z[order], w[order]), ends(known, z, w), strict=True):
        np.testing.assert_allclose(found, right[order], atol=1e-9)


def test_drakes_own_steps_have_gravity_compensation_too(tmp_path: Path) -> None:
    path = write(tmp_path, ONE.replace("<body>", '<body gravcomp="1">'))
    z, w = ends(mjcf("drake", path), np.array([0.3]), np.array([0.0]))
    np.testing.assert_allclose([z[0], w[0]], [0.3, 0.0], atol=1e-13)


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize(("joint", "compiler", "child", "aligned"), [
    ('<freejoint name="f" align="true"/>', "", "", True),
    ('<freejoint name="f"/>', 'alignfree="true"', "", True),
    ('<joint name="f" type="free"/>', 'alignfree="true"', "", True),
    ('<freejoint name="f" align="false"/>', 'alignfree="true"', "", False),
    ('<freejoint name="f" align="true"/>', "", f'<body pos="0 0 1">{INERTIAL}</body>', False),
])  # fmt: skip
def test_a_free_body_is_aligned_with_its_inertia_where_mujoco_does_that(
    name: str, joint: str, compiler: str, child: str, aligned: bool, tmp_path: Path
) -> None:
    geom = '<geom type="box" size="0.1 0.2 0.3" pos="0.1 0.2 0.3" euler="0.4 0.5 0.6"/>'
    bodies = f'<body name="b" pos="1 2 3" euler="0.1 0.2 0.3">{joint}{geom}{child}</body>'
    path = write(tmp_path, bodies, f"<compiler {compiler}/>")
    model, known = mjcf(name, path, CONTINUOUS[name]), mjcf("mujoco", path, EXACT)
    assert bool(model.reservations) is aligned
    assert off(model, known) < 1e-13
    np.testing.assert_allclose(model.home, known.home, atol=1e-14)
    for found, right in zip(
        model.poses(["body:b"], model.home[None]), known.poses(["body:b"], known.home[None]),
        strict=True,
    ):  # fmt: skip
        np.testing.assert_allclose(found, right, atol=1e-14)


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize(("bodies", "beside", "why"), [
    (ONE, '<option density="1.2"/>', "1: a medium"),
    (ONE.replace('"hinge"', '"ball"'), "", "2: a ball joint"),
    (f'<body><freejoint/>{AWAY}</body>\n<body><freejoint/>{AWAY}</body>', "",
     "3: a second body that floats"),
    (f'<body><joint type="free" stiffness="2"/>{AWAY}</body>', "", "2: a spring or damper"),
    (f'<body><joint type="free" armature="2"/>{AWAY}</body>', "", "2: armature of a free"),
    (f'<frame pos="1 0 0">{ONE}</frame>', "", "2: <frame> with content that moves"),
    (ONE.replace('mass="2"', 'mass="0"'), "", "2: an inertia without mass"),
    (ONE.replace(hinge(), hinge(more='stiffness="1 2"')), "", "polynomials are not supported"),
    (ONE.replace(hinge(), hinge(more='damping="abc"')), "", "finite numbers"),
    (ONE.replace(hinge(), hinge(more='class="none"')), "", "not among the defaults"),
    (ONE, '<actuator><motor joint="j"/></actuator>', "1: it has actuators"),
    (ONE, '<equality><weld body1="b"/></equality>', "an equality <weld>"),
    (TWO, '<equality><joint joint1="j" joint2="k" polycoef="0 1 2"/></equality>', "not linear"),
    (TWO, TENDON.format('stiffness="3" springlength="0 1"') + "</tendon>", "is slack between"),
    (TWO, TENDON.format('stiffness="3" springlength="-1 1"') + "</tendon>", "is slack between"),
])  # fmt: skip
def test_what_acts_and_is_not_added_is_refused_by_line(
    name: str, bodies: str, beside: str, why: str, tmp_path: Path
) -> None:
    path = write(tmp_path, bodies, beside)
    with pytest.raises(EngineError, match=why) as told:
        mjcf(name, path)
    assert str(path) in str(told.value)
    mistaken = any(one in why for one in ("finite numbers", "not among the"))
    assert isinstance(told.value, UnsupportedError) is not mistaken


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize("motor", [
    '<motor joint="j" gear="3"/>', '<position joint="k" kp="5" kv="0.2" gear="2"/>',
    '<velocity joint="j" kv="0.7"/>', '<motor tendon="t" gear="2"/>',
    '<general joint="j" gear="2" gainprm="3" biastype="affine" biasprm="0.3 -2 -0.4"/>',
])  # fmt: skip
def test_actuators_pull_at_held_controls(name: str, motor: str, tmp_path: Path) -> None:
    beside = TENDON.format("") + f"</tendon><actuator>{motor}</actuator>"
    path = write(tmp_path, TWO, beside)
    settings: dict[str, object] = {"smooth": True, "controls": [0.6]}
    known, model = mjcf("mujoco", path, settings), mjcf(name, path, settings)
    assert off(model, known) < 1e-14
    assert off(mjcf(name, path, {**settings, "actuators": False}), known) > 1e-3
    with pytest.raises(EngineError, match="expected 1 number"):
        mjcf(name, path, {"smooth": True, "controls": [0.6, 1.0]})


@pytest.mark.parametrize("name", READERS)
def test_an_actuator_with_a_state_is_refused(name: str, tmp_path: Path) -> None:
    beside = '<actuator><general joint="j" dyntype="filter" dynprm="1"/></actuator>'
    with pytest.raises(EngineError, match="an actuator with a state"):
        mjcf(name, write(tmp_path, ONE, beside), {"smooth": True})


@pytest.mark.parametrize("name", READERS)
def test_a_joint_that_is_held_stands_where_it_is_drawn(name: str, tmp_path: Path) -> None:
    bodies = TWO.replace(hinge("k"), hinge("k", 'ref="0.3" stiffness="7"'))
    path = write(tmp_path, bodies, TENDON.format('stiffness="3" springlength="0"') + "</tendon>")
    model = mjcf(name, path, {"held": ["k"]})
    assert model.coordinates == ("j",)
    alone = '<tendon><fixed stiffness="3" springlength="0.3"><joint joint="j" coef="2"/></fixed>'
    known = write(tmp_path, TWO.replace(hinge("k"), ""), alone + "</tendon>", "known.xml")
    assert off(model, mjcf("mujoco", known)) < 1e-14
    with pytest.raises(EngineError, match="'l', which is not a joint"):
        mjcf(name, path, {"held": ["l"]})


@pytest.mark.parametrize("name", READERS)
def test_a_body_that_floats_is_told_as_everywhere_wherever_it_is_drawn(
    name: str, tmp_path: Path
) -> None:
    bodies = (
        f'<body><joint name="s" type="slide" axis="1 0 0"/>{AWAY}</body>'
        f'<body pos="1 2 3" euler="0.3 -0.4 0.5"><freejoint name="f"/>{AWAY}'
        f'<body pos="0.1 0.2 0.3" euler="0.3 0.2 0.1">{hinge(axis="0 1 1")}{AWAY}</body></body>'
    )
    path = write(tmp_path, bodies)
    model, known = mjcf(name, path, CONTINUOUS[name]), mjcf("mujoco", path, EXACT)
    order = [known.coordinates.index(one) for one in model.coordinates]
    assert model.coordinates[:3] == ("f:x", "f:y", "f:z")
    np.testing.assert_allclose(model.home, known.home[order], atol=1e-14)
    assert off(model, known) < 1e-13
    rng = np.random.default_rng(1)
    z, w = rng.normal(size=(2, len(order)))
    for found, right in zip(ends(model, z[order], w[order]), ends(known, z, w), strict=True):
        np.testing.assert_allclose(found, right[order], atol=1e-9)


@pytest.mark.parametrize("name", READERS)
def test_frames_are_where_the_file_puts_them(name: str, tmp_path: Path) -> None:
    bodies = TWO.replace("<body>", '<body name="a" pos="0 0 1" euler="0.1 0.2 0.3">').replace(
        '<body pos="0.1 0 -0.4">', '<body name="b" pos="0.1 0 -0.4">'
    )
    path = write(tmp_path, bodies)
    model, known = mjcf(name, path), mjcf("mujoco", path)
    places, z = ["body:a", "centre:a", "body:b", "centre:b"], np.array([[0.3, -0.8]])
    assert set(places) <= set(model.places)
    assert "body:world" not in model.places or name == "pinocchio"
    for found, right in zip(model.poses(places, z), known.poses(places, z), strict=True):
        np.testing.assert_allclose(found, right, atol=1e-14)


@pytest.mark.parametrize("name", READERS)
def test_friction_is_ignored_and_told(name: str, tmp_path: Path) -> None:
    model = mjcf(name, write(tmp_path, ONE.replace(hinge(), hinge(more='frictionloss="3"'))))
    assert any("ignores it" in one.message for one in model.remarks(STILL, STILL))
    assert off(model, mjcf("mujoco", write(tmp_path, ONE))) < 1e-14


def test_pinocchio_itself_leaves_damping_out_and_a_setting_asks_for_that(tmp_path: Path) -> None:
    path = write(tmp_path, ONE.replace(hinge(), hinge(more='damping="0.3"')))
    known = mjcf("mujoco", path)
    assert off(mjcf("pinocchio", path), known) < 1e-14
    model = mjcf("pinocchio", path, {"damping": False})
    assert off(model, known) > 1e-3
    assert list(model.corrective_settings.values()) == [{"damping": True}]


def test_drake_itself_leaves_armature_out_and_a_setting_asks_for_that(tmp_path: Path) -> None:
    path = write(tmp_path, TWO.replace(hinge("k"), hinge("k", 'armature="0.3"')))
    known = mjcf("mujoco", path)
    assert off(mjcf("pinocchio", path), known) < 1e-14
    assert off(mjcf("drake", path), known) < 1e-14
    model = mjcf("drake", path, {"armature": False})
    assert off(model, known) > 1e-3
    assert list(model.corrective_settings.values()) == [{"armature": True}]


def test_pinocchio_itself_reads_the_first_root_alone(tmp_path: Path) -> None:
    path = write(tmp_path, ONE + ONE.replace('"j"', '"k"'))
    assert mjcf("pinocchio", path).coordinates == ("j", "k")
    model = mjcf("pinocchio", path, {"all_roots": False})
    assert model.coordinates == ("j",)
    assert list(model.corrective_settings.values()) == [{"all_roots": True}]


def test_pinocchio_itself_takes_geoms_that_touch_nothing_for_looks(tmp_path: Path) -> None:
    geoms = (
        '<geom type="sphere" size="0.1" pos="0 0 0.5"/>'
        '<geom type="box" size="0.1 0.2 0.3" pos="0.2 0 0" contype="0" conaffinity="0"/>'
    )
    path = write(tmp_path, f"<body>{hinge()}{geoms}</body>")
    known = mjcf("mujoco", path)
    assert off(mjcf("pinocchio", path), known) < 1e-14
    assert off(mjcf("drake", path), known) < 1e-14
    model = mjcf("pinocchio", path, {"all_geoms": False})
    assert off(model, known) > 1e-2
    assert list(model.corrective_settings.values()) == [{"all_geoms": True}]


@pytest.mark.parametrize(("name", "defaults", "of"), [
    ("pinocchio", '<geom mass="0.3"/>', ""),
    ("pinocchio", '<geom size="0.1"/><default class="a"><geom pos="0.3 0 0.1"/></default>', "a"),
    ("pinocchio", '<geom size="0.1"/><default class="a"><joint damping="2"/></default>'
     '<default class="b"/>', "a"),
    ("pinocchio", '<geom size="0.1"/><joint pos="0.3 0 0.1"/>', ""),
    ("drake", '<joint damping="2"/><default class="a"><geom size="0.1"/></default>', "a"),
    ("drake", '<joint pos="0.3 0 0.1"/><default class="a"><geom size="0.1"/></default>', "a"),
])  # fmt: skip
def test_what_each_loses_of_defaults_is_a_cause_and_a_setting_brings_it(
    name: str, defaults: str, of: str, tmp_path: Path
) -> None:
    inner = hinge("k", 'class="b"' if 'class="b"' in defaults else "")
    size = "" if "size" in defaults else 'size="0.1"'
    under = f'childclass="{of}"' if of else ""
    bodies = (
        f"<body {under}>{hinge()}<geom {size}/>"
        f'<body pos="0 0 0.5">{inner}<geom {size}/></body></body>'
    )
    path = write(tmp_path, bodies, f"<default>{defaults}</default>")
    known, model = mjcf("mujoco", path), mjcf(name, path)
    assert off(model, known) > 1e-3
    (cause,) = model.corrective_settings
    assert "own reading of defaults" in cause
    told = mjcf(name, path, model.corrective_settings[cause])
    assert off(told, known) < 1e-14
    assert told.corrective_settings == {}
    two = np.zeros((1, 2))
    assert any("loses numbers that classes give" in one.message for one in model.remarks(two, two))


def test_drake_misplaces_the_first_joints_of_a_body_unless_they_are_chained(
    tmp_path: Path,
) -> None:
    joints = hinge() + hinge("k", 'pos="0 0 0.1" armature="0.1"', "1 0 0")
    path = write(tmp_path, f'<body pos="0.3 0 0" euler="0.1 0 0.2">{joints}{AWAY}</body>')
    known = mjcf("mujoco", path)
    assert off(mjcf("pinocchio", path), known) < 1e-14
    model = mjcf("drake", path)
    assert off(model, known) > 1e-3
    (undone,) = model.corrective_settings.values()
    assert undone == {"chained": True}
    chained = mjcf("drake", path, undone)
    assert off(chained, known) < 1e-13
    assert chained.corrective_settings == {}
    slides = joints.replace('"hinge"', '"slide"', 1)
    agreed = mjcf("drake", write(tmp_path, f'<body pos="0.3 0 0">{slides}{AWAY}</body>'))
    assert agreed.corrective_settings == {}
    assert off(agreed, mjcf("mujoco", tmp_path / "sample.xml")) < 1e-14


def test_limits_stop_a_joint_in_drakes_discrete_plants_and_crossed_ones_are_none(
    tmp_path: Path,
) -> None:
    path = write(tmp_path, ONE.replace(hinge(), hinge(more='range="-0.5 0.5"')))
    begin = np.array([0.49]), np.array([1.0])
    for name, settings, stopped in (
        ("pinocchio", {}, False), ("drake", {}, True), ("drake", {"smooth": True}, False),
    ):  # fmt: skip
        model = mjcf(name, path, {"gravity": [0.0, 0.0, 0.0], **settings})
        assert (ends(model, *begin)[1][0] < 0.5) == stopped
        assert np.isfinite(model.limits).all() == stopped
        assert model.sampling_range.tolist() == [[-0.5, 0.5]]
    told = list(mjcf("drake", path).remarks(STILL + 0.7, STILL))
    assert any("the limit stops the joint" in one.message for one in told)
    crossed = write(tmp_path, ONE.replace(hinge(), hinge(more='range="0.5 -0.5"')))
    model = mjcf("drake", crossed, {"gravity": [0.0, 0.0, 0.0]})
    assert ends(model, *begin)[0] == pytest.approx(0.54)
