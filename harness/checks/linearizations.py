"""Linearizations of an engine's model, compared with those of the equations."""

import numpy as np
from msgspec.structs import replace

from physics_crosscheck.harness.numerics.differences import MAX_PERTURBATION
from physics_crosscheck.harness.numerics.discrete import linearize_step
from physics_crosscheck.harness.numerics.linearization import linearize_engine
from physics_crosscheck.harness.numerics.stops import stopped
from physics_crosscheck.harness.records.model import EngineLinearization
from .prepare import PreparedSystem, PreparedTree
from .task import ModelTask

Linearized = ModelTask[PreparedSystem | PreparedTree]


def run_linearizations(task: Linearized) -> tuple[EngineLinearization, ...]:
    """Linearize the engine's model about each equilibrium, and compare with Taylor's series.

    There is no linearization where a joint limit acts near the equilibrium, such as a spring that
    presses a joint against its limit.
    """
    model, coordinates = task.load()
    moved = 2 * MAX_PERTURBATION * np.minimum(task.target.amplitude[: coordinates.back.size], 1.0)
    records = []
    for point in task.target.equilibria:
        if stopped(model, coordinates, point.position, moved):
            continue
        # Once for a step of the file's own length, and once as h -> 0.
        step = linearize_step(model, coordinates, task.target.stepped, point, task.resolution)
        limit, _ = linearize_engine(model, coordinates, point, task.resolution, task.thorough)
        records.append(replace(limit, one_step=step))
    return tuple(records)
