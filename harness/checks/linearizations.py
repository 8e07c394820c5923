"""Linearizations of an engine's model, compared with those of the equations."""

from __future__ import annotations

import numpy as np

from physics_crosscheck.harness.checks.case_record import linearization_record
from physics_crosscheck.harness.checks.prepare import Equilibrium, PreparedSystem, PreparedTree
from physics_crosscheck.harness.checks.task import ModelTask
from physics_crosscheck.harness.engines.protocol import Model
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.discrete import MAX_PERTURBATION, linearize_step
from physics_crosscheck.harness.numerics.linearization import linearize_engine
from physics_crosscheck.harness.numerics.stops import stopped
from physics_crosscheck.harness.records.model import EngineLinearization

Linearized = ModelTask[PreparedSystem | PreparedTree]


def run_linearizations(task: Linearized) -> tuple[EngineLinearization, ...]:
    """Linearize the engine's model about each equilibrium, and compare with Taylor's series.

    There is no linearization where a joint limit acts near the equilibrium, such as a spring that
    presses a joint against its limit.
    """
    model, coordinates = task.load()
    moved = 2 * MAX_PERTURBATION * np.minimum(task.target.amplitude[: coordinates.back.size], 1.0)
    return tuple(
        _linearization(task, model, coordinates, e)
        for e in task.target.equilibria
        if not stopped(model, coordinates, e.position, moved)
    )


def _linearization(
    task: Linearized, model: Model, coordinates: CoordinateMap, about: Equilibrium
) -> EngineLinearization:
    """Linearize in the limit of a zero step, and for one step at the file's own time step."""
    one_step = linearize_step(
        model,
        coordinates,
        task.target.stepped,
        position=about.position,
        taylor=about.matrices,
        amplitude=task.target.amplitude,
        push=task.target.push,
        hold=about.hold,
        resolution=task.resolution,
    )
    linearization = linearize_engine(
        model,
        coordinates,
        equilibrium=about.name,
        position=about.position,
        taylor=about.matrices,
        amplitude=task.target.amplitude,
        push=task.target.push,
        hold=about.hold,
        resolution=task.resolution,
    )
    return linearization_record(linearization, one_step)
