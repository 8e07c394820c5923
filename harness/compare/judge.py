"""Verdict from the end states of both models' runs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.compare.candidate import Candidate
from physics_crosscheck.harness.compare.excitation import Recorded, unwrapped
from physics_crosscheck.harness.compare.match import Match
from physics_crosscheck.harness.compare.runs import Runs, ends
from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.harness.numerics import judgement
from physics_crosscheck.harness.numerics.judgement import UnresolvedReason, unresolved_reason
from physics_crosscheck.harness.numerics.ladder import EPSILON, Limit
from physics_crosscheck.harness.records.case import CaseKind
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.results.status import counted

EQUAL_TOLERANCE = 1e-6
"""Relative tolerance for equal differences, such as those of identical legs."""

MIN_LIMITED_SHARE = 0.1
"""Share of the target's runs that must have a limit for a verdict."""


@dataclass(frozen=True)
class TargetTask:
    """Input of a worker that runs the target; `signs` reverses joints, (m,)."""

    candidate: Candidate
    runs: Runs
    resolution: float
    signs: Array


@dataclass(frozen=True)
class TargetEnds:
    """The target's end states, in the coordinates of the comparison; see `Limit`.

    Attributes:
        limit: as h -> 0.
        finest: at the finest rung, (K, 2m).
        claimed: order of its integrator.
    """

    limit: Limit
    finest: Array
    claimed: int

    @property
    def mostly_known(self) -> bool:
        """True if enough runs have a limit, so that last digits do not decide."""
        finite = np.isfinite(self.limit.uncertainty).all(axis=1)
        return bool(np.mean(finite) >= MIN_LIMITED_SHARE)


def follow(task: TargetTask) -> TargetEnds:
    """Run the target from the source's states.

    Raises:
        EngineError, BlownUpError: for a failing run.
    """
    model, s, given = task.candidate.load(), task.signs, task.runs
    runs = Runs(length=given.length, z=given.z * s, w=given.w * s, push=given.push * s)
    extrapolated, both = ends(model, runs, None, task.resolution), np.concatenate([s, s])
    extrapolated.limit.value[:] *= both
    return TargetEnds(extrapolated.limit, extrapolated.raw[-1] * both, model.exponents(False)[0])


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """Verdict of a comparison.

    Attributes:
        discrepancy: E, the largest difference of end states, relative to the component's movement.
        uncertainty: U, relative too; E and U belong to `component` and the run numbered `run`.
        largest_discrepancy, largest_uncertainty: over all components and runs.
        by_component: the largest difference of each component, relative, (2m,).
        certain: which of these exceed their uncertainty in some run, (2m,).
        reason: one sentence for each outcome except AGREES.
    """

    outcome: Outcome
    discrepancy: float
    uncertainty: float
    largest_discrepancy: float
    largest_uncertainty: float
    component: str
    run: int
    by_component: Array
    certain: NDArray[np.bool_]
    reason: str
    kind: CaseKind = ""


