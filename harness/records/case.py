"""One model file in one engine in one scenario: its outcome and cost."""

import math
from typing import Literal

import msgspec

from .base import Count, Number, Numbers, Record, Rows, SourceLine, one_length
from .codes import case_code
from .finding import AuditFinding
from .outcome import ROUNDED, Outcome, contradiction
from .poses import Poses
from .scene import ActingState, StateErrors

CaseKind = Literal[
    "",
    "motion", "coordinate map", "acceleration", "pose", "whole step", "compiled number", "contact",
    "stands still", "diverges", "wrong order", "not smooth", "coarse", "rounding",
    "full run", "time step",
    "not finite", "blows up", "too coarse", "long step",
    "file", "unsupported", "format", "engine", "sidecar", "declaration", "robot", "reference",
    "massless", "no joint", "negative mass", "moments", "triangle",
    "time limit", "waiting", "memory limit", "crash", "exit",
]  # fmt: skip
"""Why a case does not agree: its motion, extrapolation, full runs, files or worker process.

Each has a message code and a page.
"""

MEASURED: tuple[CaseKind, ...] = (
    "motion", "coordinate map", "acceleration", "pose", "whole step", "compiled number", "contact",
    "stands still", "diverges", "wrong order", "not smooth", "coarse", "rounding", "full run",
    "time step", "not finite", "blows up", "too coarse",
)  # fmt: skip
"""Kinds whose reasons differ only in the numbers of a case."""

OWN_LIMITS: tuple[CaseKind, ...] = (
    "file", "unsupported", "format", "engine", "massless", "negative mass", "moments", "triangle",
    "not finite", "blows up", "too coarse", "long step", "crash", "exit",
)  # fmt: skip
"""Kinds of failures of one engine that others may not have."""

ModelKey = tuple[str, str, str]
"""Folder, model file and engine; systems in different folders can have the same name."""


def model_path(system: str, model: str) -> str:
    """Return the name of a model file; the system of an accepted robot file is its path."""
    if system == model or system.endswith(f"/{model}"):
        return system
    return f"{system}/{model}"


class ModelId(Record, frozen=True, kw_only=True, order=True):
    """One model file of a system in one engine.

    Attributes:
        system: Name of the system; the folder name if the declaration cannot be loaded.
        model: Name of the model file; `-` for an empty folder, `system.py` if the declaration
            failed.
        engine: Name of the engine; `-` if no engine was reached.
    """

    system: str
    model: str
    engine: str

    def __str__(self) -> str:
        return f"{model_path(self.system, self.model)} [{self.engine}]"


class CaseId(Record, frozen=True, kw_only=True, order=True):
    """One model file of a system in one engine and one scenario.

    Attributes:
        system: Name of the system; the folder name if the declaration cannot be loaded.
        model: Name of the model file; `-` for an empty folder, `system.py` if the declaration
            failed.
        scenario: Name of the scenario; `-` if no scenario was reached.
        engine: Name of the engine; `-` if no engine was reached.
    """

    system: str
    model: str
    scenario: str
    engine: str

    def __str__(self) -> str:
        return f"{self.path}/{self.scenario} [{self.engine}]"

    @property
    def path(self) -> str:
        """The model file with its system."""
        return model_path(self.system, self.model)

    @property
    def of_model(self) -> ModelId:
        """The model in its engine."""
        return ModelId(system=self.system, model=self.model, engine=self.engine)


DecidedBy = Literal["segments", "single steps", "accelerations", "poses", "whole steps"]
"""The check whose numbers a verdict states."""


class SkippedCheck(Record, frozen=True, kw_only=True):
    """A check that did not run, because another one decides the case; it is not passed.

    Attributes:
        check: Name of the check.
        reason: Why it was not needed.
    """

    check: Literal["segments", "finer full runs", "predicted time step", "1000 steps"]
    reason: str


