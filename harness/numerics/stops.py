"""Positions at which a stop holds an engine's joint: the engine is not smooth about them."""

from __future__ import annotations

import numpy as np

from physics_crosscheck.harness.engines.protocol import Model
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.reference.mechanism.numeric import Array


def stopped(
    model: Model, coordinates: CoordinateMap, position: Array, step: Array
) -> tuple[str, ...]:
    """Coordinates of the engine that a stop holds at a position (n,), or a step (n,) beside it."""
    places = np.concatenate([position[None], position + np.diag(step), position - np.diag(step)])
    z = coordinates.forward(places)
    lower, upper = model.limits.T
    out = ((z <= lower) | (z >= upper)).any(axis=0)
    return tuple(name for name, held in zip(model.coordinates, out, strict=True) if held)
