"""The fluid of a compiled model: drag on boxes, and drag that is not covered."""

from __future__ import annotations

from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.compiled import CompiledFluid
from physics_crosscheck.harness.engines.mujoco.pulls import acts

FAINT = 1e-300
"""A remaining share of an ellipsoid's forces: at zero, MuJoCo would drag its body's box."""


def box_fluid(m: Any) -> CompiledFluid | None:
    """Return the fluid of the inertia model, or None if no fluid or passive force acts."""
    if not (m.opt.density > 0 or m.opt.viscosity > 0) or not (
        acts(m, "SPRING") or acts(m, "DAMPER")
    ):
        return None
    x, y, z = map(float, m.opt.wind)
    return CompiledFluid(
        density=float(m.opt.density), viscosity=float(m.opt.viscosity), wind=(x, y, z)
    )


def ellipsoids(m: Any) -> Any:
    """Return which geoms, (ngeom,), the fluid model treats as ellipsoids: their bodies have no box
    drag.
    """
    return np.array(m.geom_fluid)[:, 0] > 0


def without_ellipsoids(m: Any) -> None:
    """Remove the fluid forces on these geoms and their bodies."""
    m.geom_fluid[ellipsoids(m), 0] = FAINT


def has_box_drag(m: Any, body: int) -> bool:
    """Return whether the fluid acts on a body as on a box."""
    first, count = int(m.body_geomadr[body]), int(m.body_geomnum[body])
    return not (count and ellipsoids(m)[first : first + count].any())