class Verdict(Record, frozen=True, kw_only=True):
    """Comparison of the model's motion with the equations.

    Each discrepancy and uncertainty is relative to how far its component moves over a segment, or
    over a step where single steps decide.

    Attributes:
        decided_by: Check that decides.
        discrepancy: Discrepancy E of `component`.
        uncertainty: Uncertainty U of `component`.
        component: The deciding component, such as `x` or `theta_dot`: largest E/U, or worst
            resolved.
        time: Start of the segment with the largest difference, seconds.
        largest_discrepancy: Largest discrepancy over all components and segments.
        largest_uncertainty: Largest uncertainty over all components and segments.
        order: Observed order of the error of segments; None if rounding hides it, or steps decide.
        claimed_order: Order that the engine claims.
        rungs: Steps per segment, one number per rung of the extrapolation; empty without one.
        steps: Number of engine steps that the check took.
        map_residual: Largest violation of the coordinate map, relative to the motion; None if
            cannot be violated.
        map_uncertainty: Uncertainty of `map_residual`.
        resolution: Resolution used: the requested one, or what the engine's precision
            allows; None if unknown.
        excess: Excess of the change of `component`'s velocity; negative: too slow; None: unclear.
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
    decided_by: DecidedBy = "segments"
    excess: Number = None


def starts_at(time: float | None, segment: int) -> str:
    """Return where a segment starts: a time, or the index of a separate state."""
    is_known = time is not None and math.isfinite(time)
    return f"t = {time:.4g} s" if is_known else f"state {segment + 1}"


class ErrorDecomposition(Record, frozen=True, kw_only=True):
    """The error of a full run, split into its parts.

    Attributes:
        amplitude: Relative amplitude error at the end.
        phase: Phase error at the end, rad; positive means that the model lags.
        frequency: Relative frequency error.
        damping: Error of the damping ratio.
        explained: Share of the mean square error that these four explain.
    """

    amplitude: Number
    phase: Number
    frequency: Number
    damping: Number
    explained: Number


class TargetStep(Record, frozen=True, kw_only=True):
    """The largest time step that keeps all errors below a target.

    Attributes:
        target: Target error of positions and velocities, relative to their amplitudes.
        step: Predicted time step, seconds; None if it cannot be predicted.
    """

    target: float
    step: Number


class CheckedStep(Record, frozen=True, kw_only=True):
    """A predicted time step, verified by a run.

    Attributes:
        target: Target error.
        step: Time step of the run, seconds.
        measured: Measured error, the larger of positions and velocities.
    """

    target: float
    step: float
    measured: Number


class EventTime(Record, frozen=True, kw_only=True):
    """One event of a motion: an impact, or a change of a contact, friction or a drive.

    Attributes:
        part: Names of the interactions that change.
        change: How they change, such as `impact` or `stick to slip+`.
        time: Time in the reference, seconds.
        in_run: Time in the run at the model's own step; None if not seen.
    """

    part: str
    change: str
    time: float
    in_run: Number = None


class FullRun(Record, frozen=True, kw_only=True):
    """Runs from start to end at the model's own time step and at neighboring steps.

    Attributes:
        time_step: Time step of the file or its sidecar, seconds.
        integrator: Name of the integrator.
        global_error: Largest position error at `time_step`, relative to the amplitude.
        velocity_error: Largest velocity error at `time_step`, relative to the amplitude, away from
            events; None in older files.
        order: Observed order of the error.
        residual: Extrapolated error; through events, that of the finest run; None below three runs.
        resolved_until: End of the interval used for `order` and `residual`, seconds.
        decomposition: Parts of the error; None if the error is large.
        steps_for: Time steps for errors of 1 %, 0.1 % and 0.01 %.
        checked_step: The predicted step that was verified; None if none was.
        energy_error: Energy imbalance at `time_step`, relative to the energy exchanged.
        constraint_drift: Largest constraint violation, in the engine's units.
        events: Events of the motion, with their times in this run.
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
    events: tuple[EventTime, ...] = ()


class TimeStep(Record, frozen=True, kw_only=True):
    """The model's own time step, without a full run: its error and its stability.

    Attributes:
        step: Time step of the file or its sidecar, seconds.
        duration: Length of the smooth motion, seconds; None without one.
        error: Its largest error, relative to the amplitude; None if it blows up.
        order: Exponent of the step in the error; 0 if no step follows the motion.
        steps_for: Predicted steps for errors of 1 %, 0.1 % and 0.01 %.
        growth: Growth of a small deviation in a step; None if none grows unlike the equations.
        joint: Coordinate that takes part most in what grows; empty without growth.
        largest_stable: Largest stable step, seconds; None if unknown.
        finding: What makes the step unstable; None if it is stable.
    """

    step: Number
    duration: Number = None
    error: Number = None
    order: Count = 0
    steps_for: tuple[TargetStep, ...] = ()
    growth: Number = None
    joint: str = ""
    largest_stable: Number = None
    finding: AuditFinding | None = None


