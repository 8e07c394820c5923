"""How SAPIEN reads URDFs, as listed in `docs/engines/`."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck import check
from physics_crosscheck.engine import EngineError
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.records import Outcome
from tests.engines.extras import H, load, need
from tests.engines.test_extras_readings import MIMIC
from tests.engines.test_free_joints import TUMBLING
from tests.engines.test_readings import BELOW, BODY, WELDED, limit, moved, urdf

POINT = BELOW.replace("0.01", "0")
"""A mass of 1 kg without moments, 1 m below its link."""


def test_numbers_have_24_digits_and_dampers_act_at_the_end_of_a_step(tmp_path: Path) -> None:
    model = load("sapien", urdf('<dynamics damping="0.3"/>'), tmp_path)
    assert model.epsilon == np.finfo(np.float32).eps
    _, v = model.rollout(np.zeros((1, 1)), np.ones((1, 1)), 0.01, 1, None, 1)
    assert v[0, 0, 0] == pytest.approx(1 / (1 + 0.01 * 0.3 / 0.01), rel=1e-6)
    assert model.step_rule is not None
    assert model.step_rule.damping == pytest.approx(np.array([[0.3]]))


def test_dampers_act_in_each_of_ten_substeps(tmp_path: Path) -> None:
    model = load("sapien", urdf('<dynamics damping="0.3"/>'), tmp_path, settings={"solver": "TGS"})
    _, v = model.rollout(np.zeros((1, 1)), np.ones((1, 1)), 0.01, 1, None, 1)
    assert v[0, 0, 0] == pytest.approx((1 + 0.01 * 0.3 / 0.01 / 10) ** -10, rel=1e-4)
    assert model.step_rule is None


def test_friction_of_the_file_is_ignored_and_default_friction_is_a_cause(tmp_path: Path) -> None:
    text = urdf('<dynamics friction="0.2"/>', axis="0 0 1")
    still = load("sapien", text, tmp_path, 9.81)
    assert moved(still, 0.0, 1.0, 0.01)[1] == pytest.approx(1.0, abs=1e-6)
    for key, cause in (("joint_friction", "friction of joints"), ("link_damping", "of links")):
        model = load("sapien", text, tmp_path, 9.81, settings={key: 0.05})  # grows with load
        assert moved(model, 0.0, 1.0, 0.01)[1] < 1 - 1e-4
        ((name, remedy),) = model.corrective_settings.items()
        assert cause in name
        assert remedy == {key: 0.0}
        remarks = [one for one in model.remarks(np.zeros((1, 1)), np.zeros((1, 1))) if one.shows_in]
        assert [one.address for one in remarks] == [f"sidecar:settings.{key}"]


def test_setting_bounds_speeds(tmp_path: Path) -> None:
    free = load("sapien", urdf(body=BELOW), tmp_path)
    bounded = load("sapien", urdf(body=BELOW), tmp_path, settings={"bounded_speeds": True})
    assert moved(free, 0.0, 150.0, 0.01)[1] == pytest.approx(150.0, rel=1e-4)
    assert moved(bounded, 0.0, 150.0, 0.01)[1] < 101
    assert list(bounded.corrective_settings.values()) == [{"bounded_speeds": False}]


def test_limits_act_and_a_continuous_joint_keeps_turning(tmp_path: Path) -> None:
    model = load("sapien", limit(-0.5, 0.5), tmp_path)
    assert moved(model, 0.495, 1.0, 0.1)[0] == pytest.approx(0.5, abs=1e-3)
    assert model.limits.tolist() == [[-0.5, 0.5]]
    smooth = load("sapien", limit(-0.5, 0.5), tmp_path, settings={"smooth": True})
    assert moved(smooth, 0.495, 1.0, 0.1)[0] == pytest.approx(0.595, rel=1e-4)
    assert np.isinf(smooth.limits).all()
    turned = load("sapien", urdf(), tmp_path)
    assert moved(turned, 6.2, 20.0, 0.1)[0] == pytest.approx(8.2, rel=1e-4)
    assert moved(load("sapien", limit(1, -1), tmp_path), 2.0, 1.0, 0.1)[0] == pytest.approx(
        2.1, rel=1e-4
    )


def test_mimic_is_a_spring_and_is_reported(tmp_path: Path) -> None:
    model = load("sapien", urdf(extra=MIMIC), tmp_path)
    still = np.zeros((1, 2))
    assert any("spring of 1e5" in one.message for one in model.remarks(still, still))
    uncoupled = load("sapien", urdf(extra=MIMIC), tmp_path, settings={"couplings": False})
    assert not any("spring of 1e5" in one.message for one in uncoupled.remarks(still, still))


def test_point_mass_is_dropped_by_default(tmp_path: Path) -> None:
    model = load("sapien", urdf(body=POINT), tmp_path, 9.81)
    inertia = 1 / (moved(model, 0.0, 0.0, H, push=1.0)[1] / H)
    assert inertia == pytest.approx(1e-6, rel=1e-3)
    ((name, remedy),) = model.corrective_settings.items()
    assert "without mass or moments" in name
    corrected = load("sapien", urdf(body=POINT), tmp_path, 9.81, settings=remedy)
    assert 1 / (moved(corrected, 0.0, 0.0, H, push=1.0)[1] / H) == pytest.approx(1.0, rel=1e-5)
    assert corrected.corrective_settings == {}


def test_fixed_link_without_an_inertial_is_nearly_massless(tmp_path: Path) -> None:
    model = load("sapien", urdf(extra=WELDED.format("")), tmp_path)
    assert 1 / (moved(model, 0.0, 0.0, H, push=1.0)[1] / H) == pytest.approx(0.01, rel=3e-4)
    ((name, remedy),) = model.corrective_settings.items()
    assert "own inertia of a link without mass or moments" in name
    corrected = load("sapien", urdf(extra=WELDED.format("")), tmp_path, settings=remedy)
    assert 1 / (moved(corrected, 0.0, 0.0, H, push=1.0)[1] / H) == pytest.approx(0.01, rel=3e-6)
    heavy = load("sapien", urdf(extra=WELDED.format(BODY)), tmp_path)
    inertia = 0.01 + 0.01 + 1
    assert 1 / (moved(heavy, 0.0, 0.0, H, push=1.0)[1] / H) == pytest.approx(inertia, rel=1e-4)


def test_link_without_an_inertial_has_the_mass_of_its_collision_shapes(tmp_path: Path) -> None:
    box = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'
    model = load("sapien", urdf(body=box), tmp_path)
    inertia = 1000 * 0.1**3 * 2 * 0.1**2 / 12
    assert 1 / (moved(model, 0.0, 0.0, H, push=1.0)[1] / H) == pytest.approx(inertia, rel=1e-4)
    still = np.zeros((1, 1))
    assert any("collision shapes at 1000" in one.message for one in model.remarks(still, still))
    both = load("sapien", urdf(body=BODY + box), tmp_path)
    assert 1 / (moved(both, 0.0, 0.0, H, push=1.0)[1] / H) == pytest.approx(0.01, rel=1e-4)


def test_floating_root_moves_as_in_mujoco(tmp_path: Path) -> None:
    model = load("sapien", TUMBLING, tmp_path, settings={"floating": True})
    assert len(model.coordinates) == 7
    start, rates = np.zeros((1, 7)), np.array([[0.1, 0.2, 0.3, 1.0, -0.5, 0.7, 0.4]])
    start[0, 3:] = [0.5, -0.3, 0.2, 0.4]
    n = 500
    push = np.zeros((1, n, 7))
    push[..., :6] = [0.3, -0.2, 0.1, 0.05, 0.02, -0.1]
    ends = []
    for name in ("sapien", "mujoco"):  # both have order 1, with similar errors
        engine = load(name, TUMBLING, tmp_path, settings={"floating": True})
        ends.append([engine.rollout(start, rates, h, n, push, n)[0][0, 0] for h in (4e-4, 2e-4)])
    (_, ours), (_, theirs) = ends
    assert np.max(np.abs(ours - theirs)) < 2e-3 * np.max(np.abs(ours - start))


def test_poses_match_mujoco(tmp_path: Path) -> None:
    z = np.array([[0.1, 0.2, 0.3, 0.5, -0.3, 0.2, 0.4]])
    model, other = (
        load(name, TUMBLING, tmp_path, settings={"floating": True}) for name in ("sapien", "mujoco")
    )
    for place, theirs in (("link:a", "link:a"), ("centre:a", "centre:a")):
        (origins, turns), (points, axes) = model.poses([place], z), other.poses([theirs], z)
        assert origins == pytest.approx(points, abs=1e-6)
        assert turns == pytest.approx(axes, abs=1e-6)


@pytest.mark.parametrize("extra", [
    '<gazebo reference="a"><sensor><camera><image width="2" height="2"/><clip near="1" far="2"/>'
    "<horizontal_fov>1</horizontal_fov></camera></sensor></gazebo>",
    '<transmission name="t"><type>S</type><joint name="j"/><actuator name="m"><mechanicalReduction>'
    "reduction</mechanicalReduction></actuator></transmission>",
])  # fmt: skip
def test_sensors_and_transmissions_are_ignored(extra: str, tmp_path: Path) -> None:
    model = load("sapien", urdf(extra=extra), tmp_path)
    assert moved(model, 0.0, 1.0, 0.01)[0] == pytest.approx(0.01, rel=1e-4)


def test_invalid_inertias_and_solvers_are_rejected(tmp_path: Path) -> None:
    flat = BODY.replace('izz="0.01"', 'izz="0"')
    with pytest.raises(EngineError, match=r"sapien\.urdf: SAPIEN .*invalid moment"):
        load("sapien", urdf(body=flat), tmp_path)
    with pytest.raises(EngineError, match="solver is 'XPBD'; expected one of PGS, TGS"):
        load("sapien", urdf(), tmp_path, settings={"solver": "XPBD"})


@pytest.mark.parametrize(
    ("length", "outcome"), [("-0.75", Outcome.AGREES), ("-0.7515", Outcome.DIFFERS)]
)
def test_built_in_model_agrees_and_a_wrong_length_differs(
    length: str, outcome: Outcome, tmp_path: Path
) -> None:
    need("sapien")
    folder = tmp_path / "simple_pendulum"
    shutil.copytree(builtin() / "simple_pendulum", folder)
    model = folder / "robot.urdf"
    text = model.read_text()
    assert text.count('xyz="0 0 -0.75"/>') == 2  # the inertial and the visual
    model.write_text(text.replace('xyz="0 0 -0.75"/>', f'xyz="0 0 {length}"/>', 1))
    (case,) = (
        case
        for case in check(folder, engines=["sapien"], baseline=tmp_path).cases
        if case.scenario == "free"
    )
    assert case.outcome is outcome
