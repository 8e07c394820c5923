"""What a sound model shows before it is made wrong."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from physics_crosscheck.harness.diagnosis.task import DiagnosisTask, trial_model
from physics_crosscheck.harness.modelfiles.bindings import bindings
from physics_crosscheck.harness.mutation.faults import literal_faults
from physics_crosscheck.harness.mutation.mistakes import Mistake, Subject, known_mistakes
from physics_crosscheck.reference.mechanism.numeric import Array


class MutationError(ValueError):
    """A folder that is not sound to begin with; the message names file and remedy."""


@dataclass(frozen=True, kw_only=True)
class Survey:
    """How a sound model's motions depend on each literal, and what can go wrong.

    Attributes:
        addresses: of the bound literals, in the order of `slopes`.
        slopes: change of the ends per unit of each literal, (L, N).
        first_caught: relative fault of each literal at which it is first seen, (L,); inf: never.
        ends, uncertainty: of the sound model, (N,).
        faults: everything that is to be made wrong.
    """

    addresses: tuple[str, ...]
    slopes: Array
    first_caught: Array
    ends: Array
    uncertainty: Array
    faults: tuple[Mistake, ...]


def survey(task: DiagnosisTask) -> Survey:
    """Move every literal of the sound model a little, and look for what can be made wrong.

    Raises:
        MutationError: for a model that is not sound to begin with.
    """
    found = bindings(task.system, task.sidecar)
    with trial_model(task) as (whole, uncertainty):
        wrong = float(np.max(np.abs(whole.defect({})) - uncertainty))
        if wrong > 0:
            raise MutationError(
                f"{task.sidecar.model}: it differs from its equations already in {task.engine}; to"
                " show what would be caught it must be right: see `crosscheck run`"
            )
        bound = tuple(s for s in whole.candidates if s.hypothesis.id.kind == "literal")
        slopes = replace(whole, candidates=bound).slopes({})
        known = known_mistakes(Subject(task, whole.model, whole.coordinates, found))
    sizes = np.array([abs(b.value) or 1.0 for b in found])
    return Survey(
        addresses=tuple(b.address for b in found),
        slopes=slopes,
        first_caught=_first_caught(np.abs(slopes) * sizes[:, None], uncertainty),
        ends=whole.ends,
        uncertainty=uncertainty,
        faults=(*literal_faults(found, whole.model.coordinates), *known),
    )


def _first_caught(effects: Array, uncertainty: Array) -> Array:
    """Relative faults from which on one end leaves its uncertainty, (L,); effects: (L, N)."""
    # What differs by no more than twice the rounding of the ends depends on nothing.
    seen = np.where(effects * 1e-4 > 2 * uncertainty, effects, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        needed = np.where(seen > 0, uncertainty / seen, np.inf)
    first: Array = np.min(needed, axis=1, initial=np.inf)
    return first
