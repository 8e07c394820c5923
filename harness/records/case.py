"""One model file in one engine in one scenario: how it came out, and what it costs."""

from __future__ import annotations

import math

import msgspec

from physics_crosscheck.harness.records.base import (
    Count,
    Number,
    Numbers,
    Record,
    Rows,
    SourceLine,
    one_length,
)
from physics_crosscheck.harness.records.outcome import ROUNDED, Outcome, contradiction

ModelKey = tuple[str, str, str]
"""Folder, model file and engine: two folders may hold systems of the same name."""


class ModelId(Record, frozen=True, kw_only=True, order=True):
    """One model file of a system in one engine.

    Attributes:
        system: name of the system; that of its folder where the declaration can't be loaded.
        model: name of the model file; `-` where a folder has none, `system.py` where that failed.
        engine: name of the engine; `-` where none was reached.
    """

    system: str
    model: str
    engine: str

    def __str__(self) -> str:
        return f"{self.system}/{self.model} [{self.engine}]"


class CaseId(Record, frozen=True, kw_only=True, order=True):
    """One model file of a system in one engine in one scenario.

    Attributes:
        system, model, engine: as in `ModelId`.
        scenario: name of the scenario; `-` where none was reached.
    """

    system: str
    model: str
    scenario: str
    engine: str

    def __str__(self) -> str:
        return f"{self.system}/{self.model}/{self.scenario} [{self.engine}]"

    @property
    def of_model(self) -> ModelId:
        """The model in its engine."""
        return ModelId(system=self.system, model=self.model, engine=self.engine)


class Verdict(Record, frozen=True, kw_only=True):
    """What the extrapolated segments say of a model's motion against the equations'.

    Discrepancies and uncertainties are relative to how far a component moves over a segment at
    most.

    Attributes:
        discrepancy, uncertainty: E and U of `component`, the one that decides: with the largest
            E/U, or the one that is resolved worst.
        component: such as `x` or `theta_dot`.
        time: start of the segment with the largest defect, seconds.
        largest_discrepancy, largest_uncertainty: over all components and segments.
        order, claimed_order: leading order of the error in the step, as seen on the rungs (None
            where rounding hides it) and as the engine claims.
        rungs: step counts of the ladder.
        steps: engine steps taken.
        map_residual, map_uncertainty: by how much the engine's coordinates leave the coordinate map
            at most, and how sure that is, relative to how far they move; None where the map leaves
            nothing open.
        resolution: at which it was judged: what was asked, or what the engine's numbers allow; None
            where it is not known.
    """

    discrepancy: Number
    uncertainty: Number
    component: str
    time: Number
    largest_discrepancy: Number
    largest_uncertainty: Number
    order: Number
    claimed_order: Count
    rungs: tuple[Count, ...]
    steps: Count
    map_residual: Number = None
    map_uncertainty: Number = None
    resolution: Number = None


def starts_at(time: float | None, segment: int) -> str:
    """Where a segment begins: a time, or which of the states that no motion joins."""
    known = time is not None and math.isfinite(time)
    return f"t = {time:.4g} s" if known else f"state {segment + 1}"


class ErrorDecomposition(Record, frozen=True, kw_only=True):
    """The error of a full run, taken apart.

    Attributes:
        amplitude: relative error of the amplitude at the end.
        phase: at the end, rad; positive lags behind.
        frequency: relative error of the frequency.
        damping: error of the damping ratio.
        explained: share of the mean square error that these explain.
    """

    amplitude: Number
    phase: Number
    frequency: Number
    damping: Number
    explained: Number


class TargetStep(Record, frozen=True, kw_only=True):
    """The step at which neither positions nor velocities have more error.

    Attributes:
        target: relative to the amplitudes.
        step: seconds; None where none can be told.
    """

    target: float
    step: Number


class CheckedStep(Record, frozen=True, kw_only=True):
    """The one of these predictions that was run.

    Attributes:
        target, measured: error that was predicted, and the larger one of both that came out.
        step: seconds.
    """

    target: float
    step: float
    measured: Number


