"""The rule by which limits are judged, against equations or against another model.

E is the error and U its uncertainty. A model differs if E > U and E + U exceeds the resolution. It
agrees if nothing differs and U is below the resolution; otherwise it is unresolved. Each segment is
judged by its own uncertainty, so that an unresolved segment does not hide a resolved one. A
measurable error below the resolution agrees, but is reported.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.records.case import CaseKind
from physics_crosscheck.harness.records.outcome import COARSEST, ROUNDED, Outcome, differs
from physics_crosscheck.reference.mechanism.numeric import Array
from .ladder import EPSILON, ExtrapolatedLimit


class UnresolvedReason(Enum):
    """The reason why a comparison is unresolved."""

    STANDS_STILL = "all step sizes returned the same values"
    DIVERGES = "no segment's limits converge"
    WRONG_ORDER = "the errors don't fall with the claimed order"
    DIVERGES_HERE = "the limits of this segment don't converge"
    COARSE = "the uncertainty is above the resolution"

    @property
    def kind(self) -> CaseKind:
        """Return the kind of the message that reports it."""
        return _KINDS[self]


_KINDS: Mapping[UnresolvedReason, CaseKind] = {
    UnresolvedReason.STANDS_STILL: "stands still",
    UnresolvedReason.DIVERGES: "diverges",
    UnresolvedReason.WRONG_ORDER: "wrong order",
    UnresolvedReason.DIVERGES_HERE: "not smooth",
    UnresolvedReason.COARSE: "coarse",
}


@dataclass(frozen=True, kw_only=True)
class LimitVerdict:
    """The verdict on the limits of K segments with C components.

    Attributes:
        outcome: AGREES, DIFFERS or UNRESOLVED.
        unresolved_reason: why it is unresolved.
        segment, component: the most significant place.
        discrepancy, uncertainty: E and U of that component, relative; of that segment if it
            differs.
        below_resolution: whether it agrees although E > U, since E + U is below the resolution.
        largest_discrepancy, largest_uncertainty: over all segments and components.
    """

    outcome: Outcome
    unresolved_reason: UnresolvedReason | None
    segment: int
    component: int
    discrepancy: float
    uncertainty: float
    below_resolution: bool
    largest_discrepancy: float
    largest_uncertainty: float


CLEAR_SHARE = 0.1
"""Share of the largest difference, and of the largest movement, from which a direction counts."""


def excess(moved: Array, expected: Array) -> float:
    """Return by how much a component moves too fast where it differs most; negative: too slowly.

    Args:
        moved, expected: movement in the engine and in the equations, (K,).

    Returns:
        The difference relative to the expected movement; nan if the direction changes.
    """
    off = moved - expected
    worst = int(np.argmax(np.abs(off)))
    ratios = (off / expected)[np.abs(off) >= CLEAR_SHARE * np.abs(off[worst])]
    ratio = float(off[worst] / expected[worst])
    is_small = abs(expected[worst]) < CLEAR_SHARE * np.max(np.abs(expected))
    is_clear = bool(np.all(ratios * ratio > 0)) and min(ratios) > -1
    return ratio if is_clear and not is_small else float("nan")


def unresolved_reason(limit: ExtrapolatedLimit) -> UnresolvedReason | None:
    """Return why no limit has a known digit; None if there are known digits."""
    if float(limit.increments[0]) == 0.0:
        return UnresolvedReason.STANDS_STILL
    if not limit.converges:
        return UnresolvedReason.DIVERGES
    return None if limit.order_confirmed else UnresolvedReason.WRONG_ORDER


def resolvable(limit: ExtrapolatedLimit, scale: Array, requested: float) -> float:
    """Return the requested resolution, or the finest that the engine's numbers allow.

    Doubles allow any resolution. With fewer digits, a limit is known to its rounding, and to the
    random scatter of its estimates within it. What is coarser than `COARSEST` decides nothing.
    """
    if limit.epsilon <= EPSILON:
        return requested
    allowed = ROUNDED * float(np.max(limit.rounding / scale))
    return max(requested, min(allowed, COARSEST))


def judge(
    defect: Array, uncertainty: Array, resolution: float, unresolved_reason: UnresolvedReason | None
) -> LimitVerdict:
    """Judge defects and their uncertainties, (K, C) each, both relative."""
    if unresolved_reason is not None:
        segment, component = _place(defect)
        return _judgement(
            Outcome.UNRESOLVED,
            (segment, component),
            (defect, np.full_like(uncertainty, np.inf)),
            unresolved_reason,
        )
    with np.errstate(invalid="ignore"):
        ratio = np.where(np.isfinite(uncertainty), defect / uncertainty, 0.0)
    both = defect, uncertainty
    measurable = ratio > 1
    differing = differs(defect, uncertainty, resolution)
    if differing.any():
        return _judgement(Outcome.DIFFERS, _most_telling(ratio, defect, differing), both)
    worst = _place(uncertainty)
    if uncertainty[worst] > resolution:
        finite = bool(np.isfinite(uncertainty[worst]))
        here = UnresolvedReason.COARSE if finite else UnresolvedReason.DIVERGES_HERE
        return _judgement(Outcome.UNRESOLVED, worst, both, here)
    if measurable.any():
        return _judgement(Outcome.AGREES, _most_telling(ratio, defect, measurable), both)
    largest = np.max(defect, axis=0), np.max(uncertainty, axis=0)
    component = int(np.argmax(largest[0] / largest[1]))
    segment = int(np.argmax(defect[:, component]))
    return _judgement(Outcome.AGREES, (segment, component), both)


def _most_telling(ratio: Array, defect: Array, chosen: NDArray[np.bool_]) -> tuple[int, int]:
    """Return the chosen component with the largest E/U, and its segment with the largest E."""
    component = int(np.argmax(np.max(np.where(chosen, ratio, 0.0), axis=0)))
    segment = int(np.argmax(np.where(chosen[:, component], defect[:, component], -1.0)))
    return segment, component


def _judgement(
    outcome: Outcome,
    place: tuple[int, int],
    values: tuple[Array, Array],
    unresolved_reason: UnresolvedReason | None = None,
) -> LimitVerdict:
    defect, uncertainty = values
    segment, component = place
    # Report a difference at its place; otherwise a component's largest E and largest U.
    there = bool(defect[place] > uncertainty[place])
    rows = slice(segment, segment + 1) if there else slice(None)
    return LimitVerdict(
        outcome=outcome,
        unresolved_reason=unresolved_reason,
        segment=segment,
        component=component,
        discrepancy=float(np.nanmax(defect[rows, component])),
        uncertainty=float(np.max(uncertainty[rows, component])),
        below_resolution=there and outcome is Outcome.AGREES,
        largest_discrepancy=float(np.nanmax(defect)),
        largest_uncertainty=float(np.max(uncertainty)),
    )


def _place(values: Array) -> tuple[int, int]:
    row, column = np.unravel_index(int(np.nanargmax(values)), values.shape)
    return int(row), int(column)
