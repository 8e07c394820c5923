"""What a sidecar may set of a URDF in PyBullet."""

from __future__ import annotations

from collections.abc import Mapping

from harness.engines.protocol import EngineError, ModelSpec
from harness.engines.pybullet.inertias import exact_axes
from harness.engines.urdf_copy import Change, without_limits, without_mimics, without_shapes

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
    # Whether contacts and joint limits are left out.
    "smooth": False,
    # Whether joints follow those that they mimic.
    "couplings": True,
}
"""Of every setting."""

REWRITTEN: tuple[tuple[str, bool, Change], ...] = (
    ("exact_axes", True, exact_axes),
    ("smooth", True, without_shapes),
    ("smooth", True, without_limits),
    ("couplings", False, without_mimics),
)
"""What settings change in the file that PyBullet loads, and at which value."""


def check_settings(spec: ModelSpec, unstated: str) -> None:
    """Refuse settings that are unknown, of another type, or missing.

    Args:
        unstated: what PyBullet takes for the missing ones.

    Raises:
        EngineError: naming the sidecar and the setting.
    """
    unknown = set(spec.settings) - {*REQUIRED, *DEFAULTS}
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
