"""Verdict from the end states of both models' runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.checks import verdict as verdicts
from physics_crosscheck.harness.checks.verdict import Verdict
from physics_crosscheck.harness.compare.match import Match
from physics_crosscheck.harness.compare.segments import SOURCE_SHARE, Ends, Runs, unwrapped
from physics_crosscheck.harness.compare.states import SampledStates
from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.harness.numerics.ladder import EPSILON, movement
from physics_crosscheck.harness.records.outcome import Outcome, differs
from physics_crosscheck.reference.solving.segments import Segments

EQUAL_TOLERANCE = 1e-6
"""Relative tolerance for equal differences, such as those of identical legs."""


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """Runs of the source that are resolved, with their end states.

    Attributes:
        states: all sampled states, and the scales of the motions.
        runs: K runs, in the source's coordinates.
        compared: the same in the coordinates of the comparison.
        ends: of the source.
        end, bound: end states of these runs and their uncertainties, (K, 2m).
        scale: how far each component moves at most, (2m,).
        lost: number of runs left out because the source's motion is not smooth there.
    """

    states: SampledStates
    runs: Runs
    compared: Runs
    ends: Ends
    end: Array
    bound: Array
    scale: Array
    lost: int

    @property
    def segments(self) -> Segments:
        """The runs as the reference of a verdict."""
        start = np.hstack([self.compared.z, self.compared.w])
        unsolved = Segments.unsolved(start, self.runs.length, self.runs.push, scale=self.scale)
        return replace(unsolved, end=self.end, bound=self.bound, fastest=self.states.fastest)

    @property
    def is_smooth(self) -> bool:
        """True if most runs of the source are resolved."""
        return self.lost <= len(self.end)


def recorded_runs(states: SampledStates, ends: Ends, match: Match, resolution: float) -> Recorded:
    """Return the resolved runs of the source."""
    runs = replace(states.runs, length=ends.length)
    z, w = match.over(runs.z, runs.w)
    start = np.hstack([z, w])
    end = unwrapped(ends.value, start, match.periodic)
    finite = np.isfinite(ends.uncertainty).all(axis=1)
    moved = movement(end[finite], start[finite])
    kept = _resolved(np.max(ends.uncertainty / moved, axis=1), resolution)
    source, scale = runs.rows(kept), movement(end[kept], start[kept])
    return Recorded(
        states=states,
        runs=source,
        compared=replace(source, z=z[kept], w=w[kept]),
        ends=ends,
        end=end[kept],
        bound=np.maximum(ends.uncertainty[kept], 16 * EPSILON * scale),
        scale=scale,
        lost=len(z) - len(kept),
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

    verdict: Verdict
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
    components = (*match.names, *(f"{name}_dot" for name in match.names))
    limit = replace(
        followed.limit,
        value=unwrapped(followed.value, recorded.end, match.periodic),
        converges=followed.limit.converges and followed.mostly_limited and recorded.is_smooth,
        order_confirmed=followed.limit.order_confirmed and recorded.ends.limit.order_confirmed,
    )
    verdict = verdicts.judge(limit, recorded.segments, components, followed.claimed, resolution)
    defect = np.abs(limit.value - recorded.end) / recorded.scale
    uncertainty = (limit.uncertainty + recorded.bound) / recorded.scale
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
    verdict: Verdict,
    defect: Array,
    uncertainty: Array,
    differing: NDArray[np.bool_],
    components: Sequence[str],
) -> Verdict:
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