class StepChoice(Record, frozen=True, kw_only=True):
    """Time steps of a robot file in one engine, as `crosscheck step` lists them.

    Attributes:
        file: The robot file.
        engine: Name of the engine.
        integrator: Name of the integrator.
        step: Time step of the file, or the default, seconds.
        error: Largest error over one second of smooth motion, relative to the amplitude; None if it
            blows up, or no time step follows the motion.
        largest_stable: Largest stable step, seconds; None if it is above 0.1 s, or unknown.
        target: Requested error.
        step_for: Step for the requested error, seconds; None if it cannot be predicted.
        unstable: What makes the step unstable; empty if it is stable.
        problem: Reason for missing numbers; empty without one.
    """

    file: str
    engine: str
    integrator: str = ""
    step: Number = None
    error: Number = None
    largest_stable: Number = None
    target: float
    step_for: Number = None
    unstable: str = ""
    problem: str = ""


class Stepping(Record, frozen=True, kw_only=True):
    """The engine's next state after one step, compared with its documented step rule.

    Attributes:
        rule: Documented step rule of the engine.
        besides: Other effects in a step that vanish with its size; empty if none are known.
        step: Time step, seconds.
        outcome: AGREES, DIFFERS, or UNRESOLVED if rounding hides the answer.
        discrepancy: Discrepancy of `component`, relative to its largest movement in a step.
        uncertainty: Uncertainty of `discrepancy`.
        component: The deciding component.
        digits: Largest difference, in units in the last place of the largest component.
        digits_later: The same after ten steps; None if not finite.
        digits_long: The same after a thousand steps, from few states; None if absent or
            not finite.
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
    """One term of the equations of motion.

    Attributes:
        name: Name of the term, such as `mass matrix`.
        discrepancy: Largest difference in generalized force, relative to the largest force on that
            coordinate.
    """

    name: str
    discrepancy: Number


class ForwardDynamics(Record, frozen=True, kw_only=True):
    """The engine's accelerations compared with the equations, without a step.

    Attributes:
        outcome: AGREES, DIFFERS, or UNRESOLVED if rounding hides the answer.
        discrepancy: Discrepancy of `component`, relative to its largest value.
        uncertainty: Uncertainty of `discrepancy`.
        component: The deciding component, such as `x_ddot`.
        states: Number of states at which accelerations were compared.
        terms: Differences per term of the equations of motion.
    """

    outcome: Outcome
    discrepancy: Number
    uncertainty: Number
    component: str
    states: Count
    terms: tuple[ForceTerm, ...]

    @property
    def differs(self) -> bool:
        """True if it differs."""
        return self.outcome is Outcome.DIFFERS


class Convergence(Record, frozen=True, kw_only=True):
    """Convergence of the extrapolation over its rungs.

    Attributes:
        rungs: Steps per segment.
        h: Mean step of each rung, seconds.
        defect: Root mean square difference at each rung, relative; the largest component.
        increments: Largest relative change of the limit from each further rung.
    """

    rungs: tuple[Count, ...]
    h: Numbers
    defect: Numbers
    increments: Numbers

    def __post_init__(self) -> None:
        one_length("the convergence", self.rungs, self.h, self.defect)


class StepErrors(Record, frozen=True, kw_only=True):
    """Errors of full runs at several time steps.

    Attributes:
        h: Time steps, seconds; the model's own step first.
        error: Largest position error of each run, relative to the amplitude.
        seconds: Wall-clock time of each run.
    """

    h: Numbers
    error: Numbers
    seconds: Numbers

    def __post_init__(self) -> None:
        one_length("the errors by step", self.h, self.error, self.seconds)


class EnergySeries(Record, frozen=True, kw_only=True):
    """Energies of the full run at the model's own time step, J, at the times `t` of the series.

    Attributes:
        held: Change of the stored energy since the start.
        supplied: Work of the inputs since the start.
        dissipated: Energy lost in dampers since the start.
    """

    held: Numbers
    supplied: Numbers
    dissipated: Numbers


class Series(Record, frozen=True, kw_only=True):
    """Data for the plots of a case; one row per component.

    Attributes:
        t: Times of `reference`, `engine` and `error`, seconds.
        components: Names of the components, positions first, then velocities.
        reference: Solution of the equations.
        engine: Full run at the model's own time step.
        error: `engine` minus `reference`.
        segment_t: Start times of the plotted segments or single steps, seconds.
        defect: Difference from the equations after each segment or step, relative to the
            movement.
        defect_uncertainty: Uncertainty of each `defect`.
        convergence: Convergence of the extrapolation; None without segments.
        full_runs: Error against time step.
        energy: Energies of the full run; None if not recorded.
    """

    t: Numbers
    components: tuple[str, ...]
    reference: Rows
    engine: Rows
    error: Rows
    segment_t: Numbers
    defect: Rows
    defect_uncertainty: Rows
    convergence: Convergence | None
    full_runs: StepErrors
    energy: EnergySeries | None

    def __post_init__(self) -> None:
        energy = () if self.energy is None else msgspec.structs.astuple(self.energy)
        motions = self.reference, self.engine, self.error
        defects = self.defect, self.defect_uncertainty
        one_length("the series", self.components, *motions, *defects)
        one_length("the motion", self.t, *energy, *(row for rows in motions for row in rows))
        one_length("the defects", self.segment_t, *(row for rows in defects for row in rows))


class LawTerm(Record, frozen=True, kw_only=True):
    """Forces of one kind that acted at the compared states.

    Attributes:
        name: Kind of the forces, such as `contacts`.
        count: Number of times that they acted.
    """

    name: str
    count: Count


class Touch(Record, frozen=True, kw_only=True):
    """The deepest contact of two shapes without a closed form, at a posture of their file.

    Attributes:
        posture: Its digest, one of `WholeStep.postures`.
        shapes: Names of the shapes, sorted.
        distance: Signed distance, m.
        normal: From the first shape to the other one, in the world.
        point: Position in the world, m.
        bound: Smallest right distance, of supporting planes along the normal, m; None if unknown.
        error: Error of the distance that the engine's methods explain, m.
    """

    posture: str
    shapes: tuple[str, str]
    distance: float
    normal: Numbers
    point: Numbers
    bound: Number
    error: float


class WholeStep(Record, frozen=True, kw_only=True):
    """The engine's steps with limits, friction, contacts and drives, compared with their law.

    Attributes:
        outcome: AGREES, DIFFERS, or UNRESOLVED; None if nothing was compared.
        discrepancy: Discrepancy of `component`, relative to its largest value.
        uncertainty: Uncertainty of `discrepancy`: rounding, and the bound of the solver's error.
        component: The deciding component, such as `elbow_ddot`.
        states: Number of compared states.
        unresolved: Number of further states whose uncertainty is above the resolution.
        step: Time step, seconds.
        next_state: Whether the next state was compared too, beyond accelerations.
        acted: Forces that acted at these states.
        edits: Options of the file that were changed, as `name=value`.
        covered: Parts of the file that only this check compares, with their counts, if they acted.
        inactive: What of these parts acted at no compared state.
        uncovered: Features without a law here; if any act on the bodies, nothing was compared.
        stated: Number of attributes whose compiled values were compared with the file's text.
        misread: Attributes that the compiler resolves otherwise, one sentence each.
        unread: Numbers of the laws that only the compiler read.
        acting: The state to draw; None if nothing was compared.
        contacts: Number of contacts that were compared with the file's shapes.
        contact_faults: Contacts that the engine finds otherwise, one sentence each.
        unjudged: Contacts that were not compared, with their counts.
        contact_counts: Pairs of shapes for which another engine finds another number of contacts.
        postures: Digests of the postures at which contacts without a closed form were looked for.
        touches: These contacts, for comparisons between engines.
        between: Comparisons of `touches` with other engines of the run, one sentence each.
    """

    outcome: Outcome | None = None
    discrepancy: Number = None
    uncertainty: Number = None
    component: str = ""
    states: Count = 0
    unresolved: Count = 0
    step: Number = None
    next_state: bool = False
    acted: tuple[LawTerm, ...] = ()
    edits: tuple[str, ...] = ()
    covered: tuple[str, ...] = ()
    inactive: tuple[str, ...] = ()
    uncovered: tuple[str, ...] = ()
    stated: Count = 0
    misread: tuple[str, ...] = ()
    unread: tuple[str, ...] = ()
    acting: ActingState | None = None
    contacts: Count = 0
    contact_faults: tuple[str, ...] = ()
    unjudged: tuple[str, ...] = ()
    contact_counts: tuple[str, ...] = ()
    postures: tuple[str, ...] = ()
    touches: tuple[Touch, ...] = ()
    between: tuple[str, ...] = ()

    @property
    def differs(self) -> bool:
        """True if it differs."""
        return self.outcome is Outcome.DIFFERS or bool(self.misread or self.contact_faults)

    @property
    def omitted(self) -> tuple[str, ...]:
        """Return what compared steps leave out, one phrase each."""
        steps = ("next states, time step, integrator and states of drives",)
        return (*(() if self.next_state or self.outcome is None else steps), *self.unjudged)


class Case(Record, frozen=True, kw_only=True):
    """The result of one case.

    Attributes:
        system: Name of the system; the folder name if the declaration cannot be loaded.
        model: Name of the model file; `-` for an empty folder, `system.py` if the declaration
            failed.
        scenario: Name of the scenario; `-` if no scenario was reached.
        engine: Name of the engine; `-` if no engine was reached.
        folder: System folder; the file itself for a standalone robot file.
        outcome: Outcome of the case.
        reason: One sentence that explains the outcome; empty for an unreserved AGREES.
        accepted: Reason for accepting a known difference; empty if it is not accepted.
        locations: Lines that the reason refers to, if known.
        kind: Type of `reason` if its numbers belong to this case only; empty otherwise.
        code: Message code of the kind; empty without one.
        stdout: Output that a failed case printed.
        seconds: Duration, wall-clock seconds.
        verdict: Verdict on the motion; None if the case was not judged.
        time_step: Error and stability of the model's own time step; None if unknown.
        full_run: Errors at the model's own time step; None if the case was not judged.
        series: Data for plots; None if the case was not judged.
        by_state: Errors at each compared state of bodies; None for declared energies.
        stepping: Check of the next state; None without a known step rule.
        forward_dynamics: Check of the accelerations; None if the engine reports none.
        poses: Check of the poses of bodies; None for declared energies.
        whole_step: Check of steps with limits, friction, contacts and drives; None without a
            documented law.
        skipped: Checks that did not run since others decide; `--thorough` runs them.
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
    kind: CaseKind = ""
    code: str = ""
    stdout: str = ""
    seconds: float = 0.0
    verdict: Verdict | None = None
    time_step: TimeStep | None = None
    full_run: FullRun | None = None
    series: Series | None = None
    by_state: StateErrors | None = None
    stepping: Stepping | None = None
    forward_dynamics: ForwardDynamics | None = None
    poses: Poses | None = None
    whole_step: WholeStep | None = None
    skipped: tuple[SkippedCheck, ...] = ()

    def __post_init__(self) -> None:
        msgspec.structs.force_setattr(self, "code", case_code(self.outcome, self.kind))

    @property
    def id(self) -> CaseId:
        """Name of the case."""
        return CaseId(
            system=self.system, model=self.model, scenario=self.scenario, engine=self.engine
        )

    @property
    def key(self) -> ModelKey:
        """Unique key of the case's model in its engine within a run."""
        return self.folder, self.model, self.engine

    def contradiction(self, resolution: float) -> str:
        """Return how the outcome contradicts the case's own numbers; empty if it does not.

        Args:
            resolution: requested resolution of the run.
        """
        v = self.verdict
        if not self.outcome.is_run:
            return ""
        if v is None:
            return f"{self.outcome} without the numbers of a verdict"
        least = max(resolution, ROUNDED * (v.largest_uncertainty or 0.0))
        if self.outcome is Outcome.DIFFERS:
            least = resolution
        limit = least if v.resolution is None else v.resolution
        if why := contradiction(self.outcome, v.discrepancy, v.uncertainty, limit):
            return why
        if self.outcome is not Outcome.AGREES:
            return ""
        # Maxima of E and U can be of different segments; E above both U and resolution differs.
        e, u = v.largest_discrepancy, v.largest_uncertainty
        if e is None or u is None or e > max(u, limit):
            return (
                f"AGREES contradicts the largest E = {e} and U = {u} at the resolution {limit:.1e}"
            )
        if v.map_residual is not None and v.map_residual > max(v.map_uncertainty or 0.0, least):
            return f"AGREES contradicts the residual {v.map_residual:.1e} of its coordinate map"
        part = self._differing_part
        return f"AGREES contradicts its {part}, which differs" if part else ""

    @property
    def _differing_part(self) -> str:
        """Name of a further check that differs; empty if none does."""
        parts = ((name, getattr(self, name)) for name in self.__struct_fields__)
        return next((name for name, part in parts if getattr(part, "differs", False)), "")

    @property
    def digits(self) -> Number:
        """Digits that agree in every component, rounded down to a tenth; None if unknown."""
        if self.verdict is None or self.outcome is Outcome.FAILED:
            return None
        sizes = self.verdict.largest_discrepancy, self.verdict.largest_uncertainty
        if sizes[0] is None or sizes[1] is None:
            return None
        worst = max(sizes[0], sizes[1])
        # Bitwise equal: as many digits as a double has.
        return max(0.0, math.floor(-10 * math.log10(worst)) / 10) if worst > 0 else 16.0

    @property
    def shown(self) -> Outcome:
        """The outcome to show: AGREES for an accepted difference."""
        return Outcome.AGREES if self.passes else self.outcome

    @property
    def passes(self) -> bool:
        """True if the case agrees, or ran to its end and is accepted."""
        if not self.outcome.is_run:
            return False
        return self.outcome is Outcome.AGREES or bool(self.accepted)
