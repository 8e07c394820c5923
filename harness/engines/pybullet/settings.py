"""Settings of a URDF's sidecar for PyBullet."""

from __future__ import annotations

from collections.abc import Mapping

from physics_crosscheck.harness.engines.bare import zero_missing_inertials
from physics_crosscheck.harness.engines.protocol import ModelSpec, held_joints
from physics_crosscheck.harness.engines.pybullet.axes import unit_axes
from physics_crosscheck.harness.engines.pybullet.inertias import exact_axes
from physics_crosscheck.harness.engines.urdf_copy import (
    Change,
    followers_of,
    mimics_of,
    with_held,
    without_limits,
    without_shapes,
    without_visuals,
)

DISABLED_EFFECTS: Mapping[str, float | bool] = {
    # Linear and angular damping of every link; PyBullet's default is 0.04.
    "link_damping": 0.0,
    # Whether every joint keeps its velocity motor, which brakes it; PyBullet's default is true.
    "motors": False,
    # Whether inertias are the file's, not those of collision shapes; PyBullet's default is false.
    "inertia_from_file": True,
}
"""PyBullet's own effects, disabled."""

DEFAULTS: Mapping[str, float | bool] = {
    **DISABLED_EFFECTS,
    # Whether the adapter, not PyBullet, rotates tensors with products to principal axes, to the
    # last digits.
    "exact_axes": False,
    # Whether joint axes are normalized, which PyBullet omits.
    "unit_axes": False,
    # Whether a link without an inertial has 1 kg and 1 kg m^2 (PyBullet's default), or no mass.
    "bare_links": True,
    # Whether contacts and joint limits are left out.
    "smooth": False,
    # Whether the root link moves freely.
    "floating": False,
}
"""Defaults of all settings."""

REWRITTEN: tuple[tuple[str, bool, Change], ...] = (
    ("exact_axes", True, exact_axes),
    ("unit_axes", True, unit_axes),
    ("bare_links", False, zero_missing_inertials),
    ("smooth", True, without_shapes),
    ("smooth", True, without_limits),
)
"""Settings that change the file which PyBullet loads: name, value and change."""


def changes_of(spec: ModelSpec) -> list[Change]:
    """Return the changes that settings make to the file."""
    on = {key: spec.settings.get(key, default) for key, default in DEFAULTS.items()}
    changes = [change for key, value, change in REWRITTEN if on[key] == value]
    if not on[
        "inertia_from_file"
    ]:  # collision shapes then define the moments, so keep them and disable contacts instead
        changes = [without_visuals if change is without_shapes else change for change in changes]
    followers = followers_of(spec.settings, f"{spec.path}.toml")
    if followers is not None:
        changes.append(mimics_of(followers))
    return [*changes, with_held(held)] if (held := held_joints(spec)) else changes