def judge(recorded: Recorded, followed: TargetEnds, match: Match, resolution: float) -> Judgement:
    """Judge by the rule of verdicts, with the uncertainty of both models."""
    limit = followed.limit
    components = (*match.names, *(f"{name}_dot" for name in match.names))
    value = unwrapped(limit.value, recorded.end, match.periodic)
    defect = np.abs(value - recorded.end) / recorded.scale
    uncertainty = (limit.uncertainty + recorded.uncertainty) / recorded.scale
    uncertainty = np.maximum(uncertainty, 16 * EPSILON)
    source, target = ("A", "B") if match.source == "A" else ("B", "A")
    hindered = _obstacle_in_source(recorded)
    resolution = judgement.resolvable(limit, recorded.scale, resolution)
    there = unresolved_reason(limit) or (
        None if followed.mostly_known else UnresolvedReason.DIVERGES
    )
    verdict = judgement.judge(defect, uncertainty, resolution, hindered or there)
    reason = ""
    stopped = hindered or verdict.unresolved_reason
    finite_defect = np.where(np.isfinite(uncertainty), defect, 0.0)
    certain = finite_defect > uncertainty
    if verdict.outcome is Outcome.DIFFERS:
        verdict = _largest(
            verdict,
            finite_defect,
            uncertainty,
            certain & (finite_defect + uncertainty > resolution),
        )
        reason = (
            f"{components[verdict.component]} ends a run of {recorded.runs.length:.3g} s"
            f" {verdict.discrepancy:.2e} of its movement apart, where"
            f" {verdict.uncertainty:.1e} is uncertain"
        )
    elif hindered:
        reason = _in_source(hindered, recorded, source)
    elif verdict.unresolved_reason:
        reason = _in_target(verdict, followed, (source, target), components, resolution)
    return Judgement(
        outcome=verdict.outcome,
        discrepancy=verdict.discrepancy,
        uncertainty=verdict.uncertainty,
        largest_discrepancy=verdict.largest_discrepancy,
        largest_uncertainty=verdict.largest_uncertainty,
        component=components[verdict.component],
        run=verdict.segment,
        by_component=np.max(finite_defect, axis=0),
        certain=np.asarray(certain.any(axis=0)),
        reason=reason,
        kind=stopped.kind if stopped and verdict.outcome is Outcome.UNRESOLVED else "",
    )


def _largest(
    verdict: judgement.LimitVerdict, defect: Array, uncertainty: Array, differing: NDArray[np.bool_]
) -> judgement.LimitVerdict:
    """Return a verdict that names the component with the largest certain difference.

    The ratio to the uncertainty would depend on last digits. Of like differences, take the first.
    """
    sizes = np.max(np.where(differing, defect, 0.0), axis=0)
    component = int(np.argmax(sizes >= (1 - EQUAL_TOLERANCE) * np.max(sizes)))
    run = int(np.argmax(np.where(differing[:, component], defect[:, component], -1.0)))
    return replace(
        verdict,
        component=component,
        segment=run,
        discrepancy=float(defect[run, component]),
        uncertainty=float(uncertainty[run, component]),
    )


def _obstacle_in_source(recorded: Recorded) -> UnresolvedReason | None:
    if recorded.lost > len(recorded.runs.z):
        return UnresolvedReason.DIVERGES
    return None if recorded.order_confirmed else UnresolvedReason.WRONG_ORDER


def _in_source(hindered: UnresolvedReason, recorded: Recorded, source: str) -> str:
    if hindered is UnresolvedReason.DIVERGES:
        runs = counted(recorded.lost + len(recorded.runs.z), "run")
        return (
            f"the motion of {source} is not smooth in {recorded.lost} of {runs}:"
            " a contact, a joint limit or friction"
        )
    return (
        f"the convergence order in {source} is {recorded.order:.2f}, not the one its engine claims"
    )


def _in_target(
    verdict: judgement.LimitVerdict,
    followed: TargetEnds,
    models: tuple[str, str],
    components: tuple[str, ...],
    resolution: float,
) -> str:
    source, target = models
    if verdict.unresolved_reason is UnresolvedReason.STANDS_STILL:
        return f"the engine of {target} did not move: every time step returned the same values"
    if verdict.unresolved_reason is UnresolvedReason.DIVERGES:
        return f"{target} does not converge: a contact, a joint limit or friction acts"
    if verdict.unresolved_reason is UnresolvedReason.WRONG_ORDER:
        return (
            f"the convergence order in {target} is {followed.limit.order:.2f}, but the engine"
            f" claims {followed.claimed}"
        )
    if verdict.unresolved_reason is UnresolvedReason.DIVERGES_HERE:
        return (
            f"{target} does not converge from states where {source} does: a contact, a joint limit"
            " or friction acts"
        )
    return (
        f"{components[verdict.component]} is resolved to {verdict.uncertainty:.1e}, but"
        f" {resolution:.0e} was requested"
    )
