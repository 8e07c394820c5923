"""What a sidecar may set of a URDF in PyBullet."""

from __future__ import annotations

from collections.abc import Mapping

from physics_crosscheck.harness.engines.bare import weightless
from physics_crosscheck.harness.engines.protocol import ModelSpec, held_joints
from physics_crosscheck.harness.engines.pybullet.axes import unit_axes
from physics_crosscheck.harness.engines.pybullet.inertias import exact_axes
from physics_crosscheck.harness.engines.urdf_copy import (
    Change,
    followers_of,
    mimics_of,
    with_held,
    without_limits,
    without_looks,
    without_shapes,
)

UNDONE: Mapping[str, float | bool] = {
    # Linear and angular damping of every link; PyBullet's own is 0.04.
    "link_damping": 0.0,
    # Whether every joint keeps its velocity motor, which holds it; PyBullet's own is true.
    "motors": False,
    # Whether inertias are those of the file, not of its collision shapes; PyBullet's own is false.
    "inertia_from_file": True,
}
"""What PyBullet does on its own, switched off."""

DEFAULTS: Mapping[str, float | bool] = {
    **UNDONE,
    # Whether tensors with products are turned to principal axes by the adapter, to the last digits,
    # and not by PyBullet.
    "exact_axes": False,
    # Whether joints' axes are made unit vectors, which PyBullet does not.
    "unit_axes": False,
    # Whether a link without an inertial has 1 kg and 1 kg m^2, as PyBullet has it, or nothing.
    "bare_links": True,
    # Whether contacts and joint limits are left out.
    "smooth": False,
    # Whether the root link moves freely.
    "floating": False,
}
"""Of every setting."""

REWRITTEN: tuple[tuple[str, bool, Change], ...] = (
    ("exact_axes", True, exact_axes),
    ("unit_axes", True, unit_axes),
    ("bare_links", False, weightless),
    ("smooth", True, without_shapes),
    ("smooth", True, without_limits),
)
"""What settings change in the file that PyBullet loads, and at which value."""


def changes_of(spec: ModelSpec) -> list[Change]:
    """What settings change in the file."""
    on = {key: spec.settings.get(key, default) for key, default in DEFAULTS.items()}
    found = [change for key, value, change in REWRITTEN if on[key] == value]
    if not on["inertia_from_file"]:  # shapes that touch have moments, and are let through instead
        found = [without_looks if change is without_shapes else change for change in found]
    followers = followers_of(spec.settings, f"{spec.path}.toml")
    if followers is not None:
        found.append(mimics_of(followers))
    return [*found, with_held(held)] if (held := held_joints(spec)) else found
