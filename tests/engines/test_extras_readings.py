"""What engines of extras make of one URDF, as `docs/engines/` tabulates it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.harness.engines.conformance import CHECKS, conform_samples
from physics_crosscheck.harness.engines.protocol import EngineError, ModelSpec
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.reference.mechanism.rotations import (
    angular_velocity,
    exponential,
    from_quaternion,
    unit_quaternion,
)
from tests.engines.extras import EXTRAS, H, load, need
from tests.engines.test_free_joints import TUMBLING
from tests.engines.test_readings import BELOW, BODY, limit, moved, urdf

MIMIC = (
    f'<link name="b">{BODY}</link><joint name="k" type="continuous"><parent link="g"/>'
    '<child link="b"/><axis xyz="0 1 0"/><mimic joint="j" multiplier="2"/></joint>'
)
WELDED = (
    '<link name="tip">{}</link><joint name="w" type="fixed"><parent link="a"/><child link="tip"/>'
    '<origin xyz="1 0 0"/></joint>'
)


@pytest.mark.parametrize("name", EXTRAS)
def test_adapters_keep_the_protocol(name: str) -> None:
    need(name)
    found = conform_samples(engines()[name])
    assert {Path(file).suffix for file in found} == set(engines()[name].formats)
    for checks in found.values():
        assert len(checks) == len(CHECKS)
        assert [str(check) for check in checks if not check.passed] == []


@pytest.mark.parametrize("name", EXTRAS)
def test_damping_is_applied(name: str, tmp_path: Path) -> None:
    model = load(name, urdf('<dynamics damping="0.3"/>'), tmp_path)
    assert moved(model, 0.0, 1.0, 0.01)[1] == pytest.approx(np.exp(-0.3), rel=2e-3)


@pytest.mark.parametrize("name", ["pinocchio", "idyntree"])
def test_some_themselves_leave_damping_out_and_a_remedy_brings_it(
    name: str, tmp_path: Path
) -> None:
    text = urdf('<dynamics damping="0.3"/>')
    model = load(name, text, tmp_path, settings={"damping": False})
    assert moved(model, 0.0, 1.0, 0.01)[1] == 1.0
    (undone,) = model.corrective_settings.values()
    again = load(name, text, tmp_path, settings=undone)
    assert moved(again, 0.0, 1.0, 0.01)[1] < 0.75


@pytest.mark.parametrize(("name", "left"), [
    ("pinocchio", 1.0), ("drake", 1.0), ("dart", 0.8), ("idyntree", 1.0),
])  # fmt: skip
def test_friction_is_applied_by_dart_unless_all_is_to_be_smooth(
    name: str, left: float, tmp_path: Path
) -> None:
    text = urdf('<dynamics friction="0.2"/>')
    model = load(name, text, tmp_path)
    assert moved(model, 0.0, 1.0, 0.01)[1] == pytest.approx(left, abs=1e-6)
    smooth = load(name, text, tmp_path, settings={"smooth": True})
    assert moved(smooth, 0.0, 1.0, 0.01)[1] == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(("name", "stopped"), [
    ("pinocchio", False), ("drake", True), ("dart", False), ("idyntree", False),
])  # fmt: skip
def test_limits_stop_a_joint_in_drakes_discrete_plants_alone(
    name: str, stopped: bool, tmp_path: Path
) -> None:
    model = load(name, limit(-0.5, 0.5), tmp_path)
    q, v = moved(model, 0.495, 1.0, 0.1)
    assert (v < 0.5) is stopped
    assert np.isfinite(model.limits).all() == stopped
    if not stopped:
        assert q == pytest.approx(0.595)


@pytest.mark.parametrize("name", EXTRAS)
def test_crossed_limits_are_none(name: str, tmp_path: Path) -> None:
    assert moved(load(name, limit(1, -1), tmp_path), 2.0, 1.0, 0.1)[0] == pytest.approx(2.1)


@pytest.mark.parametrize("name", EXTRAS)
def test_springs_of_gazebo_pull(name: str, tmp_path: Path) -> None:
    spring = '<gazebo reference="j"><springStiffness>50</springStiffness></gazebo>'
    q, _ = moved(load(name, urdf(beside=spring), tmp_path), 0.1, 0.0, 0.01)
    assert q == pytest.approx(0.1 * np.cos(np.sqrt(5000) * 0.01), rel=5e-3)


@pytest.mark.parametrize(("name", "settings", "off", "led"), [
    ("pinocchio", {}, 1e-13, 0.2), ("pinocchio", {"hold_mimics": False}, 0.41, 1.0),
    ("drake", {}, 1e-6, 0.2), ("drake", {"stepping": "tamsi"}, 0.41, 1.0),
    ("drake", {"stepping": "continuous"}, 0.41, 1.0),
    ("drake", {"stepping": "continuous", "hold_mimics": True}, 1e-13, 0.2),
    ("dart", {}, 1e-2, 1.0),
    ("idyntree", {}, 1e-13, 0.2), ("idyntree", {"hold_mimics": False}, 0.41, 1.0),
])  # fmt: skip
def test_a_mimic_is_left_out_held_or_a_servo(
    name: str, settings: dict[str, object], off: float, led: float, tmp_path: Path
) -> None:
    model = load(name, urdf(beside=MIMIC), tmp_path, settings=settings)
    at = [model.coordinates.index(one) for one in ("j", "k")]
    push = np.zeros((1, 1000, 2))
    push[:, :, at[0]] = 0.004
    still = np.zeros((1, 2))
    z, _ = model.rollout(still, still, 1e-3, 1000, push, 1000)
    leader, follower = z[0, 0, at]
    # 0.01 kg m^2 alone, or with that of the follower times the square of its ratio.
    assert leader == pytest.approx(led * 0.004 / 0.01 / 2, rel=5e-3)
    assert abs(follower - 2 * leader) <= off
    told = any("servo" in remark.message for remark in model.remarks(still, still))
    assert (told or bool(model.corrective_settings)) is (led == 1.0)
    assert told is (name == "dart")


@pytest.mark.parametrize(("ratio", "holds"), [(0.5, True), (1.0, True), (2.0, False)])
def test_a_coupler_of_dart_holds_what_is_slower_than_its_leader_and_blows_up_on_what_is_faster(
    ratio: float, holds: bool, tmp_path: Path
) -> None:
    text = urdf(beside=MIMIC.replace('"2"', f'"{ratio}"'))
    model = load("dart", text, tmp_path, settings={"couplers": True})
    push = np.ones((1, 500, 2)) * [0.004, 0.0]
    z, _ = model.rollout(np.zeros((1, 2)), np.zeros((1, 2)), H, 500, push, 500)
    wanted = 0.004 / (0.01 * (1 + ratio**2)) * 0.05**2 / 2
    right = z[0, 0] == pytest.approx([wanted, ratio * wanted], rel=0.01)
    assert right is holds


@pytest.mark.parametrize("name", EXTRAS)
def test_a_mimic_that_is_not_meant_is_left_out(name: str, tmp_path: Path) -> None:
    model = load(name, urdf(beside=MIMIC), tmp_path, settings={"couplings": False})
    push = np.ones((1, 10, 2)) * [0.0, 0.01]
    z, _ = model.rollout(np.zeros((1, 2)), np.zeros((1, 2)), 1e-3, 10, push, 10)
    assert np.count_nonzero(z) == 1
    assert model.corrective_settings == {}


@pytest.mark.parametrize("name", EXTRAS)
def test_a_long_axis_is_made_a_unit_vector(name: str, tmp_path: Path) -> None:
    _, once = moved(load(name, urdf(body=BELOW), tmp_path, 9.81), 0.5, 0.0, 0.01)
    _, twice = moved(load(name, urdf(body=BELOW, axis="0 2 0"), tmp_path, 9.81), 0.5, 0.0, 0.01)
    assert twice == pytest.approx(once, rel=1e-12)


@pytest.mark.parametrize(("name", "felt"), [
    ("pinocchio", 0.01), ("drake", 0.01), ("dart", 0.01 + 1 + 1),
])  # fmt: skip
def test_a_welded_link_without_inertia_is_a_kilogram_in_dart_unless_told(
    name: str, felt: float, tmp_path: Path
) -> None:
    model = load(name, urdf(beside=WELDED.format("")), tmp_path)
    assert moved(model, 0.0, 0.0, H, push=1.0)[1] / H == pytest.approx(1 / felt, rel=1e-6)
    for undone in model.corrective_settings.values():
        told = load(name, urdf(beside=WELDED.format("")), tmp_path, settings=undone)
        assert moved(told, 0.0, 0.0, H, push=1.0)[1] / H == pytest.approx(1 / 0.01)
        assert told.corrective_settings == {}


@pytest.mark.parametrize(("name", "refused"), [
    ("pinocchio", False), ("drake", True), ("dart", False), ("idyntree", False),
])  # fmt: skip
@pytest.mark.parametrize("body", [
    BODY.replace('ixx="0.01"', 'ixx="0.1"'),
    '<inertial><mass value="0"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    "</inertial>",
], ids=["no triangle", "moments without mass"])  # fmt: skip
def test_an_inertia_for_which_drake_takes_a_ball_is_refused(
    name: str, refused: bool, body: str, tmp_path: Path
) -> None:
    text = urdf(beside=WELDED.format(body))
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
def test_what_is_no_slide_or_hinge_is_refused(name: str, kind: str, tmp_path: Path) -> None:
    with pytest.raises(
        EngineError, match=f"{name}.urdf: joint '[aj]' is neither a slide nor a hinge"
    ):
        load(name, urdf(kind=kind), tmp_path)


def test_what_idyntree_reads_over_with_an_error_is_refused(tmp_path: Path) -> None:
    with pytest.raises(EngineError, match=r"idyntree\.urdf: iDynTree can't load it: .* floating"):
        load("idyntree", urdf(kind="floating"), tmp_path)


def test_links_without_mass_are_frames_to_idyntree_and_its_remedy_keeps_their_moments(
    tmp_path: Path,
) -> None:
    tip = '<inertial><mass value="0"/><inertia ixx="1" iyy="0.04" izz="1" ixy="0" ixz="0" iyz="0"/>'
    text = urdf(beside=WELDED.format(f"{tip}</inertial>"))
    push = np.full((1, 100, 1), 0.1)
    rest = np.zeros((1, 1))
    for settings, inertia in ({}, 0.01), ({"massless_links": True}, 0.05):
        model = load("idyntree", text, tmp_path, settings=settings)
        _, w = model.rollout(rest, rest, H, 100, push, 100)
        assert w[0, 0, 0] == pytest.approx(0.1 * 100 * H / inertia, rel=1e-9)
        undone = [] if settings else [{"massless_links": True}]
        assert list(model.corrective_settings.values()) == undone
        assert "link:tip" in model.places
        assert ("centre:tip" in model.places) is bool(settings)


@pytest.mark.parametrize("name", ["pinocchio", "dart"])
def test_what_the_parser_prints_is_the_reason_of_a_refusal(name: str, tmp_path: Path) -> None:
    with pytest.raises(EngineError, match="is of type REVOLUTE but it does not specify limits"):
        load(name, urdf(kind="revolute"), tmp_path)


def test_a_revolute_joint_without_limits_is_free_in_drake(tmp_path: Path) -> None:
    model = load("drake", urdf(kind="revolute"), tmp_path)
    assert moved(model, 2.0, 1.0, 0.1)[0] == pytest.approx(2.1)


@pytest.mark.parametrize(
    ("name", "taken"),
    [
        ("pinocchio", False),
        ("drake", True),
        ("dart", False),
    ],
)
def test_dynamics_that_state_nothing_are_taken_by_drake_alone(
    name: str, taken: bool, tmp_path: Path
) -> None:
    if taken:
        load(name, urdf("<dynamics/>"), tmp_path)
    else:
        with pytest.raises(EngineError, match="no damping and no friction"):
            load(name, urdf("<dynamics/>"), tmp_path)


@pytest.mark.parametrize("name", EXTRAS)
def test_bodies_of_one_robot_do_not_touch(name: str, tmp_path: Path) -> None:
    ball = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
    text = urdf(body=BODY + ball).replace(f'name="g">{BODY}', f'name="g">{BODY}{ball}')
    assert text.count(ball) == 2
    assert moved(load(name, text, tmp_path), 0.0, 1.0, 0.01)[1] == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("name", EXTRAS)
def test_step_and_gravity_must_be_stated(name: str, tmp_path: Path) -> None:
    need(name)
    path = tmp_path / "bare.urdf"
    path.write_text(urdf())
    with pytest.raises(EngineError, match="must set step"):
        engines()[name].load(ModelSpec(path))


@pytest.mark.parametrize("name", EXTRAS)
def test_products_of_inertia_lose_no_digits(name: str, tmp_path: Path) -> None:
    tensor = np.array([[0.07, 0.011, -0.007], [0.011, 0.06, 0.005], [-0.007, 0.005, 0.08]])
    axis = np.array([0.6, -0.48, 0.64])
    keys = {f"i{'xyz'[i]}{'xyz'[j]}": float(tensor[i, j]) for i in range(3) for j in range(i, 3)}
    words = " ".join(f'{key}="{value!r}"' for key, value in keys.items())
    body = f'<inertial><mass value="1"/><inertia {words}/></inertial>'
    model = load(name, urdf(body=body, axis=" ".join(map(str, axis))), tmp_path)
    still = np.zeros((1, 1))
    _, w = model.rollout(still, still, 1e-3, 1, np.ones((1, 1, 1)), 1)
    assert float(w[0, 0, 0]) / 1e-3 * float(axis @ tensor @ axis) == pytest.approx(1, abs=1e-13)


@pytest.mark.parametrize("name", EXTRAS)
@pytest.mark.parametrize("root", ["g", "world"])
def test_the_root_is_what_hangs_from_nothing_wherever_it_stands(
    name: str, root: str, tmp_path: Path
) -> None:
    ground = f'<link name="g">{BODY}</link>'
    text = urdf(body=BELOW)
    assert ground in text
    text = text.replace(ground, "").replace("</robot>", f"{ground}</robot>")
    model = load(name, text.replace('"g"', f'"{root}"'), tmp_path)
    assert model.coordinates == ("j",)
    assert moved(model, 0.0, 0.0, H, push=1.0)[1] / H == pytest.approx(1 / 1.01, rel=1e-9)


@pytest.mark.parametrize("name", EXTRAS)
def test_frames_are_where_the_file_puts_them(name: str, tmp_path: Path) -> None:
    model = load(name, urdf(body=BELOW), tmp_path)
    assert {"link:g", "link:a", "centre:a"} <= set(model.places)
    origins, turns = model.poses(["link:a", "centre:a"], np.array([[0.5]]))
    np.testing.assert_allclose(origins[0], [[0, 0, 0], [-np.sin(0.5), 0, -np.cos(0.5)]], atol=1e-15)
    np.testing.assert_allclose(turns[0, 0] @ [0, 0, -1], origins[0, 1], atol=1e-15)


@pytest.mark.parametrize("name", ["pinocchio", "dart"])
@pytest.mark.parametrize(("number", "place"), [
    ('value="1"', 'mass value="1 "'), ('iyy="0.01"', 'inertia iyy="0.01 "'),
])  # fmt: skip
def test_urdfdom_drops_an_inertial_with_a_blank_after_a_number_and_a_cause_names_its_line(
    name: str, number: str, place: str, tmp_path: Path
) -> None:
    def with_body(old: str, new: str) -> str:
        return urdf(beside=WELDED.format(BODY), body=BODY.replace(old, new))

    before, after = with_body('="', '=" '), with_body(number, f'{number[:-1]} "')
    assert load(name, before, tmp_path).corrective_settings == {}
    model = load(name, after, tmp_path)
    ((cause, undone),) = model.corrective_settings.items()
    assert f"{name}.urdf:1: <{place}>" in cause
    mended = load(name, after, tmp_path, settings=undone)
    assert mended.corrective_settings == {}
    still = np.zeros((1, len(model.coordinates)))
    push = np.ones_like(still)
    given, whole = (one.accelerations(still, still, push) for one in (model, mended))
    assert given is not None
    assert whole is not None
    assert whole == pytest.approx(np.full((1, 1), 1 / (0.01 + 0.01 + 1)))
    assert abs(given - whole).max() > 1e-3


@pytest.mark.parametrize("name", ["pinocchio", "dart"])
@pytest.mark.parametrize("part", [
    '<dynamics damping="0.3 "/>', '<limit lower="-1" upper="1 " effort="1" velocity="1"/>',
    '<limit lower="-1" upper="1" effort="1&#9;" velocity="1"/>',
])  # fmt: skip
def test_urdfdom_reads_no_joint_with_a_blank_after_a_number(
    name: str, part: str, tmp_path: Path
) -> None:
    with pytest.raises(EngineError, match=r"\.urdf:\d+: <\w+ \w+=.* has a space after the number"):
        load(name, urdf(part), tmp_path)
    trimmed = load(name, urdf(part), tmp_path, settings={"trimmed_numbers": True})
    assert trimmed.coordinates == ("j",)


@pytest.mark.parametrize("name", ["pinocchio", "sapien"])
def test_a_mass_below_zero_is_refused_by_line_where_no_body_is_made_of_it(
    name: str, tmp_path: Path
) -> None:
    below = BODY.replace('value="1"', 'value="-1"')
    with pytest.raises(EngineError, match=r"\.urdf:\d+: the mass of link 'a' is below zero, -1 kg"):
        load(name, urdf(body=below), tmp_path)


def test_pinocchio_adds_a_mass_below_zero_to_what_it_is_welded_to(tmp_path: Path) -> None:
    below = BODY.replace('value="1"', 'value="-0.001"')
    model = load("pinocchio", urdf(beside=WELDED.format(below)), tmp_path)
    still = np.zeros((1, 1))
    found = model.accelerations(still, still, np.ones((1, 1)))
    assert found == pytest.approx(np.full((1, 1), 1 / (0.01 + 0.01 - 0.001)))


def test_dart_drops_the_cubic_term_of_small_turns_of_a_root_that_floats(tmp_path: Path) -> None:
    """Motions of a quadruped are 7e-9 off by that; a setting turns it here."""

    def turn(settings: dict[str, object]) -> tuple[np.ndarray, float]:
        model = load("dart", TUMBLING, tmp_path, settings={"floating": True, **settings})
        z, v = np.zeros((1, 7)), np.zeros((1, 7))
        v[0, 3:6] = [0.3, -0.2, 0.2]
        after, speeds = (one[0, 0, 3:6] for one in model.rollout(z, v, H, 1, None, 1))
        reached = unit_quaternion(after)
        spin = from_quaternion(reached) @ angular_velocity(after, speeds)
        wanted = exponential(H * spin)
        off = float(np.abs(reached - wanted).max())
        return wanted, off

    wanted, off = turn({})
    cubic = (2 * np.linalg.norm(wanted[1:])) ** 3 / 12
    assert off == pytest.approx(cubic, rel=0.7)
    assert off > 100 * turn({"exact_turns": True})[1]
    floating = load("dart", TUMBLING, tmp_path, settings={"floating": True})
    assert list(floating.corrective_settings.values()) == [{"exact_turns": True}]
    assert not load("dart", TUMBLING, tmp_path).corrective_settings
