"""From the ends of both models' runs to one outcome."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from harness.compare.candidate import Candidate
from harness.compare.excitation import Recorded, unwrapped
from harness.compare.match import Match
from harness.compare.runs import Runs, ends
from harness.engines.protocol import Array
from harness.numerics import judgement
from harness.numerics.judgement import Obstacle, obstacle
from harness.numerics.ladder import EPSILON, Limit
from harness.records.outcome import Outcome
from harness.text.status import counted


@dataclass(frozen=True)
class TargetTask:
    """What a worker needs to run the target: `signs` turns joints the other way, (m,)."""

    candidate: Candidate
    runs: Runs
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
    runs = Runs(length=given.length, z=given.z * s, w=given.w * s, push=given.push * s)
    limit = ends(model, runs, None, task.resolution)
    limit.value[:] *= np.concatenate([s, s])
    return Followed(limit, model.exponents(False)[0])


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """What became of the comparison.

    Attributes:
        discrepancy: E, the largest difference of the ends, relative to how far the component moves.
        uncertainty: U, likewise; both are those of `component`, in the run numbered `run`.
        largest_discrepancy, largest_uncertainty: over all components and runs.
        by_component: the largest difference of each component, relative, (2m,).
        reason: one sentence for whatever is not AGREES.
    """

    outcome: Outcome
    discrepancy: float
    uncertainty: float
    largest_discrepancy: float
    largest_uncertainty: float
    component: str
    run: int
    by_component: Array
    reason: str


def judge(recorded: Recorded, followed: Followed, match: Match, resolution: float) -> Judgement:
    """Judge by the verdict's rule, with the uncertainty of both models."""
    limit = followed.limit
    components = (*match.names, *(f"{name}_dot" for name in match.names))
    value = unwrapped(limit.value, recorded.end, match.periodic)
    defect = np.abs(value - recorded.end) / recorded.scale
    uncertainty = (limit.uncertainty + recorded.uncertainty) / recorded.scale
    uncertainty = np.maximum(uncertainty, 16 * EPSILON)
    source, target = ("A", "B") if match.source == "A" else ("B", "A")
    hindered = _obstacle_in_source(recorded)
    resolution = judgement.resolvable(limit, recorded.scale, resolution)
    found = judgement.judge(defect, uncertainty, resolution, hindered or obstacle(limit))
    reason = ""
    if found.outcome is Outcome.DIFFERS:
        reason = (
            f"{components[found.component]} ends a run of {recorded.runs.length:.3g} s"
            f" {found.discrepancy:.2e} of its movement apart, where"
            f" {found.uncertainty:.1e} is uncertain"
        )
    elif hindered:
        reason = _in_source(hindered, recorded, source)
    elif found.obstacle:
        reason = _in_target(found, followed, (source, target), components, resolution)
    return Judgement(
        outcome=found.outcome,
        discrepancy=found.discrepancy,
        uncertainty=found.uncertainty,
        largest_discrepancy=found.largest_discrepancy,
        largest_uncertainty=found.largest_uncertainty,
        component=components[found.component],
        run=found.segment,
        by_component=np.max(np.where(np.isfinite(uncertainty), defect, 0.0), axis=0),
        reason=reason,
    )


def _obstacle_in_source(recorded: Recorded) -> Obstacle | None:
    if recorded.lost > len(recorded.runs.z):
        return Obstacle.DIVERGES
    return None if recorded.order_confirmed else Obstacle.WRONG_ORDER


def _in_source(hindered: Obstacle, recorded: Recorded, source: str) -> str:
    if hindered is Obstacle.DIVERGES:
        runs = counted(recorded.lost + len(recorded.runs.z), "run")
        return (
            f"the motion of {source} is not smooth in {recorded.lost} of {runs}:"
            " a contact, a limit or friction"
        )
    return f"the exponents don't hold in {source}: its rungs fall with order {recorded.order:.2f}"


def _in_target(
    found: judgement.Judgement,
    followed: Followed,
    models: tuple[str, str],
    components: tuple[str, ...],
    resolution: float,
) -> str:
    source, target = models
    if found.obstacle is Obstacle.STANDS_STILL:
        return f"every rung returned the same values: the engine of {target} did not step"
    if found.obstacle is Obstacle.DIVERGES:
        return f"the ladder diverges in {target}: a contact, a limit or friction"
    if found.obstacle is Obstacle.WRONG_ORDER:
        return (
            f"the exponents don't hold in {target}: its rungs fall with order"
            f" {followed.limit.order:.2f}, {followed.claimed} is claimed"
        )
    if found.obstacle is Obstacle.DIVERGES_HERE:
        return (
            f"the ladder diverges in {target} from states where it doesn't in {source}: a contact,"
            " a limit or friction"
        )
    return (
        f"{components[found.component]} is known to {found.uncertainty:.1e} at best, where"
        f" {resolution:.0e} was asked"
    )
