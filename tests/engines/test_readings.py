"""How engines read one URDF, as listed in `docs/engines/`."""

from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.engine import Array, EngineError, LoadedModel, ModelSpec
from physics_crosscheck.harness.engines.registry import engines
from tests.engines.extras import EXTRAS, H, load, need
from tests.models import written

BOTH = ("mujoco", "pybullet")
ALL = (*BOTH, *EXTRAS)
SMALL = '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>'
BODY = f'<inertial><mass value="1"/>{SMALL}</inertial>'
BELOW = f'<inertial><origin xyz="0 0 -1"/><mass value="1"/>{SMALL}</inertial>'
WELDED = (
    '<link name="tip">{}</link><joint name="w" type="fixed"><parent link="a"/><child link="tip"/>'
    '<origin xyz="1 0 0"/></joint>'
)


@pytest.fixture(autouse=True)
def _engines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its log to the working directory


def urdf(
    in_joint: str = "", *, body: str = BODY, kind: str = "continuous", axis: str = "0 1 0",
    extra: str = "",
) -> str:  # fmt: skip
    """Return a hinge about y with a body of 1 kg and 0.01 kg m^2."""
    return (
        f'<robot name="r"><link name="g">{BODY}</link><link name="a">{body}</link>'
        f'<joint name="j" type="{kind}"><parent link="g"/><child link="a"/><axis xyz="{axis}"/>'
        f"{in_joint}</joint>{extra}</robot>"
    )


def limit(lower: float, upper: float, velocity: float = 100) -> str:
    inside = f'<limit lower="{lower}" upper="{upper}" effort="1" velocity="{velocity}"/>'
    return urdf(inside, kind="revolute")


def moved(
    model: LoadedModel, q: float, v: float, seconds: float, push: float | None = None
) -> tuple[float, float]:
    """Return position and velocity of the first joint, with equal pushes on all joints."""
    start: Array = np.ones((1, len(model.coordinates)))
    n = round(seconds / H)
    force = None if push is None else push * np.ones((1, n, len(model.coordinates)))
    z, w = model.rollout(q * start, v * start, H, n, force, n)
    return float(z[0, 0, 0]), float(w[0, 0, 0])


@pytest.mark.parametrize("name", ALL)
def test_damping_is_applied(name: str, tmp_path: Path) -> None:
    model = load(name, urdf('<dynamics damping="0.3"/>'), tmp_path)
    assert moved(model, 0.0, 1.0, 0.01)[1] == pytest.approx(np.exp(-0.3), rel=2e-3)


@pytest.mark.parametrize("name", ALL)
def test_mujoco_and_dart_apply_friction_unless_smooth(name: str, tmp_path: Path) -> None:
    text, speed = urdf('<dynamics friction="0.2"/>'), 0.8 if name in ("mujoco", "dart") else 1.0
    assert moved(load(name, text, tmp_path), 0.0, 1.0, 0.01)[1] == pytest.approx(speed, abs=1e-6)
    smooth = load(name, text, tmp_path, settings={"smooth": True})
    assert moved(smooth, 0.0, 1.0, 0.01)[1] == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("name", ALL)
def test_limits_act_in_mujoco_pybullet_and_discrete_drake_plants(name: str, tmp_path: Path) -> None:
    model = load(name, limit(-0.5, 0.5), tmp_path)
    q, v = moved(model, 0.495, 1.0, 0.1)
    stopped = name in (*BOTH, "drake")
    if stopped:
        assert v < (0.5 if name == "drake" else 0.0)
    else:
        assert q == pytest.approx(0.595)
    assert np.isfinite(model.limits).all() == stopped


@pytest.mark.parametrize(("name", "q"), [("mujoco", 0.1), ("pybullet", 0.0)])
def test_equal_limits_hold_a_joint_in_pybullet(name: str, q: float, tmp_path: Path) -> None:
    assert moved(load(name, limit(0, 0), tmp_path), 0.0, 1.0, 0.1)[0] == pytest.approx(q)


@pytest.mark.parametrize("name", ALL)
def test_crossed_limits_have_no_effect(name: str, tmp_path: Path) -> None:
    assert moved(load(name, limit(1, -1), tmp_path), 2.0, 1.0, 0.1)[0] == pytest.approx(2.1)


@pytest.mark.parametrize("name", BOTH)
def test_velocity_limits_are_not_enforced(name: str, tmp_path: Path) -> None:
    model = load(name, limit(-99, 99, velocity=0.5), tmp_path)
    assert moved(model, 0.0, 500.0, 0.01)[1] == pytest.approx(500.0)


@pytest.mark.parametrize("name", ALL)
def test_gazebo_springs_act(name: str, tmp_path: Path) -> None:
    spring = '<gazebo reference="j"><springStiffness>50</springStiffness></gazebo>'
    q, _ = moved(load(name, urdf(extra=spring), tmp_path), 0.1, 0.0, 0.01)
    assert q == pytest.approx(0.1 * np.cos(np.sqrt(5000) * 0.01), rel=5e-3)


