"""Survey of a sound model before faults are planted."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from physics_crosscheck.harness.checks.task import SystemTask
from physics_crosscheck.harness.diagnosis.task import trial_model
from physics_crosscheck.harness.modelfiles.bindings import bindings
from physics_crosscheck.reference.mechanism.numeric import Array
from .faults import literal_faults
from .mistakes import Mistake, Subject, known_mistakes


class MutationError(ValueError):
    """A model that is not sound before any fault; the message gives the file and the remedy."""


@dataclass(frozen=True, kw_only=True)
class FaultSurvey:
    """The effect of each literal on a sound model's motions, and the possible faults.

    Attributes:
        addresses: addresses of the bound literals, in the order of `slopes`.
        slopes: change of the ends per unit of each literal, (L, N).
        first_caught: smallest detectable relative fault of each literal, (L,); inf: undetectable.
        ends, uncertainty: ends of the sound model and their uncertainty, (N,).
        faults: all faults to plant.
    """

    addresses: tuple[str, ...]
    slopes: Array
    first_caught: Array
    ends: Array
    uncertainty: Array
    faults: tuple[Mistake, ...]


def survey(task: SystemTask) -> FaultSurvey:
    """Measure the effect of a small change of every literal, and collect the possible faults.

    Raises:
        MutationError: for a model that is not sound.
    """
    literals = bindings(task.target.system, task.declared)
    with trial_model(task) as (whole, uncertainty):
        wrong = float(np.max(np.abs(whole.defect({})) - uncertainty))
        if wrong > 0:
            raise MutationError(
                f"{task.declared.model}: it differs from its equations already in {task.engine}; to"
                " show what would be caught it must be right: see `crosscheck run`"
            )
        bound = tuple(s for s in whole.hypotheses if s.id.kind == "literal")
        slopes = replace(whole, hypotheses=bound).slopes({})
        mistakes = known_mistakes(Subject(task, whole.model, whole.coordinates, literals))
    sizes = np.array([abs(b.value) or 1.0 for b in literals])
    return FaultSurvey(
        addresses=tuple(b.address for b in literals),
        slopes=slopes,
        first_caught=_first_caught(np.abs(slopes) * sizes[:, None], uncertainty),
        ends=whole.ends,
        uncertainty=uncertainty,
        faults=(*literal_faults(literals, whole.model.coordinates), *mistakes),
    )


def _first_caught(effects: Array, uncertainty: Array) -> Array:
    """Return the smallest relative faults that move an end beyond its uncertainty, (L,); effects
    (L, N).
    """
    # A difference of up to twice the rounding of the ends is no effect.
    seen = np.where(effects * 1e-4 > 2 * uncertainty, effects, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        needed = np.where(seen > 0, uncertainty / seen, np.inf)
    first: Array = np.min(needed, axis=1, initial=np.inf)
    return first
