"""What a sidecar may set of a URDF in PyBullet."""

from __future__ import annotations

from collections.abc import Mapping

from harness.engines.protocol import EngineError, ModelSpec, held_joints
from harness.engines.pybullet.bare import weightless
from harness.engines.pybullet.inertias import exact_axes
from harness.engines.urdf_copy import (
    Change,
    followers_of,
    mimics_of,
    with_held,
    without_limits,
    without_shapes,
)

REQUIRED = ("step", "gravity")
"""What no URDF says, and a sidecar must."""

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
    ("bare_links", False, weightless),
    ("smooth", True, without_shapes),
    ("smooth", True, without_limits),
)
"""What settings change in the file that PyBullet loads, and at which value."""


HELD = "held"
"""Names of joints that stand still."""


def changes_of(spec: ModelSpec) -> list[Change]:
    """What settings change in the file."""
    on = {key: spec.settings.get(key, default) for key, default in DEFAULTS.items()}
    found = [change for key, value, change in REWRITTEN if on[key] == value]
    followers = followers_of(spec.settings, f"{spec.path}.toml")
    if followers is not None:
        found.append(mimics_of(followers))
    return [*found, with_held(held)] if (held := held_joints(spec)) else found


def check_settings(spec: ModelSpec, unstated: str) -> None:
    """Refuse settings that are unknown, of another type, or missing.

    Args:
        unstated: what PyBullet takes for the missing ones.

    Raises:
        EngineError: naming the sidecar and the setting.
    """
    held_joints(spec)
    followers_of(spec.settings, f"{spec.path}.toml")
    unknown = set(spec.settings) - {*REQUIRED, *DEFAULTS, "couplings", HELD}
    if unknown:
        raise EngineError(f"{spec.path}.toml: PyBullet has no setting {', '.join(unknown)}")
    for key, default in DEFAULTS.items():
        value = spec.settings.get(key, default)
        wanted = (bool,) if isinstance(default, bool) else (int, float)
        if not isinstance(value, wanted) or isinstance(value, bool) != isinstance(default, bool):
            kind = "true or false belongs" if isinstance(default, bool) else "a number belongs"
            raise EngineError(f"{spec.path}.toml: [settings] {key} is {value!r}, where {kind}")
    for key in REQUIRED:
        if key not in spec.settings:
            raise EngineError(
                f"{spec.path}.toml: [settings] must state {key}: a URDF has none, and"
                f" PyBullet's own are {unstated}"
            )
