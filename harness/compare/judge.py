"""From the ends of both models' runs to one outcome."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from harness.compare.candidate import Candidate
from harness.compare.excitation import Recorded, unwrapped
from harness.compare.match import Match
from harness.compare.runs import Runs, ends
from harness.engines.protocol import Array
from harness.numerics.ladder import EPSILON, Limit
from harness.records.outcome import Outcome


@dataclass(frozen=True)
class TargetTask:
    """What a worker needs to run the target: `signs` turns joints the other way, (m,)."""

    candidate: Candidate
    runs: Runs
    fastest: float
    resolution: float
    signs: Array


@dataclass(frozen=True)
class Followed:
    """Where the target ends the runs, in the coordinates of the comparison; see `Limit`."""

    limit: Limit
    claimed: int


def follow(task: TargetTask) -> Followed:
    """Run the target from the source's states.

    Raises:
        EngineError, BlownUpError: naming what could not be run.
    """
    model, s, given = task.candidate.load(), task.signs, task.runs
    runs = Runs(given.length, given.z * s, given.w * s, given.push * s)
    limit = ends(model, runs, None, task.fastest, task.resolution)
    limit.value[:] *= np.concatenate([s, s])
    return Followed(limit, model.exponents(False)[0])


@dataclass(frozen=True)
class Judgement:
    """What became of the comparison.

    Attributes:
        discrepancy: E, the largest difference of the ends, relative to how far the component moves.
        uncertainty: U, likewise; both are those of `component`, in the run numbered `run`.
        by_component: the largest difference of each component, relative, (2m,).
        reason: one sentence for whatever is not AGREES.
    """

    outcome: Outcome
    discrepancy: float
    uncertainty: float
    component: str
    run: int
    by_component: Array
    reason: str


def judge(recorded: Recorded, followed: Followed, match: Match, resolution: float) -> Judgement:
    """Judge by the verdict's rule: DIFFERS where E > U, AGREES where U is small enough.

    A run differs where its difference exceeds its own uncertainty; one that could not be resolved
    doesn't hide one that was.
    """
    limit = followed.limit
    components = (*match.names, *(f"{name}_dot" for name in match.names))
    value = unwrapped(limit.value, recorded.end, match.periodic)
    defect = np.abs(value - recorded.end) / recorded.scale
    uncertainty = (limit.uncertainty + recorded.uncertainty) / recorded.scale
    uncertainty = np.maximum(uncertainty, 16 * EPSILON)
    by_component = np.max(np.where(np.isfinite(uncertainty), defect, 0.0), axis=0)

    def judgement(outcome: Outcome, run: int, i: int, reason: str) -> Judgement:
        e, u = float(defect[run, i]), float(uncertainty[run, i])
        return Judgement(outcome, e, u, components[i], run, by_component, reason)

    source, target = ("A", "B") if match.source == "A" else ("B", "A")
    trouble = _trouble(recorded, followed, source, target)
    if trouble:
        run, i = _place(defect)
        return judgement(Outcome.UNRESOLVED, run, i, trouble)
    with np.errstate(invalid="ignore"):
        ratio = np.where(np.isfinite(uncertainty), defect / uncertainty, 0.0)
    i = int(np.argmax(np.max(ratio, axis=0)))
    differing = ratio[:, i] > 1
    if differing.any():
        run = int(np.argmax(np.where(differing, defect[:, i], -1.0)))
        reason = (
            f"{components[i]} ends a run of {recorded.runs.length:.3g} s"
            f" {float(defect[run, i]):.2e} of its movement apart, where"
            f" {float(uncertainty[run, i]):.1e} is uncertain"
        )
        return judgement(Outcome.DIFFERS, run, i, reason)
    run, worst = _place(uncertainty)
    if uncertainty[run, worst] > resolution:
        known = float(uncertainty[run, worst])
        reason = (
            f"the ladder diverges in {target} from states where it doesn't in {source}: a contact,"
            " a limit or friction"
            if known == float("inf")
            else f"{components[worst]} is known to {known:.1e} at best, where {resolution:.0e} was"
            " asked"
        )
        return judgement(Outcome.UNRESOLVED, run, worst, reason)
    run, i = _place(ratio)
    return judgement(Outcome.AGREES, run, i, "")


def _place(values: Array) -> tuple[int, int]:
    run, i = np.unravel_index(int(np.nanargmax(values)), values.shape)
    return int(run), int(i)


def _trouble(recorded: Recorded, followed: Followed, source: str, target: str) -> str:
    """Why no digit can be claimed, or nothing."""
    limit = followed.limit
    if recorded.lost > len(recorded.runs.z):
        return (
            f"the motion of {source} is not smooth in {recorded.lost} of"
            f" {recorded.lost + len(recorded.runs.z)} runs: a contact, a limit or friction"
        )
    if not recorded.holds:
        return (
            f"the exponents don't hold in {source}: its rungs fall with order {recorded.order:.2f}"
        )
    if float(limit.draws[0]) == 0.0:
        return f"every rung returned the same values: the engine of {target} did not step"
    if not limit.converges:
        return f"the ladder diverges in {target}: a contact, a limit or friction"
    if not limit.holds:
        return (
            f"the exponents don't hold in {target}: its rungs fall with order {limit.order:.2f},"
            f" {followed.claimed} is claimed"
        )
    return ""