@pytest.mark.parametrize(("name", "off"), [("mujoco", (1e-6, 1e-3)), ("pybullet", (0.0, 1e-12))])
def test_mimic_is_soft_in_mujoco_and_a_gear_in_pybullet(
    name: str, off: tuple[float, float], tmp_path: Path
) -> None:
    follower = (
        f'<link name="b">{BODY}</link><joint name="k" type="continuous"><parent link="g"/>'
        '<child link="b"/><axis xyz="0 1 0"/><mimic joint="j" multiplier="2"/></joint>'
    )
    model = load(name, urdf(extra=follower), tmp_path)
    assert model.coordinates == ("j", "k")
    push = np.zeros((1, 1000, 2))
    push[:, :, 0] = 0.02
    still = np.zeros((1, 2))
    z, _ = model.rollout(still, still, 1e-3, 1000, push, 1000)
    assert z[0, 0, 0] == pytest.approx(0.02 / 0.05 / 2, rel=5e-3)
    assert off[0] <= abs(z[0, 0, 1] - 2 * z[0, 0, 0]) <= off[1]


@pytest.mark.parametrize("name", ALL)
def test_long_axis_is_normalized_except_in_pybullet(name: str, tmp_path: Path) -> None:
    _, once = moved(load(name, urdf(body=BELOW), tmp_path, 9.81), 0.5, 0.0, 0.01)
    _, twice = moved(load(name, urdf(body=BELOW, axis="0 2 0"), tmp_path, 9.81), 0.5, 0.0, 0.01)
    share, within = (0.5, 0.01) if name == "pybullet" else (1.0, 1e-12)
    assert twice / once == pytest.approx(share, rel=within)


def test_setting_normalizes_axes_in_pybullet(tmp_path: Path) -> None:
    path, turned = tmp_path / "long.urdf", []
    for axis, unit in (("0 2 0", True), ("0 1 0", False)):
        path.write_text(urdf(body=BELOW, axis=axis))
        settings = {"step": H, "gravity": [0, 0, -9.81], "unit_axes": unit}
        model = engines()["pybullet"].load(ModelSpec(path, settings=settings))
        assert not model.corrective_settings
        turned.append(moved(model, 0.5, 0.0, 0.01)[1])
    assert turned[0] == turned[1]


def test_massless_link_is_rejected_by_mujoco_and_a_kilogram_in_pybullet(tmp_path: Path) -> None:
    with pytest.raises(EngineError, match="mass and inertia"):
        load("mujoco", urdf(body=""), tmp_path)
    model = load("pybullet", urdf(body=""), tmp_path)
    assert moved(model, 0.0, 1.0, 0.01)[1] == 1.0
    z = np.zeros((1, 1))
    assert any("uses a mass of 1 kg" in remark.message for remark in model.remarks(z, z))


@pytest.mark.parametrize("name", BOTH)
@pytest.mark.parametrize("body", [
    BODY.replace('ixx="0.01"', 'ixx="0.1"'), BODY.replace('value="1"', 'value="-1"'),
], ids=["no triangle", "mass below zero"])  # fmt: skip
def test_impossible_body_is_rejected(name: str, body: str, tmp_path: Path) -> None:
    with pytest.raises(EngineError):
        load(name, urdf(body=body), tmp_path)


@pytest.mark.parametrize("name", ALL)
def test_mujoco_assumes_step_and_gravity_and_others_require_them(name: str, tmp_path: Path) -> None:
    need(name)
    path = written(tmp_path, "bare.urdf", urdf())
    if name == "mujoco":
        model = engines()[name].load(ModelSpec(path))
        assert (model.step, model.gravity) == (0.002, (0.0, 0.0, -9.81))
    else:
        with pytest.raises(EngineError, match="must set step"):
            engines()[name].load(ModelSpec(path))


@pytest.mark.parametrize("name", ALL)
def test_products_of_inertia_lose_digits_in_pybullet(name: str, tmp_path: Path) -> None:
    tensor = np.array([[0.07, 0.011, -0.007], [0.011, 0.06, 0.005], [-0.007, 0.005, 0.08]])
    axis = np.array([0.6, -0.48, 0.64])
    keys = {f"i{'xyz'[i]}{'xyz'[j]}": float(tensor[i, j]) for i in range(3) for j in range(i, 3)}
    words = " ".join(f'{key}="{value!r}"' for key, value in keys.items())
    body = f'<inertial><mass value="1"/><inertia {words}/></inertial>'
    model = load(name, urdf(body=body, axis=" ".join(map(str, axis))), tmp_path)
    still = np.zeros((1, 1))
    _, w = model.rollout(still, still, 1e-3, 1, np.ones((1, 1, 1)), 1)
    off = abs(float(w[0, 0, 0]) / 1e-3 * float(axis @ tensor @ axis) - 1)
    assert (1e-13 <= off < 1e-8) if name == "pybullet" else off < 1e-13


