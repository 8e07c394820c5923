"""Verdicts from single steps, where an engine documents its stepping rule.

One step by the rule on the equations gives a model's accelerations at a state, to 13 digits. An
extrapolated segment takes 40 steps and more for 12 digits. So segments are skipped where every step
agrees: from states of the motion, ten steps on from there, and each step of a full run. Any doubt
leaves the decision to segments, so that single steps alone never report a difference.
"""

from dataclasses import dataclass, replace

import numpy as np

from physics_crosscheck.harness.engines.protocol import LoadedModel, StepRule
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.forward_dynamics import (
    AccelerationComparison,
    forward_dynamics,
    mixed,
)
from physics_crosscheck.harness.numerics.full_run import (
    CompleteRun,
    held_inputs,
    steps_of,
    traced_run,
)
from physics_crosscheck.harness.numerics.judgement import judge
from physics_crosscheck.harness.numerics.ladder import EPSILON
from physics_crosscheck.harness.numerics.stepping import (
    StepComparison,
    StepDefects,
    compare_run,
    step_engine,
)
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.reference.dynamics.equations import VectorFunction
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.next_state import Stepped
from physics_crosscheck.reference.solving.segments import Motion, even_indices
from .verdict import CaseJudgement, short_numbers

MARGIN = 100.0
"""Factor by which the differences of single steps, and their uncertainty, must be below the
resolution. A number with a small effect on a step may have a larger one on a segment."""

CLEAR = 1e-3
"""Uncertainty of steps in short numbers above which segments may resolve more."""

MOST_STEPS = 100_000
"""Largest number of steps of a run that is compared step by step; its states are kept in memory."""


@dataclass(frozen=True, kw_only=True)
class RunSteps:
    """Each step of a full run at the file's own time step, compared with the rule.

    Attributes:
        run: the run.
        t: start of each step, (S,), s.
        defects: differences of the steps.
    """

    run: CompleteRun
    t: Array
    defects: StepDefects

    def picked(self, limit: int) -> tuple[Array, Array, Array]:
        """Return at most `limit` times, (P,), their defects and uncertainties, (P, 2n)."""
        rows = even_indices(len(self.t), limit)
        return self.t[rows], self.defects.defect[rows], self.defects.uncertainty[rows]


@dataclass(frozen=True, kw_only=True)
class StepsVerdict:
    """A verdict by single steps.

    Attributes:
        verdict: the verdict; AGREES.
        steps: number of engine steps that were compared.
        motion: the steps of a full run; None without a motion.
    """

    verdict: CaseJudgement
    steps: int
    motion: RunSteps | None


@dataclass(frozen=True, kw_only=True)
class SteppedModel:
    """A loaded model beside the equations that its steps are compared with.

    Attributes:
        model: the model.
        coordinates: map from the equations' coordinates to the engine's.
        stepped: the equations.
        components: names of the state's components, (2n,).
        inputs: number of inputs of the equations.
        resolution: smallest relative difference that counts.
        power: (energy, supplied, dissipated) of full runs; None: without an energy balance.
    """

    model: LoadedModel
    coordinates: CoordinateMap
    stepped: Stepped
    components: tuple[str, ...]
    inputs: int
    resolution: float
    power: VectorFunction | None = None

    def single_steps(
        self, states: Array, inputs: Array, *, fastest: float, long: bool = False
    ) -> StepComparison | None:
        """Compare one step from each state, as `step_engine` does."""
        return step_engine(
            self.model,
            self.coordinates,
            self.stepped,
            states,
            inputs,
            self.resolution,
            fastest=fastest,
            long=long,
        )

    def accelerations(self, states: Array, inputs: Array) -> AccelerationComparison | None:
        """Compare accelerations there, and at further states in the same positions."""
        return forward_dynamics(
            self.model, self.coordinates, self.stepped, *mixed(states, inputs), self.resolution
        )


def decide_by_steps(
    compared: SteppedModel,
    stepping: StepComparison | None,
    dynamics: AccelerationComparison | None,
    motion: Motion | None,
    coarsest: float = CLEAR,
) -> StepsVerdict | None:
    """Return the verdict that single steps allow; None if segments must decide.

    Args:
        compared: the model and its equations.
        stepping: the comparison of single steps; None without a rule.
        dynamics: the comparison of accelerations; None if the engine exposes none.
        motion: the motion of full runs; None without one.
        coarsest: largest uncertainty that decides in short numbers.
    """
    if stepping is None:
        return None
    if compared.model.epsilon > EPSILON:
        short = _by_short_numbers(compared, stepping, dynamics)
        is_fine = short is not None and short.verdict.largest_uncertainty <= coarsest
        return short if is_fine and motion is None else None
    if not suffices(stepping, dynamics, compared.resolution):
        return None
    if motion is None:
        return _build(compared, stepping, None)
    if steps_of(motion.duration, compared.model.step) > MOST_STEPS:
        return None
    steps = _run_steps(compared, stepping, motion)
    least, defects = compared.resolution / MARGIN, steps.defects
    largest = np.max(defects.defect), np.max(defects.uncertainty), defects.off_map
    if not np.max(largest) <= least:
        return None
    return _build(compared, stepping, steps)