class FullRun(Record, frozen=True, kw_only=True):
    """What a user lives with: runs from start to end, at the shipped step and its neighbours.

    Attributes:
        time_step: step that the file, or its sidecar, ships with, seconds.
        integrator: name of the time-stepping method.
        global_error: largest position error at the shipped step, relative to the amplitude.
        velocity_error: largest velocity error there, likewise; None in records of before.
        order: observed order of it.
        residual: what is left of it as the step falls, by extrapolation.
        resolved_until: end of the stretch on which order and residual were read, seconds.
        decomposition: None where the error is not small.
        steps_for: steps that would give 1 %, 0.1 % and 0.01 % of positions and velocities both.
        checked_step: None where none was run.
        energy_error: imbalance of the energy at the shipped step, relative to what is exchanged.
        constraint_drift: largest, in the engine's units.
    """

    time_step: Number
    integrator: str
    global_error: Number
    velocity_error: Number = None
    order: Number
    residual: Number
    resolved_until: Number = None
    decomposition: ErrorDecomposition | None
    steps_for: tuple[TargetStep, ...]
    checked_step: CheckedStep | None
    energy_error: Number
    constraint_drift: Number


class Stepping(Record, frozen=True, kw_only=True):
    """An engine's very next state at the shipped step, against its own rule on the equations.

    Attributes:
        rule: how the engine steps, as it is documented.
        besides: what else acts in a step and goes to nothing with it; empty: nothing known.
        step: seconds.
        outcome: AGREES or DIFFERS, or UNRESOLVED where rounding hides it.
        discrepancy, uncertainty: of `component`, relative to how far it moves in a step at most.
        component: the one that decides.
        digits: the largest difference, in last digits of the component where it is largest.
        digits_later: the same ten steps later; None where that is not finite.
        digits_long: a thousand steps later, from a few states; None too where it was not asked for.
    """

    rule: str
    besides: str
    step: Number
    outcome: Outcome
    discrepancy: Number
    uncertainty: Number
    component: str
    digits: Number
    digits_later: Number
    digits_long: Number = None


class ForceTerm(Record, frozen=True, kw_only=True):
    """One of the terms of the equations of motion, in an engine against the equations.

    Attributes:
        name: such as `mass matrix`.
        discrepancy: the largest, in generalized forces, relative to the largest on its coordinate.
    """

    name: str
    discrepancy: Number


class ForwardDynamics(Record, frozen=True, kw_only=True):
    """An engine's accelerations, for which it takes no step, against the equations'.

    Attributes:
        outcome: AGREES or DIFFERS, or UNRESOLVED where rounding hides it.
        discrepancy, uncertainty: of `component`, relative to its largest.
        component: the one that decides, such as `x_ddot`.
        states: at which the engine told them.
        terms: of the equations of motion.
    """

    outcome: Outcome
    discrepancy: Number
    uncertainty: Number
    component: str
    states: Count
    terms: tuple[ForceTerm, ...]


class Convergence(Record, frozen=True, kw_only=True):
    """How the segments' ladder converged.

    Attributes:
        rungs: step counts.
        h: mean step of each, seconds.
        defect: root mean square defect of the segments at each rung, relative, the largest of the
            components.
        increments: largest change of the limit by each further rung, relative.
    """

    rungs: tuple[Count, ...]
    h: Numbers
    defect: Numbers
    increments: Numbers

    def __post_init__(self) -> None:
        one_length("the convergence", self.rungs, self.h, self.defect)


class StepErrors(Record, frozen=True, kw_only=True):
    """Full runs at several steps.

    Attributes:
        h: seconds; of the shipped step first.
        error: largest position error, relative to the amplitude.
        seconds: of wall-clock time that the engine took for each.
    """

    h: Numbers
    error: Numbers
    seconds: Numbers

    def __post_init__(self) -> None:
        one_length("the errors by step", self.h, self.error, self.seconds)


class EnergySeries(Record, frozen=True, kw_only=True):
    """Energies of the full run at the shipped step, J, at the series' times.

    Attributes:
        held: since the start.
        supplied, dissipated: work of the inputs and of the dampers since then.
    """

    held: Numbers
    supplied: Numbers
    dissipated: Numbers


