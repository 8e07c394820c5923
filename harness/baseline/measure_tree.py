"""Measurement of a model of declared bodies for the baseline, at some of the checked states.

No constant is fitted here. The diagnosis of a model that differs finds the changed number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from physics_crosscheck.harness.baseline.measure import comparable, is_accepted
from physics_crosscheck.harness.baseline.snapshot import PICKED, ends, segments_of
from physics_crosscheck.harness.checks.robot_task import RobotTask, load_robot, order_of
from physics_crosscheck.harness.checks.verdict import filled
from physics_crosscheck.harness.modelfiles.code_reads import record_reads
from physics_crosscheck.harness.modelfiles.path_states import merged
from physics_crosscheck.harness.records.base import rows
from physics_crosscheck.harness.records.baseline import Measurement, OnAccepted, Snapshot
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.multibody import TreeSystem
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.samples import ends_of


@dataclass(frozen=True, kw_only=True)
class MeasureTreeTask:
    """The inputs that a worker needs.

    Attributes:
        task: the case.
        system: the declared tree.
        accepted: the snapshot of the baseline, where there is one.
        reads: states of the files that `system.py` read.
    """

    task: RobotTask
    system: TreeSystem
    accepted: Snapshot | None
    reads: Mapping[str, str]


def measure_tree(task: MeasureTreeTask) -> Measurement:
    """Measure one case: on the accepted snapshot if comparable, and on its own.

    Raises:
        EngineError, BlownUpError, ReferenceError: naming the model that cannot run.
    """
    folder = Path(task.task.folder)
    if folder == task.task.file:
        return _measured(task)  # a standalone file is hashed with all files that it names
    with record_reads(folder) as reads:
        measurement = _measured(task)
    return msgspec.structs.replace(measurement, reads=merged(task.reads, reads.states()))


def _measured(task: MeasureTreeTask) -> Measurement:
    check = task.task
    model = load_robot(check)
    coordinates = check.followers.map(order_of(check, model), check.names)
    present = _snapshot(check)
    accepted, on_accepted = task.accepted, None
    if accepted is not None and comparable(present, accepted):
        end, uncertainty = ends(model, coordinates, segments_of(accepted))
        on_accepted = OnAccepted(
            end=rows(end.tolist()),
            uncertainty=rows(uncertainty.tolist()),
            equations=rows(_equations(task.system, accepted).tolist()),
        )
        if is_accepted(present, accepted, on_accepted):
            present = accepted
    if present is not accepted:
        end, uncertainty = ends(model, coordinates, segments_of(present))
    return Measurement(
        snapshot=present,
        end=rows(end.tolist()),
        uncertainty=rows(uncertainty.tolist()),
        constants={},
        on_accepted=on_accepted,
    )


def _snapshot(task: RobotTask) -> Snapshot:
    """Build a snapshot of the first states, each with its own forces."""
    drawn = task.samples
    count = min(PICKED, len(drawn.start))
    return Snapshot(
        scenario=task.scenario,
        components=(*task.names, *(f"{name}_dot" for name in task.names)),
        duration=drawn.length,
        inputs=tuple(f"a force on {name}, held" for name in task.names),
        fastest=drawn.fastest,
        varying=False,
        t=(None,) * count,
        length=(drawn.length,) * count,
        start=_table(drawn.start[:count]),
        input_nodes=tuple((row,) for row in _table(drawn.forces[:count])),
        end=_table(drawn.end[:count]),
        scale=tuple(filled(np.max(np.abs(drawn.end - drawn.start), axis=0)).tolist()),
    )


def _table(values: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in values.tolist())


def _equations(system: TreeSystem, accepted: Snapshot) -> Array:
    """Return the ends of the accepted segments by the present equations, (K, 2n)."""
    segments = segments_of(accepted)
    forces = np.concatenate(segments.inputs)
    return ends_of(TreeEquations(system), segments.start, forces, float(segments.length[0]))
