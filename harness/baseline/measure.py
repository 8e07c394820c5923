"""Measurement of a case's model for the baseline: limits on a snapshot, and fitted constants.

The model and the equations also run on the accepted snapshot, if there is one. So a change can be
attributed to the model or to the equations.
"""

from __future__ import annotations

import msgspec
import numpy as np
import sympy as sp

from physics_crosscheck.harness.baseline.diff import equations_movement
from physics_crosscheck.harness.baseline.snapshot import (
    ends,
    same_motion,
    segments_of,
    snapshot_of,
)
from physics_crosscheck.harness.checks.prepare import Prepared, PreparedSystem, PreparedTree
from physics_crosscheck.harness.checks.task import ModelTask
from physics_crosscheck.harness.diagnosis.diagnose import NAMED
from physics_crosscheck.harness.modelfiles.code_reads import record_reads
from physics_crosscheck.harness.modelfiles.path_states import merged
from physics_crosscheck.harness.records.base import rows
from physics_crosscheck.harness.records.baseline import (
    Identified,
    Measurement,
    OnAccepted,
    Snapshot,
)
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.integrate import ReferenceError
from physics_crosscheck.reference.solving.samples import ends_of
from physics_crosscheck.reference.solving.segments import Segments
from physics_crosscheck.reference.solving.variants import Variants

TIED = 1e-6
"""Smallest effect of an identifiable constant, as a share of its unit change. Other constants
compensate a smaller one: no segment moves by more than rounding.
"""

ITERATIONS = 6
NUDGE = 1e-4


def measure(task: ModelTask[Prepared]) -> Measurement:
    """Measure one case: on the accepted snapshot if comparable, and on its own.

    Raises:
        EngineError, SidecarError, BlownUpError, ReferenceError: naming the model that cannot run.
    """
    if task.sidecar is None:
        return _measured(task, task.snapshot)  # a file alone is hashed with all files that it names
    with record_reads(task.target.place) as reads:
        measurement = _measured(task, task.snapshot)
    return msgspec.structs.replace(measurement, reads=merged(task.target.reads, reads.states()))


def _measured(task: ModelTask[Prepared], accepted: Snapshot | None) -> Measurement:
    model, coordinates = task.load()
    present, on_accepted = _snapshot(task), None
    if accepted is not None and comparable(present, accepted):
        segments = segments_of(accepted)
        end, uncertainty = ends(model, coordinates, segments)
        on_accepted = OnAccepted(
            end=rows(end.tolist()),
            uncertainty=rows(uncertainty.tolist()),
            equations=rows(_by_equations(task.target, segments).tolist()),
        )
        if is_accepted(present, accepted, on_accepted):
            present = accepted
    if present is not accepted:
        segments = segments_of(present)
        end, uncertainty = ends(model, coordinates, segments)
    target, constants = task.target, dict[str, Identified]()
    # Of bodies the diagnosis finds the changed number.
    if isinstance(target, PreparedSystem):
        constants = identify(target.variants, segments, end, uncertainty)
    return Measurement(
        snapshot=present,
        end=rows(end.tolist()),
        uncertainty=rows(uncertainty.tolist()),
        constants=constants,
        on_accepted=on_accepted,
    )


def _snapshot(task: ModelTask[Prepared]) -> Snapshot:
    target = task.target
    inputs = tuple(f"a force on {name}, held" for name in target.names)
    if isinstance(target, PreparedSystem):
        given = target.system.scenario(task.scenario).inputs
        inputs = tuple(f"{i.name} = {sp.sstr(sp.sympify(given[i]))}" for i in target.system.inputs)
    segments = target.segments(task.scenario)
    return snapshot_of(segments, task.scenario, target.components, inputs)


def _by_equations(target: Prepared, segments: Segments) -> Array:
    """Return the ends of segments by the present equations, (K, 2n)."""
    if isinstance(target, PreparedSystem):
        ends: Array = target.variants.flows(target.variants.nominal[None], segments)[0]
        return ends
    assert isinstance(target, PreparedTree)
    equations = TreeEquations(target.system)
    return ends_of(equations, segments.start, segments.start_inputs, segments.length)


def is_accepted(present: Snapshot, accepted: Snapshot, now: OnAccepted) -> bool:
    """Return whether the accepted snapshot still fits: the same motion, and the same equations.

    Otherwise a change of the equations too small to change the motion would be reported in every
    later run, since the old ends would remain the reference.
    """
    return same_motion(present, accepted) and not equations_movement(accepted, now)


def comparable(present: Snapshot, accepted: Snapshot) -> bool:
    """Return whether two snapshots have equal numbers of components and inputs, and similar
    times.
    """
    inputs = {len(row) for one in (present, accepted) for nodes in one.input_nodes for row in nodes}
    timed = {time is None for one in (present, accepted) for time in one.t}
    return len(present.components) == len(accepted.components) and len(inputs) == len(timed) == 1


def identify(
    variants: Variants, segments: Segments, end: Array, uncertainty: Array
) -> dict[str, Identified]:
    """Return the constants of the equations that explain the ends of the segments, by name.

    Gauss-Newton over all constants at once. Constants that this motion cannot distinguish are
    omitted. All are omitted if constants do not explain the motion, which then has another cause.
    """
    chosen = [i for i, p in enumerate(variants.parameters) if p.kind == "constant"]
    is_known = np.isfinite(uncertainty) & np.isfinite(end)
    if not chosen or not is_known.any():
        return {}
    sizes = variants.sizes[chosen]
    target = (end / segments.unit)[is_known]
    weight = np.maximum((uncertainty / segments.unit)[is_known], 1e-16)
    shift = np.zeros(len(chosen))

    def ends_at(shifts: Array) -> Array:
        points = np.tile(variants.nominal, (len(shifts), 1))
        points[:, chosen] += shifts * sizes
        return (variants.flows(points, segments) / segments.unit)[:, is_known]

    try:
        slopes = (ends_at(NUDGE * np.eye(len(chosen))) - ends_at(-NUDGE * np.eye(len(chosen)))) / (
            2 * NUDGE
        )
        _, values, directions = np.linalg.svd(slopes.T, full_matrices=False)
        held = values > TIED * max(float(values[0]), 1e-300)
        free = directions[~held]
        inverse = np.linalg.pinv(slopes.T, rcond=TIED)
        residual = first = target - ends_at(shift[None])[0]
        for _ in range(ITERATIONS):
            step = inverse @ residual
            after = target - ends_at((shift + step)[None])[0]
            if not np.isfinite(after).all() or np.linalg.norm(after) >= np.linalg.norm(residual):
                break
            shift, residual = shift + step, after
    except (ReferenceError, np.linalg.LinAlgError):
        return {}
    explained = np.linalg.norm(residual) <= NAMED * np.linalg.norm(first)
    if not explained and bool(np.any(np.abs(residual) > weight)):
        return {}
    errors = np.sqrt((inverse**2) @ weight**2)
    return {
        variants.parameters[index].name: Identified(
            value=float(variants.nominal[index] + shift[i] * sizes[i]),
            standard_error=float(errors[i] * sizes[i]),
        )
        for i, index in enumerate(chosen)
        if float(np.linalg.norm(free[:, i])) < TIED
    }