@pytest.mark.parametrize("name", ALL)
def test_fixed_base_touches_its_first_link_in_mujoco(name: str, tmp_path: Path) -> None:
    ball = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
    text = urdf(body=BODY + ball).replace(f'name="g">{BODY}', f'name="g">{BODY}{ball}')
    assert text.count(ball) == 2
    model = load(name, text, tmp_path)
    z = np.zeros((1, 1))
    reported = any("touch during the motions" in remark.message for remark in model.remarks(z, z))
    assert reported is (name == "mujoco")
    if not reported:
        assert moved(model, 0.0, 1.0, 0.01)[1] == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("name", [name for name in ALL if name != "idyntree"])
def test_massless_fixed_link_is_a_kilogram_in_pybullet_and_dart(name: str, tmp_path: Path) -> None:
    heavy = name in ("pybullet", "dart")
    model = load(name, urdf(extra=WELDED.format("")), tmp_path)
    inertia = 0.01 + 1 + 1 if heavy else 0.01
    assert moved(model, 0.0, 0.0, H, push=1.0)[1] / H == pytest.approx(1 / inertia, rel=1e-6)
    assert bool(model.corrective_settings) is heavy
    for remedy in model.corrective_settings.values():
        corrected = load(name, urdf(extra=WELDED.format("")), tmp_path, settings=remedy)
        assert moved(corrected, 0.0, 0.0, H, push=1.0)[1] / H == pytest.approx(1 / 0.01)
        assert corrected.corrective_settings == {}


def test_inertia_scaling_acts_in_pybullet_by_default(tmp_path: Path) -> None:
    """Catch a link with three times the inertia of its file and no reported cause."""
    path = tmp_path / "scaled.urdf"
    text = urdf().replace(
        '<link name="a">', '<link name="a">\n<contact>\n<inertia_scaling value="3"/></contact>'
    )
    path.write_text(text)
    turned = {}
    for scaled in (True, False):
        settings = {"step": H, "gravity": [0, 0, 0], "scaled_inertias": scaled}
        model = engines()["pybullet"].load(ModelSpec(path, settings=settings))
        assert ("<inertia_scaling> (3, line" in "".join(model.corrective_settings)) is scaled
        turned[scaled] = moved(model, 0.0, 0.0, H, push=1.0)[1] / H
    assert turned == pytest.approx({True: 1 / 0.03, False: 1 / 0.01})


FLOATING = (
    f'<robot name="r">{{}}<link name="a">{BODY}</link><joint name="w" type="fixed">'
    '<parent link="root"/><child link="a"/></joint></robot>'
)


def test_massless_floating_root_is_a_kilogram_in_pybullet_by_default(tmp_path: Path) -> None:
    """Catch a correction that PyBullet turns into a fixed root, without a reported cause."""
    path = written(tmp_path, "root.urdf", FLOATING.format('\n<link name="root"/>'))
    speed = {}
    for bare in (True, False):
        settings = {"step": H, "gravity": [0, 0, 0], "bare_links": bare, "floating": True}
        model = engines()["pybullet"].load(ModelSpec(path, settings=settings))
        causes = "".join(model.corrective_settings)
        assert ("a link without <inertial> (root, line 2)" in causes) is bare
        speed[bare] = moved(model, 0.0, 0.0, H, push=1.0)[1] / H
    assert speed == pytest.approx({True: 1 / 2, False: 1.0})


def test_pybullet_rejects_a_floating_root_of_zero_mass(tmp_path: Path) -> None:
    """Catch a robot that floats in its equations and is fixed in PyBullet."""
    path = tmp_path / "root.urdf"
    zero = BODY.replace('mass value="1"', 'mass value="0"').replace("0.01", "0")
    assert zero.count('"0"') >= 4
    path.write_text(FLOATING.format(f'\n<link name="root">{zero}</link>'))
    settings = {"step": H, "gravity": [0, 0, 0], "floating": True}
    with pytest.raises(EngineError, match=r"root\.urdf:2: PyBullet fixes the floating root 'root'"):
        engines()["pybullet"].load(ModelSpec(path, settings=settings))


@pytest.mark.parametrize(("part", "reason"), [
    ('<link name="w{0}"/><joint name="w{0}" type="fixed"><parent link="g"/><child link="w{0}"/>'
     "</joint>", r"at most 127 links and the root, and it has 131"),
    ('<link name="w{0}"/><joint name="f{0}" type="floating"><parent link="g"/><child link="w{0}"/>'
     "</joint>", r"welds the floating joint 'f0'"),
])  # fmt: skip
def test_limits_of_pybullet_are_named_when_it_loads(part: str, reason: str, tmp_path: Path) -> None:
    count = 130 if "fixed" in part else 1
    with pytest.raises(EngineError, match=reason):
        load("pybullet", urdf(extra="".join(map(part.format, range(count)))), tmp_path)


def test_point_mass_moves_in_pybullet_and_is_rejected_by_mujoco(tmp_path: Path) -> None:
    point = BELOW.replace("0.01", "0").replace("0 0 -1", "0 0 -2")
    model = load("pybullet", urdf(body=point), tmp_path)
    assert moved(model, 0.0, 0.0, H, push=1.0)[1] / H == pytest.approx(1 / 4)
    with pytest.raises(EngineError, match="larger than mjMINVAL"):
        load("mujoco", urdf(body=point), tmp_path)
