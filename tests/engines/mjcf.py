"""Small MJCFs in engines that read parts of the format, and in MuJoCo."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from physics_crosscheck.engine import Array, LoadedModel, ModelSpec
from physics_crosscheck.harness.engines.registry import engines
from tests.engines.extras import need

INERTIAL = '<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.02 0.025"/>'
AWAY = '<inertial pos="0.1 -0.2 0.3" mass="2" diaginertia="0.1 0.2 0.25"/>'

PARTIAL_READERS = ("pinocchio", "drake")
"""Optional engines whose parsers read a part of an MJCF."""

EXACT: Mapping[str, object] = {"integrator": "RK4"}


def hinge(name: str = "j", more: str = "", axis: str = "0 1 0") -> str:
    return f'<joint name="{name}" type="hinge" axis="{axis}" {more}/>'


def write(folder: Path, bodies: str, extra: str = "", name: str = "sample.xml") -> Path:
    """Write a file of these bodies, in radians."""
    path = folder / name
    compiler = '<compiler angle="radian"/>'
    path.write_text(f"<mujoco>{compiler}{extra}\n<worldbody>{bodies}</worldbody></mujoco>")
    return path


def mjcf(name: str, path: Path, settings: Mapping[str, object] | None = None) -> LoadedModel:
    """Load a file in an engine."""
    need(name)
    return engines()[name].load(ModelSpec(path, settings=settings or {}))


def off(model: LoadedModel, other: LoadedModel, seed: int = 1, spread: float = 0.7) -> float:
    """Return the relative difference of two models' accelerations in random states."""
    assert set(model.coordinates) == set(other.coordinates)
    order = [other.coordinates.index(name) for name in model.coordinates]
    rng = np.random.default_rng(seed)
    z, w, f = spread * rng.normal(size=(3, 8, len(order)))
    actual = model.accelerations(z[:, order], w[:, order], f[:, order])
    expected = other.accelerations(z, w, f)
    assert actual is not None
    assert expected is not None
    return float(np.max(np.abs(actual - expected[:, order])) / np.max(np.abs(expected)))


def ends(model: LoadedModel, z: Array, w: Array, seconds: float = 0.05) -> tuple[Array, Array]:
    """Return where a free motion from one state ends after 200 steps."""
    q, v = model.rollout(z[None], w[None], seconds / 200, 200, None, 200)
    return q[0, 0], v[0, 0]
