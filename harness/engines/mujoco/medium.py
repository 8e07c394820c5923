"""The medium of a compiled model: what of it is a drag of boxes, and what is not."""

from __future__ import annotations

from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.compiled import CompiledMedium
from physics_crosscheck.harness.engines.mujoco.pulls import acts

FAINT = 1e-300
"""Share of an ellipsoid's forces that is left: with none, its body's box would be dragged."""


def medium(m: Any) -> CompiledMedium | None:
    """Of the inertia model; None where nothing flows, or flags switch all passive forces off."""
    if not (m.opt.density > 0 or m.opt.viscosity > 0) or not (
        acts(m, "SPRING") or acts(m, "DAMPER")
    ):
        return None
    x, y, z = map(float, m.opt.wind)
    return CompiledMedium(
        density=float(m.opt.density), viscosity=float(m.opt.viscosity), wind=(x, y, z)
    )


def ellipsoids(m: Any) -> Any:
    """Which geoms the medium acts on as on ellipsoids, (ngeom,): their bodies are no boxes then."""
    return np.array(m.geom_fluid)[:, 0] > 0


def without_ellipsoids(m: Any) -> None:
    """Let nothing act on these geoms and their bodies."""
    m.geom_fluid[ellipsoids(m), 0] = FAINT


def boxed(m: Any, body: int) -> bool:
    """Whether the medium acts on a body as on a box."""
    first, count = int(m.body_geomadr[body]), int(m.body_geomnum[body])
    return not (count and ellipsoids(m)[first : first + count].any())
