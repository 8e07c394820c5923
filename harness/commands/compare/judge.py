"""Verdict from the end states of both models' runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.checks import verdict as verdicts
from physics_crosscheck.harness.checks.verdict import CaseJudgement
from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.harness.numerics.ladder import EPSILON, movement
from physics_crosscheck.harness.records.outcome import Outcome, differs
from physics_crosscheck.reference.solving.segments import Segments
from .match import Match
from .segments import SOURCE_SHARE, Ends, unwrapped
from .states import SampledStates

EQUAL_TOLERANCE = 1e-6
"""Relative tolerance for equal differences, such as those of identical legs."""


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """Runs of the source that are resolved, with their end states.

    Attributes:
        states: all sampled states, and the scales of the motions.
        runs: K runs, in the source's coordinates, with forces on those of the comparison.
        compared: the same in the coordinates of the comparison, with their ends and scale.
        ends: of all runs of the source.
        bound: uncertainty of the ends, (K, 2m).
        lost: number of runs left out because the source's motion is not smooth there.
    """

    states: SampledStates
    runs: Segments
    compared: Segments
    ends: Ends
    bound: Array
    lost: int

    @property
    def is_smooth(self) -> bool:
        """True if most runs of the source are resolved."""
        return self.lost <= len(self.bound)


def recorded_runs(states: SampledStates, ends: Ends, match: Match, resolution: float) -> Recorded:
    """Return the resolved runs of the source."""
    start = match.convert(states.runs.start)
    end = unwrapped(ends.value, start, match.periodic)
    finite = np.isfinite(ends.uncertainty).all(axis=1)
    moved = movement(end[finite], start[finite])
    kept = _resolved(np.max(ends.uncertainty / moved, axis=1), resolution)
    runs = replace(states.runs, lengths=np.full(len(start), ends.length)).pick(kept)
    scale = movement(end[kept], start[kept])
    return Recorded(
        states=states,
        runs=runs,
        compared=replace(
            runs, start=start[kept], end=end[kept], scale=scale, fastest=states.fastest
        ),
        ends=ends,
        bound=np.maximum(ends.uncertainty[kept], 16 * EPSILON * scale),
        lost=len(start) - len(kept),
    )


def _resolved(uncertainty: Array, resolution: float) -> NDArray[np.intp]:
    """Return which runs of K are resolved, given relative uncertainties (K,).

    The target adds about the same uncertainty. Where most runs leave room for it, return only
    those.
    """
    (clear,) = np.nonzero(uncertainty <= SOURCE_SHARE * resolution)
    if 2 * len(clear) >= len(uncertainty):
        return clear
    return np.flatnonzero(uncertainty <= resolution)


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """Verdict of a comparison.

    Attributes:
        verdict: of the target against the source.
        by_component: the largest difference of each component, relative, (2m,).
        certain: which of these exceed their uncertainty in some run, (2m,).
    """

    verdict: CaseJudgement
    by_component: Array
    certain: NDArray[np.bool_]

    @property
    def outcome(self) -> Outcome:
        """The outcome."""
        return self.verdict.outcome

    @property
    def largest(self) -> float:
        """The largest difference of any component."""
        return float(np.max(self.by_component))


def judge(recorded: Recorded, followed: Ends, match: Match, resolution: float) -> Judgement:
    """Judge the target by the rule of verdicts, with the runs of the source as reference."""
    compared = recorded.compared
    components = (*match.names, *(f"{name}_dot" for name in match.names))
    limit = replace(
        followed.limit,
        value=unwrapped(followed.value, compared.end, match.periodic),
        converges=followed.limit.converges and followed.mostly_limited and recorded.is_smooth,
        order_confirmed=followed.limit.order_confirmed and recorded.ends.limit.order_confirmed,
    )
    verdict = verdicts.judge(
        limit, replace(compared, bound=recorded.bound), components, followed.claimed, resolution
    )
    defect = np.abs(limit.value - compared.end) / compared.unit
    uncertainty = (limit.uncertainty + recorded.bound) / compared.unit
    defect = np.where(np.isfinite(uncertainty), defect, 0.0)
    if verdict.outcome is Outcome.DIFFERS:
        differing = differs(defect, uncertainty, verdict.resolution)
        verdict = _largest(verdict, defect, uncertainty, differing, components)
    label = "B" if match.source == "A" else "A"
    if not (recorded.is_smooth and recorded.ends.limit.order_confirmed):
        label = match.source
    reason = "" if verdict.outcome is Outcome.AGREES else f"in {label}, {verdict.reason}"
    kind = "" if verdict.outcome is Outcome.DIFFERS else verdict.kind
    return Judgement(
        verdict=replace(verdict, reason=reason, kind=kind),
        by_component=np.max(defect, axis=0),
        certain=np.asarray((defect > uncertainty).any(axis=0)),
    )


def _largest(
    verdict: CaseJudgement,
    defect: Array,
    uncertainty: Array,
    differing: NDArray[np.bool_],
    components: Sequence[str],
) -> CaseJudgement:
    """Return a verdict that names the component with the largest certain difference.

    The ratio to the uncertainty would depend on last digits. Of like differences, take the first.
    """
    sizes = np.max(np.where(differing, defect, 0.0), axis=0)
    component = int(np.argmax(sizes >= (1 - EQUAL_TOLERANCE) * np.max(sizes)))
    run = int(np.argmax(np.where(differing[:, component], defect[:, component], -1.0)))
    size, doubt = float(defect[run, component]), float(uncertainty[run, component])
    return replace(
        verdict,
        component=components[component],
        discrepancy=size,
        uncertainty=doubt,
        reason=f"{components[component]} ends a run {size:.2e} of its displacement apart, where"
        f" {doubt:.1e} is uncertain",
    )
