"""Measurement of a case's model for the baseline: limits on a snapshot, and fitted constants.

The model and the equations also run on the accepted snapshot, if there is one. So a change can be
attributed to the model or to the equations.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import msgspec
import numpy as np

from physics_crosscheck.harness.baseline.movement import of_equations
from physics_crosscheck.harness.baseline.snapshot import (
    PickedSegments,
    ends,
    inputs_of,
    same_motion,
    segments_of,
    snapshot_of,
)
from physics_crosscheck.harness.checks.case import CaseTask, load
from physics_crosscheck.harness.checks.prepare import Prepared
from physics_crosscheck.harness.diagnosis.diagnose import NAMED
from physics_crosscheck.harness.modelfiles.code_reads import record_reads
from physics_crosscheck.harness.modelfiles.path_states import merged
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.records.base import rows
from physics_crosscheck.harness.records.baseline import (
    Identified,
    Measurement,
    OnAccepted,
    Snapshot,
)
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.system import System
from physics_crosscheck.reference.solving.integrate import ReferenceError
from physics_crosscheck.reference.solving.motion import Motion
from physics_crosscheck.reference.solving.variants import Variants

TIED = 1e-6
"""Smallest effect of an identifiable constant, as a share of its unit change. Other constants
compensate a smaller one: no segment moves by more than rounding.
"""

ITERATIONS = 6
NUDGE = 1e-4


@dataclass(frozen=True, kw_only=True)
class MeasureTask:
    """The inputs that a worker needs.

    `accepted` is the snapshot of the baseline, if any; `reads` holds the states of the files that
    `system.py` read.
    """

    system: System
    sidecar: Sidecar
    engine: str
    scenario: str
    motion: Motion
    scale: Array
    components: tuple[str, ...]
    variants: Variants
    accepted: Snapshot | None
    reads: Mapping[str, str]


def measure_task(case: CaseTask, prepared: Prepared, accepted: Snapshot | None) -> MeasureTask:
    """Build the task for measuring a case, from the task for its verdict."""
    return MeasureTask(
        system=case.system,
        sidecar=case.sidecar,
        engine=case.engine,
        scenario=case.scenario,
        motion=case.motion,
        scale=case.scale,
        components=case.components,
        variants=prepared.variants,
        accepted=accepted,
        reads=prepared.reads,
    )


def measure(task: MeasureTask) -> Measurement:
    """Measure one case: on the accepted snapshot if comparable, and on its own.

    Raises:
        EngineError, SidecarError, BlownUpError: naming the model that cannot run.
    """
    folder = task.sidecar.model.parent
    with record_reads(folder) as reads:
        measurement = _measured(task)
    return msgspec.structs.replace(measurement, reads=merged(task.reads, reads.states()))


def _measured(task: MeasureTask) -> Measurement:
    model, coordinates = load(task.system, task.sidecar, task.engine)
    present = snapshot_of(task.system, task.scenario, task.motion, task.scale, task.components)
    accepted, on_accepted = task.accepted, None
    if accepted is not None and comparable(present, accepted):
        segments = segments_of(accepted)
        end, uncertainty = ends(model, coordinates, segments)
        on_accepted = OnAccepted(
            end=rows(end.tolist()),
            uncertainty=rows(uncertainty.tolist()),
            equations=rows(_flow(task.variants, task.variants.nominal[None], segments)[0].tolist()),
        )
        if is_accepted(present, accepted, on_accepted):
            present = accepted
    if present is not accepted:
        segments = segments_of(present)
        end, uncertainty = ends(model, coordinates, segments)
    return Measurement(
        snapshot=present,
        end=rows(end.tolist()),
        uncertainty=rows(uncertainty.tolist()),
        constants=identify(task.variants, segments, end, uncertainty),
        on_accepted=on_accepted,
    )


def is_accepted(present: Snapshot, accepted: Snapshot, now: OnAccepted) -> bool:
    """Return whether the accepted snapshot still fits: the same motion, and the same equations.

    Otherwise a change of the equations too small to change the motion would be reported in every
    later run, since the old ends would remain the reference.
    """
    return same_motion(present, accepted) and not of_equations(accepted, now)


def comparable(present: Snapshot, accepted: Snapshot) -> bool:
    """Return whether two snapshots have equal numbers of components and inputs, and similar
    times.
    """
    inputs = {len(row) for one in (present, accepted) for nodes in one.input_nodes for row in nodes}
    timed = {time is None for one in (present, accepted) for time in one.t}
    return len(present.components) == len(accepted.components) and len(inputs) == len(timed) == 1


def identify(
    variants: Variants, segments: PickedSegments, end: Array, uncertainty: Array
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
    target = (end / segments.scale)[is_known]
    weight = np.maximum((uncertainty / segments.scale)[is_known], 1e-16)
    shift = np.zeros(len(chosen))

    def ends_at(shifts: Array) -> Array:
        points = np.tile(variants.nominal, (len(shifts), 1))
        points[:, chosen] += shifts * sizes
        return (_flow(variants, points, segments) / segments.scale)[:, is_known]

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


def _flow(variants: Variants, points: Array, segments: PickedSegments) -> Array:
    """Return the ends by the equations at parameter points: (P, parameters) -> (P, K, 2n)."""
    ends = np.empty((len(points), *segments.end.shape))
    for length in np.unique(segments.length):
        chosen = segments.length == length
        ends[:, chosen] = variants.flows(
            points,
            segments.t[chosen],
            segments.start[chosen],
            float(length),
            inputs_of(segments, chosen, len(points)),
        )
    return ends
