"""A sweep: the result of each case, and the plan."""

from typing import Literal

import msgspec

from .base import Number, Record
from .case import CaseKind, DecidedBy
from .codes import case_code
from .outcome import Outcome


class SweepRow(Record, frozen=True, kw_only=True):
    """One case of a sweep, one row of the table.

    Attributes:
        index: Number of the case in the plan.
        draw: Number of the draw of the constants.
        system: Name of the system.
        model: Name of the model file.
        engine: Name of the engine.
        scenario: Name of the scenario.
        integrator: Name of the integrator.
        step: Time step, seconds.
        constants: Values of the varied constants. The table has one column `constant_NAME` for
            each.
        outcome: Outcome of the case.
        reason: One sentence that explains the outcome; empty for AGREES.
        kind: Why the case does not agree; empty if it agrees, or for an unknown failure.
        code: Message code of the kind; empty if the case agrees.
        discrepancy: Discrepancy E, relative to the movement over a segment.
        uncertainty: Uncertainty U, relative to the movement over a segment.
        resolution: Resolution used: the requested one, or a coarser one that the engine's precision
            allows.
        digits: Agreeing digits in every component, -log10 max(E, U).
        global_error: Largest position error at `step`, relative to the amplitude.
        order: Observed order of the segments' error; None if single steps decide.
        decided_by: Check that decides; empty if the case could not run.
        steps: Number of engine steps.
        engine_seconds: Processor time of the engine's stepping.
        reference_seconds: Processor time of the reference motion; 0 if an earlier case computed it.
        loading_seconds: Processor time for copying and loading the model file.
        seconds: Total processor time.
        command: Command that runs this case alone.
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
    kind: CaseKind = ""
    code: str = ""
    discrepancy: Number = None
    uncertainty: Number = None
    resolution: Number = None
    digits: Number = None
    global_error: Number = None
    order: Number = None
    decided_by: DecidedBy | Literal[""] = ""
    steps: int = 0
    engine_seconds: float = 0.0
    reference_seconds: float = 0.0
    loading_seconds: float = 0.0
    seconds: float = 0.0
    command: str = ""

    def __post_init__(self) -> None:
        msgspec.structs.force_setattr(self, "code", case_code(self.outcome, self.kind))

    @property
    def name(self) -> str:
        """Name of the case, without its constants."""
        return f"{self.system}/{self.model} [{self.engine}] {self.scenario}"


class SweepPlan(Record, frozen=True, kw_only=True):
    """The inputs of a sweep. Equal plans give equal rows.

    Attributes:
        command: Command of the sweep, without `--only`.
        options: All options, by name.
        folders: Hash of the content of each system folder.
        versions: Versions of this package, Python, engines and libraries.
        cases: Number of cases.
        constants: Names of the varied constants.
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
        system: Name of the system.
        engine: Name of the engine.
        integrator: Name of the integrator.
        outcomes: Number of cases by outcome.
        least_digits: Fewest agreeing digits among the cases that agree.
        worst_error: Largest global error among the cases that ran.
    """

    system: str
    engine: str
    integrator: str
    outcomes: dict[str, int]
    least_digits: Number = None
    worst_error: Number = None


class SweepSummary(Record, frozen=True, kw_only=True):
    """Summary of a sweep.

    Attributes:
        plan: Plan of the sweep.
        done: Number of rows.
        outcomes: Number of cases by outcome, worst first.
        digits: Number of agreeing cases by whole digits.
        groups: Cases by system, engine and integrator.
        worst: Worst cases.
        sampled: Evenly sampled rows for plots.
        steps: Number of engine steps.
        engine_seconds: Processor time of the engines' stepping.
        reference_seconds: Processor time of the reference motions.
        loading_seconds: Processor time for copying and loading model files.
        seconds: Total processor time.
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