class Series(Record, frozen=True, kw_only=True):
    """What a plot of a case shows; a row a component.

    Attributes:
        t: times of `reference`, `engine` and `error`, seconds.
        components: names of the state's components, positions then velocities.
        reference: of the equations.
        engine: the full run at the shipped step.
        error: engine - reference.
        segment_t: starts of the segments that are shown, seconds.
        defect: extrapolated, signed, relative to the component's movement.
        defect_uncertainty: of each.
        convergence: of the segments.
        full_runs: errors by step.
        energy: of the full run at the shipped step; None where it was not kept.
    """

    t: Numbers
    components: tuple[str, ...]
    reference: Rows
    engine: Rows
    error: Rows
    segment_t: Numbers
    defect: Rows
    defect_uncertainty: Rows
    convergence: Convergence
    full_runs: StepErrors
    energy: EnergySeries | None

    def __post_init__(self) -> None:
        energy = () if self.energy is None else msgspec.structs.astuple(self.energy)
        motions = self.reference, self.engine, self.error
        defects = self.defect, self.defect_uncertainty
        one_length("the series", self.components, *motions, *defects)
        one_length("the motion", self.t, *energy, *(row for rows in motions for row in rows))
        one_length("the defects", self.segment_t, *(row for rows in defects for row in rows))


class Case(Record, frozen=True, kw_only=True):
    """One case, whatever became of it.

    Attributes:
        system, model, scenario, engine: its name, as in `CaseId`.
        folder: of the system; of a robot checked alone its file.
        outcome: what became of it.
        reason: a sentence for whatever is not AGREES, and for what AGREES with a reservation.
        accepted: the reason for which a known difference is accepted; empty where none is.
        locations: where that is in the files, as far as it is known.
        kind: which of the sentences of an engine's motion `reason` is, where it has numbers of
            this case alone; empty where the sentence itself tells.
        stdout: what a failed case printed.
        seconds: that it took, of wall-clock time.
        verdict, full_run, series: None where the case was not judged.
        stepping: None too where no rule for the engine's step is known.
        forward_dynamics: None too where the engine tells no accelerations.
    """

    system: str
    model: str
    scenario: str
    engine: str
    folder: str
    outcome: Outcome
    reason: str = ""
    accepted: str = ""
    locations: tuple[SourceLine, ...] = ()
    kind: str = ""
    stdout: str = ""
    seconds: float = 0.0
    verdict: Verdict | None = None
    full_run: FullRun | None = None
    series: Series | None = None
    stepping: Stepping | None = None
    forward_dynamics: ForwardDynamics | None = None

    @property
    def id(self) -> CaseId:
        """Its name."""
        return CaseId(
            system=self.system, model=self.model, scenario=self.scenario, engine=self.engine
        )

    @property
    def key(self) -> ModelKey:
        """What tells the case's model in its engine from all others of a run."""
        return self.folder, self.model, self.engine

    def contradiction(self, resolution: float) -> str:
        """Return how its outcome contradicts its own numbers; empty where it does not.

        Args:
            resolution: that was asked of the run.
        """
        v, dynamics = self.verdict, self.forward_dynamics
        if not self.outcome.is_run:
            return ""
        if v is None:
            return f"{self.outcome} without the numbers of a verdict"
        least = max(resolution, ROUNDED * (v.largest_uncertainty or 0.0))
        if self.outcome is Outcome.DIFFERS:
            least = resolution
        at = least if v.resolution is None else v.resolution
        if why := contradiction(self.outcome, v.discrepancy, v.uncertainty, at):
            return why
        if self.outcome is not Outcome.AGREES:
            return ""
        # Each the largest of its own segment: what is larger than both others differs somewhere.
        e, u = v.largest_discrepancy, v.largest_uncertainty
        if e is None or u is None or e > max(u, at):
            return f"AGREES contradicts the largest E = {e} and U = {u} at the resolution {at:.1e}"
        if v.map_residual is not None and v.map_residual > max(v.map_uncertainty or 0.0, least):
            return f"AGREES contradicts the residual {v.map_residual:.1e} of its coordinate map"
        if dynamics is not None and dynamics.outcome is Outcome.DIFFERS:
            return "AGREES contradicts its accelerations, which differ"
        return ""

    @property
    def passes(self) -> bool:
        """Whether it AGREES, or what it does instead, a failure apart, is accepted."""
        if not self.outcome.is_run:
            return False
        return self.outcome is Outcome.AGREES or bool(self.accepted)
