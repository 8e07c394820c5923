"""Difference between two results: accepted and present, or two versions of an engine."""

import math
from enum import StrEnum
from typing import Literal, get_args

import msgspec

from .base import Number, Record
from .case import Case, CaseId
from .codes import gate_code
from .outcome import Outcome

Changed = Literal[
    "verdict", "limit", "equations", "steps", "scenario", "discrepancy", "error at dt", "order",
    "integrator", "dt", "audit",
]  # fmt: skip
"""Quantity of a case that changed, the worst first."""

WORST_FIRST: tuple[Changed, ...] = get_args(Changed)


class Status(StrEnum):
    """Status of a case in a comparison of results, worst first; the value is what is printed."""

    NOT_RUN = "could not run"
    CHANGED = "changed"
    GONE = "gone"
    NEW = "new"
    IMPROVED = "improved"
    WITHIN = "no change in motion"
    EXPECTED = "known difference"
    SAME = "as accepted"

    @property
    def passes(self) -> bool:
        """Return whether the gate passes such a case."""
        return self not in (Status.NOT_RUN, Status.CHANGED, Status.GONE, Status.NEW)


class CaseNumbers(Record, frozen=True, kw_only=True):
    """Numbers of a case that two results are compared by.

    Attributes:
        outcome: Outcome of the case.
        reason: Explanation of the outcome.
        discrepancy: Discrepancy E of `component`.
        uncertainty: Uncertainty U of `component`.
        component: Deciding component of the verdict; empty if unknown.
        digits: Agreeing digits in every component; None if unknown.
        global_error: Largest position error at `time_step`, relative to the amplitude.
        order: Observed order of the error on the segments.
        claimed_order: Order that the engine claims; 0 if unknown.
        integrator: Name of the integrator.
        time_step: Time step of the model, seconds.
    """

    outcome: Outcome
    reason: str = ""
    discrepancy: Number = None
    uncertainty: Number = None
    component: str = ""
    digits: Number = None
    global_error: Number = None
    order: Number = None
    claimed_order: int = 0
    integrator: str = ""
    time_step: Number = None


class Diff(Record, frozen=True, kw_only=True):
    """One case in an earlier and in a later result.

    Attributes:
        system: Name of the system; of an accepted robot file, its path.
        model: Name of the model file.
        scenario: Name of the scenario.
        engine: Name of the engine.
        folder: System folder, or the robot file; empty if results of other folders are compared.
        status: Status of the case.
        kinds: Reasons for the change, such as `model`, `numbers`, `engine`, `equations`; empty if
            unknown.
        changed: What changed, worst first.
        messages: Explanations, most important first.
        before: Numbers in the earlier result; None if it lacks the case.
        after: Numbers in the later result; None if it lacks the case.
        moved: Largest change of the extrapolated motion, relative; None if it was not compared.
        uncertainty: Combined uncertainty of `moved`.
        run: Whether the case ran; unchanged cases do not.
        code: Message code of the status and of the first reason; empty if accepted.
    """

    system: str
    model: str
    scenario: str
    engine: str
    folder: str = ""
    status: Status
    kinds: tuple[str, ...] = ()
    changed: tuple[Changed, ...] = ()
    messages: tuple[str, ...] = ()
    before: CaseNumbers | None = None
    after: CaseNumbers | None = None
    moved: Number = None
    uncertainty: Number = None
    run: bool = True
    code: str = ""

    def __post_init__(self) -> None:
        # An unchanged file needs no table of codes.
        code = "" if self.status is Status.SAME else gate_code(self.status, self.kinds)
        msgspec.structs.force_setattr(self, "code", code)

    @property
    def id(self) -> CaseId:
        """Name of the case."""
        return CaseId(
            system=self.system, model=self.model, scenario=self.scenario, engine=self.engine
        )

    @property
    def outcomes(self) -> tuple[Outcome | None, Outcome | None]:
        """Outcome in each result; None if it lacks the case."""
        then, now = (None if one is None else one.outcome for one in (self.before, self.after))
        return then, now

    @property
    def is_change(self) -> bool:
        """True if something changed."""
        is_compared = self.status is not Status.NOT_RUN
        return is_compared and bool(self.changed or self.status in (Status.GONE, Status.NEW))

    @property
    def label(self) -> str:
        """The status, and whether the case is worse."""
        is_marked = self.status is Status.CHANGED and self.is_worse
        return f"{self.status}, worse" if is_marked else self.status.value

    @property
    def is_worse(self) -> bool:
        """True if the verdict is worse, or the error at dt is larger."""
        if self.before is None or self.after is None:
            return False
        then, now = self.before, self.after
        if then.outcome is not now.outcome:
            return now.outcome.severity > then.outcome.severity
        error = math.inf if now.global_error is None else now.global_error
        return "error at dt" in self.changed and error > (then.global_error or 0.0)

    @property
    def size(self) -> float:
        """Change of the extrapolated motion beyond its uncertainty; 0 without one."""
        return (self.moved or 0.0) if {"limit", "equations"}.intersection(self.changed) else 0.0


def bare_diff(
    id_: CaseId,
    status: Status,
    messages: tuple[str, ...] = (),
    *,
    before: CaseNumbers | None = None,
    after: CaseNumbers | None = None,
) -> Diff:
    """Return the difference of a case that is not compared by its numbers."""
    names = msgspec.structs.asdict(id_)
    ran = after is not None
    return Diff(**names, status=status, messages=messages, before=before, after=after, run=ran)


def numbers_of(case: Case) -> CaseNumbers:
    """Return the numbers that a case is compared by."""
    verdict, full_run = case.verdict, case.full_run
    return CaseNumbers(
        outcome=case.outcome,
        reason=case.reason,
        discrepancy=verdict.discrepancy if verdict else None,
        uncertainty=verdict.uncertainty if verdict else None,
        component=verdict.component if verdict else "",
        digits=case.digits,
        global_error=full_run.global_error if full_run else None,
        order=verdict.order if verdict else None,
        claimed_order=verdict.claimed_order if verdict else 0,
        integrator=full_run.integrator if full_run else "",
        time_step=full_run.time_step if full_run else None,
    )
