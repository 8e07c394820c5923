"""Small MJCFs in engines that read a part of them, and in one that reads them whole."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.engines.protocol import Array, LoadedModel, ModelSpec
from physics_crosscheck.harness.engines.registry import engines
from tests.engines.extras import need

INERTIAL = '<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.02 0.025"/>'
AWAY = '<inertial pos="0.1 -0.2 0.3" mass="2" diaginertia="0.1 0.2 0.25"/>'

READERS = ("pinocchio", "drake")
"""Extras whose parsers take a part of an MJCF."""

EXACT: Mapping[str, object] = {"integrator": "RK4"}


def hinge(name: str = "j", more: str = "", axis: str = "0 1 0") -> str:
    """A hinge about y."""
    return f'<joint name="{name}" type="hinge" axis="{axis}" {more}/>'


def write(folder: Path, bodies: str, beside: str = "", name: str = "sample.xml") -> Path:
    """A file of these bodies, in radians."""
    path = folder / name
    compiler = '<compiler angle="radian"/>'
    path.write_text(f"<mujoco>{compiler}{beside}\n<worldbody>{bodies}</worldbody></mujoco>")
    return path


def mjcf(name: str, path: Path, settings: Mapping[str, object] | None = None) -> LoadedModel:
    """A file in an engine."""
    need(name)
    return engines()[name].load(ModelSpec(path, settings=settings or {}))


def off(model: LoadedModel, other: LoadedModel, seed: int = 1, spread: float = 0.7) -> float:
    """By how much accelerations of one model are off another's, of the largest, at random."""
    assert set(model.coordinates) == set(other.coordinates)
    order = [other.coordinates.index(name) for name in model.coordinates]
    rng = np.random.default_rng(seed)
    z, w, f = spread * rng.normal(size=(3, 8, len(order)))
    found = model.accelerations(z[:, order], w[:, order], f[:, order])
    known = other.accelerations(z, w, f)
    assert found is not None
    assert known is not None
    return float(np.max(np.abs(found - known[:, order])) / np.max(np.abs(known)))


def ends(model: LoadedModel, z: Array, w: Array, seconds: float = 0.05) -> tuple[Array, Array]:
    """Where a free motion from one state ends, by 200 steps."""
    q, v = model.rollout(z[None], w[None], seconds / 200, 200, None, 200)
    return q[0, 0], v[0, 0]
