"""A sweep: what became of each of its cases, and the plan that they follow from."""

from __future__ import annotations

from physics_crosscheck.harness.records.base import Number, Record
from physics_crosscheck.harness.records.outcome import Outcome


class SweepRow(Record, frozen=True, kw_only=True):
    """A case of a sweep.

    Attributes:
        index: its number in the plan.
        draw: number of the draw of its constants.
        system, model, engine, scenario: the case.
        integrator: name of the time-stepping method.
        step: the shipped step, seconds.
        constants: values of those that are varied, by name.
        outcome: see `Outcome`.
        reason: one sentence for whatever is not AGREES.
        discrepancy, uncertainty: E and U of the verdict, relative to the movement over a segment.
        resolution: at which it was judged: what was asked, or what the engine's numbers allow.
        digits: that agree in every component, -log10 max(E, U).
        global_error: at the shipped step, relative to the amplitude.
        order: leading order seen on the segments' rungs.
        steps: engine steps taken.
        engine_seconds: of the processor, in the engine's own stepping.
        reference_seconds: for the reference motion; of the first case of a draw's scenario that a
            worker has, 0 for those after it.
        loading_seconds: for the model file's copy and its loading by the engine.
        seconds: of the processor, in all.
        command: that runs this case alone.
    """

    index: int
    draw: int
    system: str
    model: str
    engine: str
    scenario: str
    integrator: str
    step: Number = None
    constants: dict[str, float]
    outcome: Outcome
    reason: str = ""
    discrepancy: Number = None
    uncertainty: Number = None
    resolution: Number = None
    digits: Number = None
    global_error: Number = None
    order: Number = None
    steps: int = 0
    engine_seconds: float = 0.0
    reference_seconds: float = 0.0
    loading_seconds: float = 0.0
    seconds: float = 0.0
    command: str = ""

    @property
    def name(self) -> str:
        """Of the case, without its constants."""
        return f"{self.system}/{self.model} [{self.engine}] {self.scenario}"


class SweepPlan(Record, frozen=True, kw_only=True):
    """What a sweep's rows follow from: equal plans have equal rows.

    Attributes:
        command: without `--only`, as it is to be run again.
        options: everything that was asked for, by name.
        folders: hash of what is in each system folder.
        versions: of this package, Python, the engines and libraries.
        cases: in all.
        constants: names of those that are varied, a column each.
    """

    command: str
    options: dict[str, str]
    folders: dict[str, str]
    versions: dict[str, str]
    cases: int
    constants: tuple[str, ...]


class SweepGroup(Record, frozen=True, kw_only=True):
    """Cases of one system in one engine and integrator.

    Attributes:
        system, engine, integrator: whose.
        outcomes: number of cases by outcome.
        least_digits: fewest digits that agree of those that agree.
        worst_error: largest global error of those that did not fail.
    """

    system: str
    engine: str
    integrator: str
    outcomes: dict[str, int]
    least_digits: Number = None
    worst_error: Number = None


class SweepSummary(Record, frozen=True, kw_only=True):
    """What a sweep's rows say together.

    Attributes:
        plan: that they follow from.
        done: rows there are.
        outcomes: number of cases by outcome, the worst first.
        digits: number of agreeing cases by whole digits.
        groups: by system, engine and integrator.
        worst: cases to look at first: those that did not agree, then the fewest digits and the
            largest errors.
        sampled: rows for pictures, an even share of all where these are many.
        steps: engine steps.
        engine_seconds, reference_seconds, loading_seconds, seconds: processor time of all.
    """

    plan: SweepPlan
    done: int
    outcomes: dict[str, int]
    digits: dict[str, int]
    groups: tuple[SweepGroup, ...]
    worst: tuple[SweepRow, ...]
    sampled: tuple[SweepRow, ...]
    steps: int
    engine_seconds: float
    reference_seconds: float
    loading_seconds: float
    seconds: float

    @property
    def overhead(self) -> Number:
        """Processor time of a case, in units of the engine's own stepping."""
        return self.seconds / self.engine_seconds if self.engine_seconds > 0 else None
