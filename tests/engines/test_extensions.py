"""Features that adapters add to a format: springs in a URDF, mimic joints."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from physics_crosscheck.engine import Array, LoadedModel, ModelSpec, Spring
from physics_crosscheck.harness.engines.registry import engines
from tests.engines.protocol_models import (
    GROUND,
    PAIRINGS,
    Pairing,
    joint,
    link,
    urdf_settings,
)

ON_URDF = [p for p in PAIRINGS if p.format == "urdf"]


def load(
    pairing: Pairing,
    tmp_path: Path,
    parts: Sequence[str],
    springs: tuple[Spring, ...] = (),
    **settings: object,
) -> LoadedModel:
    pytest.importorskip(pairing.engine)
    path = tmp_path / "model.urdf"
    path.write_text(f'<robot name="r">{GROUND}{"".join(parts)}</robot>')
    spec = ModelSpec(path, springs, urdf_settings(pairing) | settings)
    return engines()[pairing.engine].load(spec)


def accel(
    model: LoadedModel, q: Sequence[float], v: Sequence[float] | None = None, h: float = 1e-6
) -> Array:
    """Return accelerations from one tiny step."""
    z = np.array([q], dtype=float)
    w = np.zeros_like(z) if v is None else np.array([v], dtype=float)
    result: Array = (model.rollout(z, w, h, 1, None, 1)[1][0, 0] - w[0]) / h
    return result


TWO = [link("a", 2.0), joint("q1", "prismatic", "a"), link("b", 0.5), joint("q2", "prismatic", "b")]


@pytest.mark.parametrize("pairing", ON_URDF, ids=str)
def test_gazebo_springs_act_towards_their_rest_position(pairing: Pairing, tmp_path: Path) -> None:
    spring = (
        '<gazebo reference="q2"><springStiffness>30</springStiffness>'
        "<springReference>0.2</springReference></gazebo>"
    )
    model = load(pairing, tmp_path, [*TWO, spring])
    assert accel(model, [0.7, 0.5]) == pytest.approx([0.0, -30 * 0.3 / 0.5], rel=1e-5, abs=1e-6)
    assert accel(model, [0.7, 0.2]) == pytest.approx([0.0, 0.0], abs=1e-3)


@pytest.mark.parametrize("pairing", ON_URDF, ids=str)
def test_sidecars_spring_and_damper_act_on_a_combination_of_joints(
    pairing: Pairing, tmp_path: Path
) -> None:
    spring = Spring({"q1": -2.0, "q2": 1.0}, 30.0, 4.0, 0.1)
    model = load(pairing, tmp_path, TWO, (spring,))
    q, v = [0.1, 0.5], [0.3, -0.2]
    force = 30 * (-2 * 0.1 + 0.5 - 0.1) + 4 * (-2 * 0.3 - 0.2)
    expected = [2 * force / 2.0, -force / 0.5]
    assert accel(model, q, v) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("pairing", ON_URDF, ids=str)
def test_two_springs_on_one_joint_add_up(pairing: Pairing, tmp_path: Path) -> None:
    springs = (Spring({"q1": 1.0}, 10.0, 0.0, 0.0), Spring({"q1": 1.0}, 20.0, 0.0, 0.1))
    model = load(pairing, tmp_path, TWO, springs)
    assert accel(model, [0.4, 0.0])[0] == pytest.approx(-(10 * 0.4 + 20 * 0.3) / 2.0, rel=1e-5)


@pytest.mark.parametrize("pairing", [p for p in ON_URDF if p.integrator != "RK4"], ids=str)
def test_mimic_joint_follows_its_leader_and_brings_its_inertia(
    pairing: Pairing, tmp_path: Path
) -> None:
    mimic = '<mimic joint="q1" multiplier="3"/>'
    parts = [
        link("a", 2.0),
        joint("q1", "prismatic", "a"),
        link("b", 0.5),
        joint("q2", "prismatic", "b", extra=mimic),
        '<gazebo reference="q1"><springStiffness>30</springStiffness></gazebo>',
    ]
    hard: Any = {"solref": [1e-6, 0.5], "solimp": [0.9999, 0.9999, 0.001, 0.5, 2]}
    model = load(pairing, tmp_path, parts, **(hard if pairing.engine == "mujoco" else {}))
    h, n = 1e-4, 4000
    zs, ws = model.rollout(np.array([[0.2, 0.6]]), np.zeros((1, 2)), h, n, None, 100)
    assert zs[0, :, 1] == pytest.approx(3 * zs[0, :, 0], abs=2e-5)
    assert ws[0, :, 1] == pytest.approx(3 * ws[0, :, 0], abs=2e-4)
    # Both move like one mass of 2 + 3^2 * 0.5 on the spring.
    rate = np.sqrt(30 / (2.0 + 9 * 0.5))
    t = h * 100 * np.arange(1, 41)
    assert zs[0, :, 0] == pytest.approx(0.2 * np.cos(rate * t), abs=2e-4)
