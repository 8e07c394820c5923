"""How Newton reads URDFs and MJCFs, as listed in `docs/engines/`."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.engine import EngineError, LoadedModel, ModelSpec
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.modelfiles.readers import robot_system
from physics_crosscheck.harness.modelfiles.usd import read
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from tests.engines.extras import H, load, need
from tests.engines.test_extras_readings import MIMIC
from tests.engines.test_readings import BODY, WELDED, limit, moved, urdf
from tests.robots.usd import edited

HINGE = '<joint name="j" type="hinge" axis="0 1 0" {}/>'
INERTIAL = '<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>'


def mjcf(
    folder: Path, body: str, extra: str = "", settings: Mapping[str, object] | None = None
) -> LoadedModel:
    need("newton")
    path = folder / "sample.xml"
    compiler = '<compiler angle="radian"/>'
    path.write_text(f"<mujoco>{compiler}<worldbody>{body}</worldbody>{extra}</mujoco>")
    return engines()["newton"].load(ModelSpec(path, settings=settings or {}))


def test_numbers_have_24_digits_and_damping_is_applied(tmp_path: Path) -> None:
    model = load("newton", urdf('<dynamics damping="0.3"/>'), tmp_path)
    assert model.epsilon == np.finfo(np.float32).eps
    assert moved(model, 0.0, 1.0, 0.01)[1] == pytest.approx(np.exp(-0.3), rel=2e-3)


def test_friction_is_ignored_and_limits_are_springs(tmp_path: Path) -> None:
    slid = moved(load("newton", urdf('<dynamics friction="0.2"/>'), tmp_path), 0.0, 1.0, 0.01)
    assert slid[1] == 1.0
    model = load("newton", limit(-0.5, 0.5), tmp_path)
    assert moved(model, 0.495, 1.0, 0.1)[1] < 0
    assert model.limits.tolist() == [[-0.5, 0.5]]
    free = load("newton", limit(-0.5, 0.5), tmp_path, settings={"smooth": True})
    assert moved(free, 0.495, 1.0, 0.1)[0] == pytest.approx(0.595, rel=1e-4)
    assert np.isinf(free.limits).all()


def test_limits_of_a_continuous_joint_act_and_are_reported(tmp_path: Path) -> None:
    model = load("newton", urdf('<limit lower="0" upper="0" effort="1" velocity="9"/>'), tmp_path)
    assert abs(moved(model, 0.5, 1.0, 0.01)[1] - 1.0) > 1
    still = np.zeros((1, 1))
    assert any("is continuous" in one.message for one in model.remarks(still, still))


def test_mimic_is_constrained_through_the_mass_matrix(tmp_path: Path) -> None:
    model = load("newton", urdf(extra=MIMIC), tmp_path)
    push = np.ones((1, 1000, 2)) * [0.004, 0.0]
    z, _ = model.rollout(np.zeros((1, 2)), np.zeros((1, 2)), 1e-3, 1000, push, 1000)
    assert z[0, 0, 0] == pytest.approx(0.2 * 0.004 / 0.01 / 2, rel=5e-3)
    assert z[0, 0, 1] == pytest.approx(2 * z[0, 0, 0], rel=1e-5)


def test_small_inertias_are_enlarged_by_default(tmp_path: Path) -> None:
    text = urdf(extra=WELDED.format(BODY.replace('ixx="0.01"', 'ixx="0.1"')))
    iyy = 0.01 + 1 + 0.01
    model = load("newton", text, tmp_path)
    assert 1 / (moved(model, 0.0, 0.0, H, push=1.0)[1] / H) == pytest.approx(iyy + 0.08, rel=1e-4)
    (remedy,) = model.corrective_settings.values()
    corrected = load("newton", text, tmp_path, settings=remedy)
    assert 1 / (moved(corrected, 0.0, 0.0, H, push=1.0)[1] / H) == pytest.approx(iyy, rel=1e-5)
    assert corrected.corrective_settings == {}


def test_merged_fixed_links_are_heavier_and_their_setting_is_a_cause(tmp_path: Path) -> None:
    text = urdf(extra=WELDED.format(BODY.replace('value="0"', 'value="1"')))
    whole = load("newton", text, tmp_path)
    joined = load("newton", text, tmp_path, settings={"collapse_fixed_joints": True})
    inertia = [1 / (moved(one, 0.0, 0.0, H, push=1.0)[1] / H) for one in (whole, joined)]
    assert inertia[1] > 1.2 * inertia[0]
    assert list(joined.corrective_settings.values()) == [{"collapse_fixed_joints": False}]
    assert whole.corrective_settings == {}


@pytest.mark.parametrize(("extra", "push", "inertia"), [("", 1.0, 0.01), (MIMIC, 3.0, 0.05)])
def test_dozens_of_fixed_links_weigh_what_they_state(
    extra: str, push: float, inertia: float, tmp_path: Path
) -> None:
    links = [WELDED.format(BODY).replace('"tip"', f'"t{i}"') for i in range(32)]
    welded = "".join(one.replace('"w"', f'"w{i}"') for i, one in enumerate(links))
    model = load("newton", urdf(extra=welded + extra), tmp_path)
    total = inertia + 32 * (0.01 + 1)
    assert moved(model, 0.0, 0.0, H, push=1.0)[1] / H == pytest.approx(push / total, rel=1e-5)


def test_joints_without_inertia_or_of_other_types_are_rejected(tmp_path: Path) -> None:
    with pytest.raises(EngineError, match="moves nothing with inertia"):
        load("newton", urdf(body=""), tmp_path)
    with pytest.raises(EngineError, match="is neither a slide nor a hinge"):
        load("newton", urdf(kind="floating"), tmp_path)


def test_mjcf_sets_step_gravity_and_zero(tmp_path: Path) -> None:
    joint = HINGE.format('ref="0.4"')
    options = '<option timestep="0.003" gravity="0 0 -5"/>'
    model = mjcf(tmp_path, f"<body>{joint}{INERTIAL}</body>", options)
    assert (model.step, model.gravity) == (0.003, (0.0, 0.0, -5.0))
    assert model.home == pytest.approx([0.4])
    still = np.zeros((1, 1))
    assert sum("ignores <option" in one.message for one in model.remarks(still, still)) == 2


@pytest.mark.parametrize(("setting", "extra"), [
    ("tendons", '<tendon><fixed stiffness="3" springlength="0"><joint joint="j" coef="1"/></fixed>'
     "</tendon>"),
    ("equalities", '<equality><joint joint1="j" joint2="k" polycoef="0 2 0 0 0"/></equality>'),
])  # fmt: skip
def test_features_that_its_solver_lacks_are_added_by_default(
    setting: str, extra: str, tmp_path: Path
) -> None:
    inner = HINGE.format("").replace('"j"', '"k"')
    bodies = f"<body>{HINGE.format('')}{INERTIAL}<body>{inner}{INERTIAL}</body></body>"
    ends = []
    for on in (True, False):
        model = mjcf(tmp_path, bodies, extra, {setting: on, "gravity": [0.0, 0.0, 0.0]})
        start = np.array([[0.1, 0.05]])
        z, _ = model.rollout(start, np.ones((1, 2)), 1e-3, 100, None, 100)
        ends.append(z[0, 0])
        assert list(model.corrective_settings.values()) == ([] if on else [{setting: True}])
    assert np.max(np.abs(ends[1] - ends[0])) > 1e-3
    assert ends[1] == pytest.approx([0.2, 0.15], rel=1e-4)


@pytest.mark.parametrize(("extra", "why"), [
    ('<actuator><motor joint="j"/></actuator>', "actuators"),
    ('<option density="1.2"/>', "a medium"),
])  # fmt: skip
def test_features_that_are_not_added_are_rejected(extra: str, why: str, tmp_path: Path) -> None:
    with pytest.raises(EngineError, match=f"{why}, which Newton's own solvers leave out"):
        mjcf(tmp_path, f"<body>{HINGE.format('')}{INERTIAL}</body>", extra)


def test_springs_dampers_and_drives_that_the_file_disables_do_not_act(tmp_path: Path) -> None:
    pulls = 'stiffness="3" damping="0.4"'
    body = f"<body>{HINGE.format(pulls)}{INERTIAL}</body>"
    ball = f'<body><joint type="ball" {pulls}/>{INERTIAL}</body>'
    flags = '<option><flag spring="disable" damper="disable" actuation="disable"/></option>'
    drive = f'<actuator><motor joint="j"/></actuator><tendon><fixed {pulls}><joint joint="j" '
    model = mjcf(tmp_path, body + ball, f'{flags}{drive}coef="1"/></fixed></tendon>')
    start = np.full((1, len(model.coordinates)), 0.1)
    z, _ = model.rollout(start, 0 * start, 1e-3, 100, None, 100)
    free, _ = mjcf(tmp_path, (body + ball).replace(pulls, "")).rollout(
        start, 0 * start, 1e-3, 100, None, 100
    )
    assert z == pytest.approx(free, abs=1e-6)


@pytest.mark.parametrize("joint", ['<freejoint name="f"/>', '<joint name="f" type="ball"/>'])
def test_free_and_ball_joints_match_mujoco(joint: str, tmp_path: Path) -> None:
    """Compare velocities, forces and rotations in the same coordinates."""
    inertial = '<inertial pos="0.1 -0.2 0.3" mass="2" diaginertia="0.1 0.2 0.25"/>'
    model = mjcf(tmp_path, f"<body>{joint}{inertial}</body>")
    spec = ModelSpec(tmp_path / "sample.xml", settings={"integrator": "RK4"})
    other = engines()["mujoco"].load(spec)
    assert model.coordinates == other.coordinates
    rng = np.random.default_rng(1)
    q, v = rng.normal(size=(2, 3, len(model.coordinates)))
    push = np.repeat(rng.normal(size=(3, 1, q.shape[1])), 200, axis=1)
    once = model.rollout(q, v, 5e-4, 200, push, 200)
    twice = model.rollout(q, v, 2.5e-4, 400, np.repeat(push, 2, axis=1), 400)
    right = other.rollout(q, v, 5e-4, 200, push, 200)
    for coarse, fine, expected, start in zip(once, twice, right, (q, v), strict=True):
        end = 2 * fine - coarse  # extrapolates order 1
        assert np.max(np.abs(end - expected)) < 2e-4 * np.max(np.abs(expected[:, 0] - start))


def usd(folder: Path, text: str, **settings: object) -> LoadedModel:
    need("newton")
    pytest.importorskip("newton_usd_schemas")
    path = folder / "arm.usda"
    path.write_text(text)
    return engines()["newton"].load(ModelSpec(path, settings={"step": H, **settings}))


@pytest.mark.parametrize("up", ["Z", "Y"])
def test_a_usd_arm_accelerates_as_its_equations(up: str, tmp_path: Path) -> None:
    model = usd(tmp_path, edited(('upAxis = "Z"', f'upAxis = "{up}"')), smooth=True)
    tree = robot_system(read(tmp_path / "arm.usda", {}))
    q, v = np.array([[-1.6, 0.4]]), np.array([[1.0, -2.0]])  # beyond the limit of the shoulder
    mass, force = TreeEquations(tree).mechanics(q, v, np.zeros((1, 2)))
    expected = np.linalg.solve(mass[0], force[0])
    assert model.coordinates == ("shoulder", "elbow")
    after = model.rollout(q, v, 1e-3, 1, None, 1)[1]
    assert (after[0, 0] - v[0]) / 1e-3 == pytest.approx(expected, rel=2e-4)


def test_what_newton_makes_of_a_usd_file_has_a_cause(tmp_path: Path) -> None:
    root = '(\n    prepend apiSchemas = ["PhysicsArticulationRootAPI"]\n)'
    with pytest.raises(EngineError, match=r"arm.usda:\d+: joint /arm/\w+ is in no articulation"):
        usd(tmp_path, edited((root, "")))
    usd(tmp_path, edited((root, "")), articulations=True)
    zeros = ("= (0.0035, 0.003, 0.001)", "= (0, 0, 0)")
    point = usd(tmp_path, edited(zeros))
    assert any("inertias that Newton changes (lower)" in one for one in point.corrective_settings)
    with pytest.raises(EngineError, match=r"arm.usda:4: metersPerUnit is 0.01; Newton converts no"):
        usd(tmp_path, edited(("metersPerUnit = 1", "metersPerUnit = 0.01")))
    follows = "rel newton:mimicJoint = </arm/shoulder>\n        float newton:damping"
    usd(
        tmp_path,
        edited(('"NewtonJointAPI"', '"NewtonMimicAPI"'), ("float newton:damping", follows)),
    )
    words = ["--engine", "newton", "--smooth", "--out", str(tmp_path / "out")]
    assert main(["run", str(tmp_path / "arm.usda"), *words]) == 0  # read before the schemas


def test_a_mass_below_the_precision_of_motions_differs_by_the_equations(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    damping = "float newton:damping"
    usd(tmp_path, edited((damping, f"float newton:velocityLimit = 90\n{damping}")))
    heavier = ("physics:mass = 1.5", "physics:mass = 1.5003")
    faster = (damping, f"float newton:velocityLimit = 180\n{damping}")
    (tmp_path / "b.usda").write_text(edited(heavier, faster))
    files = [str(tmp_path / name) for name in ("arm.usda", "b.usda")]
    assert main(["compare", *files, "--out", str(tmp_path / "out")]) == 1
    output = capsys.readouterr().out
    assert "mass of link upper: 1.5" in output
    assert "velocity of joint elbow: 1.57079633 in A, 3.14159265 in B" in " ".join(output.split())
