"""Detection of active joint limits, at which an engine is not smooth."""

import numpy as np

from physics_crosscheck.harness.engines.protocol import LoadedModel
from physics_crosscheck.reference.mechanism.numeric import Array
from .coordinates import CoordinateMap


def stopped(
    model: LoadedModel, coordinates: CoordinateMap, position: Array, step: Array
) -> tuple[str, ...]:
    """Return the engine coordinates at a joint limit, at a position (n,) or one step (n,) away."""
    places = np.concatenate([position[None], position + np.diag(step), position - np.diag(step)])
    z = coordinates.forward(places)
    lower, upper = model.limits.T
    out = ((z <= lower) | (z >= upper)).any(axis=0)
    return tuple(name for name, held in zip(model.coordinates, out, strict=True) if held)
