"""Faults to plant, and the survey of a sound folder before that."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Generic

import numpy as np

from physics_crosscheck.harness.checks.prepare import PreparedSystem
from physics_crosscheck.harness.checks.task import ModelTask, P, SystemTask
from physics_crosscheck.harness.diagnosis.task import trial_model
from physics_crosscheck.harness.modelfiles.bindings import Binding, bindings
from physics_crosscheck.harness.records.base import number
from physics_crosscheck.harness.records.cause import CauseId
from physics_crosscheck.harness.records.mutation import FaultKind, FaultVerdict, Mutation
from physics_crosscheck.reference.mechanism.numeric import Array
from .mistakes import Edit, Mistake, Subject, known_mistakes, literal_causes

SIZES = {"1e-6": 1 + 1e-6, "1e-3": 1 + 1e-3, "5 %": 1.05}
FACTORS = {"left out": 0.0, "sign": -1.0, "double": 2.0, "half": 0.5}
"""Factors for a literal: the small faults, and typical human mistakes."""

FAULTS = SIZES | FACTORS


def literal_faults(literals: Sequence[Binding], joints: Sequence[str]) -> Iterator[Mistake]:
    """Yield every nonzero bound literal, multiplied by each factor.

    Args:
        literals: the bound literals.
        joints: names of the engine's coordinates.
    """
    # A number with the opposite sign may be equivalent to a reversed axis.
    mirrored = frozenset(CauseId(kind="axis", subject=(name,)) for name in joints)
    for b in literals:
        for label, factor in FAULTS.items() if b.value else ():
            causes = literal_causes(b.address) | (mirrored if factor < 0 else frozenset())
            yield Mistake(label, b.address, Edit({b.address: b.value * factor}), causes)


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
    """

    addresses: tuple[str, ...]
    slopes: Array
    first_caught: Array
    ends: Array
    uncertainty: Array


@dataclass(frozen=True, kw_only=True)
class PlantedFault(Generic[P]):
    """A sound model with one wrong number, or one typical mistake.

    Attributes:
        model: the sound model, at the states of a diagnosis.
        mistake: what is wrong.
        values: right and wrong value of a number; None for a mistake.
        size: relative size of a wrong number of a model of bodies.
        first_seen: smallest detectable change of the number, as a share of its size; inf:
            undetectable; 0: unknown; None for a mistake.
        in_steps: whether whole steps detect a change of that size.
        uncertainty: relative uncertainty of the ends of a sound model's segments.
        survey: survey of a sound folder with energies.
    """

    model: ModelTask[P]
    mistake: Mistake
    values: tuple[float, float] | None = None
    size: float | None = None
    first_seen: float | None = None
    in_steps: bool = False
    uncertainty: float = 0.0
    survey: FaultSurvey | None = None

    def row(
        self,
        verdict: FaultVerdict,
        message: str = "",
        size: float | None = None,
        share: float | None = None,
    ) -> Mutation:
        """Return the row of the fault, with the detectable share of a mistake."""
        sound = FaultKind.NONE if self.mistake.sound else FaultKind.MISTAKE
        return Mutation(
            system=self.model.target.record.name,
            model=self.model.file.name,
            engine=self.model.engine,
            kind=sound if self.values is None else FaultKind.LITERAL,
            name=self.mistake.name,
            location=self.mistake.location,
            verdict=verdict,
            discrepancy=number(size),
            message=message,
            estimate_error=None,
            first_caught=number(share if self.first_seen is None else self.first_seen),
        )


def system_faults(task: SystemTask) -> tuple[PlantedFault[PreparedSystem], ...]:
    """Return all faults of a model: seven for each bound literal, and known mistakes.

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
    survey = FaultSurvey(
        addresses=tuple(b.address for b in literals),
        slopes=slopes,
        first_caught=_first_caught(np.abs(slopes) * sizes[:, None], uncertainty),
        ends=whole.ends,
        uncertainty=uncertainty,
    )
    first = dict(zip(survey.addresses, survey.first_caught.tolist(), strict=True))
    values = {b.address: b.value for b in literals}
    numbers = (
        PlantedFault(
            model=task,
            mistake=one,
            values=(values[one.location], one.edit.literals[one.location]),
            first_seen=first[one.location],
            survey=survey,
        )
        for one in literal_faults(literals, whole.model.coordinates)
    )
    return (*numbers, *(PlantedFault(model=task, mistake=one, survey=survey) for one in mistakes))


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
