"""Measure what a case's model does, for the baseline: limits on a track, and constants from them.

Where an accepted track is given, the model and the equations are both run on it too: so that it can
be told which of them moved.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.baseline.snapshot import Snapshot, ends, finite, inputs_of, track
from harness.cases.case import CaseTask, load
from harness.diagnosis.diagnose import NAMED
from harness.files.sidecar import Sidecar
from reference.integrate import ReferenceError
from reference.motion import Motion
from reference.numeric import Array
from reference.system import System
from reference.variants import Variants

TIED = 1e-6
"""A constant that may change by this share of a unit change without moving any segment by more than
rounding is not identified: other constants make up for it."""

ITERATIONS = 6
NUDGE = 1e-4


@dataclass(frozen=True)
class MeasureTask:
    """Everything a worker needs; `accepted` is the track of the baseline, where there is one."""

    system: System
    sidecar: Sidecar
    engine: str
    scenario: str
    motion: Motion
    scale: Array
    components: tuple[str, ...]
    variants: Variants
    accepted: Snapshot | None


def measure_task(case: CaseTask, variants: Variants, accepted: Snapshot | None) -> MeasureTask:
    """Gather what measuring a case needs beside its verdict's own task."""
    return MeasureTask(
        case.system,
        case.sidecar,
        case.engine,
        case.scenario,
        case.motion,
        case.scale,
        case.components,
        variants,
        accepted,
    )


def measure(task: MeasureTask) -> dict[str, Any]:
    """Measure one case: `track`, `end`, `uncertainty`, `constants`, and `then` on the accepted one.

    `then` has `end` and `uncertainty` of the model, and `equations`, the ends by the present
    equations; None where no accepted track has the same number of coordinates.

    Raises:
        EngineError, SidecarError, BlownUpError: naming what could not be run.
    """
    model, coordinates = load(task.system, task.sidecar, task.engine)
    own = track(task.system, task.scenario, task.motion, task.scale, task.components)
    accepted, then = task.accepted, None
    if accepted is not None and _comparable(own, accepted):
        end, uncertainty = ends(model, coordinates, accepted)
        then = {
            "end": finite(end),
            "uncertainty": finite(uncertainty),
            "equations": finite(_flow(task.variants, task.variants.nominal[None], accepted)[0]),
        }
        if own.same_as(accepted):
            own = accepted
    if own is not accepted:
        end, uncertainty = ends(model, coordinates, own)
    return {
        "track": own.record(),
        "end": finite(end),
        "uncertainty": finite(uncertainty),
        "constants": identify(task.variants, own, end, uncertainty),
        "then": then,
    }


def _comparable(own: Snapshot, accepted: Snapshot) -> bool:
    inputs = {nodes.shape[1] for nodes in (*own.inputs, *accepted.inputs)}
    return own.start.shape[1] == accepted.start.shape[1] and len(inputs) == 1


def identify(
    variants: Variants, one: Snapshot, end: Array, uncertainty: Array
) -> dict[str, list[float]]:
    """Constants of the equations that explain where the segments end: name -> [value, error].

    Gauss-Newton over all constants at once. Left out are those that this motion can't tell from
    others; and all, where constants don't explain the motion: it has another cause then.
    """
    chosen = [i for i, p in enumerate(variants.parameters) if p.kind == "constant"]
    known = np.isfinite(uncertainty) & np.isfinite(end)
    if not chosen or not known.any():
        return {}
    sizes = variants.sizes[chosen]
    target = (end / one.scale)[known]
    weight = np.maximum((uncertainty / one.scale)[known], 1e-16)
    shift = np.zeros(len(chosen))

    def ends_at(shifts: Array) -> Array:
        points = np.tile(variants.nominal, (len(shifts), 1))
        points[:, chosen] += shifts * sizes
        return (_flow(variants, points, one) / one.scale)[:, known]

    try:
        slopes = (ends_at(NUDGE * np.eye(len(chosen))) - ends_at(-NUDGE * np.eye(len(chosen)))) / (
            2 * NUDGE
        )
        _, values, rows = np.linalg.svd(slopes.T, full_matrices=False)
        held = values > TIED * max(float(values[0]), 1e-300)
        free = rows[~held]
        inverse = np.linalg.pinv(slopes.T, rcond=TIED)
        left = first = target - ends_at(shift[None])[0]
        for _ in range(ITERATIONS):
            step = inverse @ left
            after = target - ends_at((shift + step)[None])[0]
            if not np.isfinite(after).all() or np.linalg.norm(after) >= np.linalg.norm(left):
                break
            shift, left = shift + step, after
    except (ReferenceError, np.linalg.LinAlgError):
        return {}
    explained = np.linalg.norm(left) <= NAMED * np.linalg.norm(first)
    if not explained and bool(np.any(np.abs(left) > weight)):
        return {}
    errors = np.sqrt((inverse**2) @ weight**2)
    return {
        variants.parameters[index].name: [
            float(variants.nominal[index] + shift[i] * sizes[i]),
            float(errors[i] * sizes[i]),
        ]
        for i, index in enumerate(chosen)
        if float(np.linalg.norm(free[:, i])) < TIED
    }


def _flow(variants: Variants, points: Array, one: Snapshot) -> Array:
    """Ends by the equations at some parameters: points (P, parameters) -> (P, K, 2n)."""
    found = np.empty((len(points), *one.end.shape))
    for length in np.unique(one.length):
        chosen = one.length == length
        found[:, chosen] = variants.flows(
            points,
            one.t[chosen],
            one.start[chosen],
            float(length),
            inputs_of(one, chosen, len(points)),
        )
    return found
