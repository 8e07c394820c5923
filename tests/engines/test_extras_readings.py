"""Readings of a URDF by optional engines alone, as listed in `docs/engines/`."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from physics_crosscheck import check
from physics_crosscheck.engine import EngineError
from physics_crosscheck.harness.results.headline import headline
from physics_crosscheck.reference.mechanism.rotations import (
    angular_velocity,
    from_quaternion,
    unit_quaternion,
)
from tests.engines.extras import EXTRAS, H, load, need
from tests.engines.test_free_joints import TUMBLING
from tests.engines.test_readings import BELOW, BODY, WELDED, moved, urdf

MIMIC = (
    f'<link name="b">{BODY}</link><joint name="k" type="continuous"><parent link="g"/>'
    '<child link="b"/><axis xyz="0 1 0"/><mimic joint="j" multiplier="2"/></joint>'
)


@pytest.mark.parametrize(("name", "words"), [
    ("dart", "a servo in DART, of which its leader feels nothing; j accelerates"),
    ("sapien", "a spring of 1e5 N/m or N m/rad in SAPIEN, or nothing; j off by"),
])  # fmt: skip
def test_sentence_on_a_loose_mimic_names_it_with_its_line(
    name: str, words: str, tmp_path: Path
) -> None:
    """Catch a number of the file that is named because it happens to fit."""
    need(name)
    file = tmp_path / "arm.urdf"
    file.write_text(urdf(extra=MIMIC))
    results = check(file, engines=[name])
    assert f"<mimic> of k is {words}" in headline(results)[0]
    ((first, *_),) = (one.unexplained_findings for one in results.models)
    assert first.location is not None
    assert first.location.line


def test_contact_of_nested_spheres_is_where_it_should_be(tmp_path: Path) -> None:
    """Catch ends that are sought at the far side of a sphere deep inside another one."""
    need("drake")
    ball = '<collision><origin xyz="0 0 {}"/><geometry><sphere radius="{}"/></geometry></collision>'
    follower = MIMIC.replace('"g"', '"a"').replace('<mimic joint="j" multiplier="2"/>', "")
    text = urdf(extra=follower.replace(BODY, BODY + ball.format(0.08, 0.22)))
    file = tmp_path / "nested.urdf"
    file.write_text(text.replace(BODY, BODY + ball.format(0, 0.001), 1))
    assert "Drake follows nested.urdf" in headline(check(file, engines=["drake"]))[-1]


@pytest.mark.parametrize("name", ["pinocchio", "idyntree"])
def test_missing_damping_has_a_corrective_setting(name: str, tmp_path: Path) -> None:
    text = urdf('<dynamics damping="0.3"/>')
    model = load(name, text, tmp_path, settings={"damping": False})
    assert moved(model, 0.0, 1.0, 0.01)[1] == 1.0
    (remedy,) = model.corrective_settings.values()
    corrected = load(name, text, tmp_path, settings=remedy)
    assert moved(corrected, 0.0, 1.0, 0.01)[1] < 0.75


@pytest.mark.parametrize(("name", "settings", "off", "led"), [
    ("pinocchio", {}, 1e-13, 0.2), ("pinocchio", {"hold_mimics": False}, 0.41, 1.0),
    ("drake", {}, 1e-6, 0.2), ("drake", {"stepping": "tamsi"}, 0.41, 1.0),
    ("drake", {"stepping": "continuous"}, 0.41, 1.0),
    ("drake", {"stepping": "continuous", "hold_mimics": True}, 1e-13, 0.2),
    ("dart", {}, 1e-2, 1.0),
    ("idyntree", {}, 1e-13, 0.2), ("idyntree", {"hold_mimics": False}, 0.41, 1.0),
])  # fmt: skip
def test_mimic_is_ignored_constrained_or_a_servo(
    name: str, settings: dict[str, object], off: float, led: float, tmp_path: Path
) -> None:
    model = load(name, urdf(extra=MIMIC), tmp_path, settings=settings)
    index = [model.coordinates.index(one) for one in ("j", "k")]
    push = np.zeros((1, 1000, 2))
    push[:, :, index[0]] = 0.004
    still = np.zeros((1, 2))
    z, _ = model.rollout(still, still, 1e-3, 1000, push, 1000)
    leader, follower = z[0, 0, index]
    # 0.01 kg m^2, plus the follower's inertia times the square of its ratio if constrained.
    assert leader == pytest.approx(led * 0.004 / 0.01 / 2, rel=5e-3)
    assert abs(follower - 2 * leader) <= off
    has_remark = any("servo" in remark.message for remark in model.remarks(still, still))
    assert (has_remark or bool(model.corrective_settings)) is (led == 1.0)
    assert has_remark is (name == "dart")


@pytest.mark.parametrize(("ratio", "holds"), [(0.5, True), (1.0, True), (2.0, False)])
def test_dart_coupler_is_stable_only_for_slow_followers(
    ratio: float, holds: bool, tmp_path: Path
) -> None:
    text = urdf(extra=MIMIC.replace('"2"', f'"{ratio}"'))
    model = load("dart", text, tmp_path, settings={"couplers": True})
    push = np.ones((1, 500, 2)) * [0.004, 0.0]
    z, _ = model.rollout(np.zeros((1, 2)), np.zeros((1, 2)), H, 500, push, 500)
    angle = 0.004 / (0.01 * (1 + ratio**2)) * 0.05**2 / 2
    right = z[0, 0] == pytest.approx([angle, ratio * angle], rel=0.01)
    assert right is holds


@pytest.mark.parametrize("name", EXTRAS)
def test_disabled_mimic_is_ignored(name: str, tmp_path: Path) -> None:
    model = load(name, urdf(extra=MIMIC), tmp_path, settings={"couplings": False})
    push = np.ones((1, 10, 2)) * [0.0, 0.01]
    z, _ = model.rollout(np.zeros((1, 2)), np.zeros((1, 2)), 1e-3, 10, push, 10)
    assert np.count_nonzero(z) == 1
    assert model.corrective_settings == {}


@pytest.mark.parametrize(("name", "refused"), [
    ("pinocchio", False), ("drake", True), ("dart", False), ("idyntree", False),
])  # fmt: skip
@pytest.mark.parametrize("body", [
    BODY.replace('ixx="0.01"', 'ixx="0.1"'),
    '<inertial><mass value="0"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    "</inertial>",
], ids=["no triangle", "moments without mass"])  # fmt: skip
def test_inertia_that_drake_replaces_by_a_ball_is_rejected(
    name: str, refused: bool, body: str, tmp_path: Path
) -> None:
    text = urdf(extra=WELDED.format(body))
    if refused:
        with pytest.raises(
            EngineError, match="a ball of 1 kg for the impossible inertia of link 'tip'"
        ):
            load(name, text, tmp_path)
    else:
        load(name, text, tmp_path)


@pytest.mark.parametrize(("name", "kind"), [
    ("pinocchio", "floating"), ("drake", "floating"), ("dart", "floating"),
    ("idyntree", "spherical"),
])  # fmt: skip
def test_other_joint_types_are_rejected(name: str, kind: str, tmp_path: Path) -> None:
    with pytest.raises(
        EngineError, match=f"{name}.urdf: joint '[aj]' is neither a slide nor a hinge"
    ):
        load(name, urdf(kind=kind), tmp_path)


def test_joints_that_idyntree_ignores_with_an_error_are_rejected(tmp_path: Path) -> None:
    with pytest.raises(EngineError, match=r"idyntree\.urdf: iDynTree can't load it: .* floating"):
        load("idyntree", urdf(kind="floating"), tmp_path)


def test_idyntree_drops_inertia_of_massless_links_unless_set(tmp_path: Path) -> None:
    tip = '<inertial><mass value="0"/><inertia ixx="1" iyy="0.04" izz="1" ixy="0" ixz="0" iyz="0"/>'
    text = urdf(extra=WELDED.format(f"{tip}</inertial>"))
    push = np.full((1, 100, 1), 0.1)
    rest = np.zeros((1, 1))
    for settings, inertia in ({}, 0.01), ({"massless_links": True}, 0.05):
        model = load("idyntree", text, tmp_path, settings=settings)
        _, w = model.rollout(rest, rest, H, 100, push, 100)
        assert w[0, 0, 0] == pytest.approx(0.1 * 100 * H / inertia, rel=1e-9)
        names = [
            one for one in model.corrective_settings if "a link without mass (tip, line" in one
        ]
        assert [model.corrective_settings[one] for one in names] == (
            [] if settings else [{"massless_links": True}]
        )
        assert "link:tip" in model.places
        assert ("centre:tip" in model.places) is bool(settings)


@pytest.mark.parametrize("name", ["pinocchio", "dart"])
def test_error_quotes_the_output_of_the_parser(name: str, tmp_path: Path) -> None:
    with pytest.raises(EngineError, match="is of type REVOLUTE but it does not specify limits"):
        load(name, urdf(kind="revolute"), tmp_path)


def test_drake_accepts_a_revolute_joint_without_limits(tmp_path: Path) -> None:
    model = load("drake", urdf(kind="revolute"), tmp_path)
    assert moved(model, 2.0, 1.0, 0.1)[0] == pytest.approx(2.1)


@pytest.mark.parametrize(
    ("name", "accepted"), [("pinocchio", False), ("drake", True), ("dart", False)]
)
def test_only_drake_accepts_empty_dynamics(name: str, accepted: bool, tmp_path: Path) -> None:
    if accepted:
        load(name, urdf("<dynamics/>"), tmp_path)
    else:
        with pytest.raises(EngineError, match="no damping and no friction"):
            load(name, urdf("<dynamics/>"), tmp_path)


@pytest.mark.parametrize("name", EXTRAS)
@pytest.mark.parametrize("root", ["g", "world"])
def test_root_link_may_be_anywhere_in_the_file(name: str, root: str, tmp_path: Path) -> None:
    ground = f'<link name="g">{BODY}</link>'
    text = urdf(body=BELOW)
    assert ground in text
    text = text.replace(ground, "").replace("</robot>", f"{ground}</robot>")
    model = load(name, text.replace('"g"', f'"{root}"'), tmp_path)
    assert model.coordinates == ("j",)
    assert moved(model, 0.0, 0.0, H, push=1.0)[1] / H == pytest.approx(1 / 1.01, rel=1e-9)


@pytest.mark.parametrize("name", EXTRAS)
def test_frames_match_the_file(name: str, tmp_path: Path) -> None:
    model = load(name, urdf(body=BELOW), tmp_path)
    assert {"link:g", "link:a", "centre:a"} <= set(model.places)
    origins, turns = model.poses(["link:a", "centre:a"], np.array([[0.5]]))
    np.testing.assert_allclose(origins[0], [[0, 0, 0], [-np.sin(0.5), 0, -np.cos(0.5)]], atol=1e-15)
    np.testing.assert_allclose(turns[0, 0] @ [0, 0, -1], origins[0, 1], atol=1e-15)


@pytest.mark.parametrize("name", ["pinocchio", "dart"])
@pytest.mark.parametrize(("number", "place"), [
    ('value="1"', 'mass value="1 "'), ('iyy="0.01"', 'inertia iyy="0.01 "'),
])  # fmt: skip
def test_inertial_dropped_for_a_trailing_blank_is_a_cause_with_its_line(
    name: str, number: str, place: str, tmp_path: Path
) -> None:
    def with_body(old: str, new: str) -> str:
        return urdf(extra=WELDED.format(BODY), body=BODY.replace(old, new))

    before, after = with_body('="', '=" '), with_body(number, f'{number[:-1]} "')
    assert load(name, before, tmp_path).corrective_settings == {}
    model = load(name, after, tmp_path)
    ((cause, remedy),) = model.corrective_settings.items()
    assert f"{name}.urdf:1: <{place}>" in cause
    corrected = load(name, after, tmp_path, settings=remedy)
    assert corrected.corrective_settings == {}
    still = np.zeros((1, len(model.coordinates)))
    push = np.ones_like(still)
    actual, expected = (one.accelerations(still, still, push) for one in (model, corrected))
    assert actual is not None
    assert expected is not None
    assert expected == pytest.approx(np.full((1, 1), 1 / (0.01 + 0.01 + 1)))
    assert abs(actual - expected).max() > 1e-3


@pytest.mark.parametrize("name", ["pinocchio", "dart"])
@pytest.mark.parametrize("part", [
    '<dynamics damping="0.3 "/>', '<limit lower="-1" upper="1 " effort="1" velocity="1"/>',
    '<limit lower="-1" upper="1" effort="1&#9;" velocity="1"/>',
])  # fmt: skip
def test_joint_with_a_trailing_blank_is_rejected_unless_trimmed(
    name: str, part: str, tmp_path: Path
) -> None:
    with pytest.raises(EngineError, match=r"\.urdf:\d+: <\w+ \w+=.* has a space after the number"):
        load(name, urdf(part), tmp_path)
    trimmed = load(name, urdf(part), tmp_path, settings={"trimmed_numbers": True})
    assert trimmed.coordinates == ("j",)


@pytest.mark.parametrize("name", ["pinocchio", "sapien"])
def test_negative_mass_without_a_body_is_rejected_by_line(name: str, tmp_path: Path) -> None:
    below = BODY.replace('value="1"', 'value="-1"')
    with pytest.raises(EngineError, match=r"\.urdf:\d+: the mass of link 'a' is below zero, -1 kg"):
        load(name, urdf(body=below), tmp_path)


def test_pinocchio_adds_a_negative_mass_to_its_parent_link(tmp_path: Path) -> None:
    below = BODY.replace('value="1"', 'value="-0.001"')
    model = load("pinocchio", urdf(extra=WELDED.format(below)), tmp_path)
    still = np.zeros((1, 1))
    acceleration = model.accelerations(still, still, np.ones((1, 1)))
    assert acceleration == pytest.approx(np.full((1, 1), 1 / (0.01 + 0.01 - 0.001)))


def test_dart_drops_the_cubic_term_of_small_rotations_of_a_floating_root(tmp_path: Path) -> None:
    """Test the cause of an error of 7e-9 in a quadruped's motions, and its setting."""

    def turn(settings: dict[str, object]) -> tuple[np.ndarray, float]:
        model = load("dart", TUMBLING, tmp_path, settings={"floating": True, **settings})
        z, v = np.zeros((1, 7)), np.zeros((1, 7))
        v[0, 3:6] = [0.3, -0.2, 0.2]
        after, speeds = (one[0, 0, 3:6] for one in model.rollout(z, v, H, 1, None, 1))
        reached = unit_quaternion(after)
        spin = from_quaternion(reached) @ angular_velocity(after, speeds)
        expected = Rotation.from_rotvec(H * spin).as_quat(scalar_first=True)
        off = float(np.abs(reached - expected).max())
        return expected, off

    expected, off = turn({})
    cubic = (2 * np.linalg.norm(expected[1:])) ** 3 / 12
    assert off == pytest.approx(cubic, rel=0.7)
    assert off > 100 * turn({"exact_turns": True})[1]
    floating = load("dart", TUMBLING, tmp_path, settings={"floating": True})
    assert list(floating.corrective_settings.values()) == [{"exact_turns": True}]
    assert not load("dart", TUMBLING, tmp_path).corrective_settings