def _by_short_numbers(
    compared: SteppedModel, stepping: StepComparison, dynamics: AccelerationComparison | None
) -> StepsVerdict | None:
    """Return the verdict of steps and accelerations that differ by rounding only.

    Rounding of short numbers hides more of a segment than of a step: the weights of its
    extrapolation multiply it.
    """
    if stepping.rule.besides or dynamics is None or not dynamics.complete:
        return None
    each = stepping.judgement, dynamics.judgement
    if any(one.outcome is Outcome.DIFFERS for one in each):
        return None
    largest = max(one.largest_uncertainty for one in each)
    built = _build(compared, stepping, None)
    epsilon, requested = compared.model.epsilon, compared.resolution
    verdict = replace(
        built.verdict,
        largest_uncertainty=largest,
        resolution=max(requested, largest),
        reason="" if largest <= requested else short_numbers(epsilon, largest, requested),
    )
    return replace(built, verdict=verdict)


def suffices(
    stepping: StepComparison, dynamics: AccelerationComparison | None, resolution: float
) -> bool:
    """Return whether steps from given states leave no doubt about the model.

    An equality or another effect that vanishes with the step leaves some. Where a rule evaluates
    forces at the step's end, a wrong mass and wrong forces could cancel in a step, but not in
    accelerations.
    """
    rule, judged = stepping.rule, stepping.judgement
    largest = (
        judged.largest_discrepancy,
        judged.largest_uncertainty,
        stepping.later.share,
        stepping.later.off_map,
    )
    if rule.besides or judged.outcome is not Outcome.AGREES:
        return False
    if not np.max(largest) <= resolution / MARGIN:  # nan, if a run is not finite
        return False
    if dynamics is None:
        return not _evaluates_later(rule)
    return dynamics.judgement.outcome is Outcome.AGREES and dynamics.complete


def _evaluates_later(rule: StepRule) -> bool:
    """Return whether a rule evaluates some forces at the end of a step."""
    matrices = rule.damping, rule.stiffness, rule.substeps
    return rule.by_velocity or any(one is not None for one in matrices)


def _run_steps(compared: SteppedModel, stepping: StepComparison, motion: Motion) -> RunSteps:
    model, coordinates = compared.model, compared.coordinates
    run, states, residuals = traced_run(model, coordinates, motion, compared.power, model.step)
    inputs = held_inputs(motion.inputs, model.step, len(states) - 1)
    if not inputs.size:  # the motion of a robot from rest, without forces
        inputs = np.zeros((len(inputs), compared.inputs))
    rows = states, residuals, inputs, stepping.rounding
    return RunSteps(
        run=run,
        t=model.step * np.arange(len(inputs), dtype=np.float64),
        defects=compare_run(model, coordinates, compared.stepped, *rows),
    )


def _build(
    compared: SteppedModel, stepping: StepComparison, motion: RunSteps | None
) -> StepsVerdict:
    """Build the verdict: the largest differences of all steps."""
    judged, time, steps = stepping.judgement, float("nan"), stepping.states
    if motion is not None:
        defects = motion.defects
        judged = judge(defects.defect, defects.uncertainty, compared.resolution, None)
        time, steps = float(motion.t[judged.segment]), steps + len(motion.t)
    off_map = max(stepping.later.off_map, 0.0 if motion is None else motion.defects.off_map)
    each = stepping.judgement, judged
    verdict = CaseJudgement(
        outcome=Outcome.AGREES,
        discrepancy=judged.discrepancy,
        uncertainty=judged.uncertainty,
        largest_discrepancy=max(one.largest_discrepancy for one in each),
        largest_uncertainty=max(one.largest_uncertainty for one in each),
        component=compared.components[judged.component],
        time=time,
        order=float("nan"),
        map_residual=off_map if compared.coordinates.redundant else float("nan"),
        map_uncertainty=float("nan"),
        reason="",
        resolution=compared.resolution,
        decided_by="single steps",
    )
    return StepsVerdict(verdict=verdict, steps=steps, motion=motion)
