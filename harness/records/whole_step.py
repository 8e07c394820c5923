"""Steps of an engine with all its forces, compared with its documented law."""

from __future__ import annotations

from physics_crosscheck.harness.records.base import Count, Number, Record
from physics_crosscheck.harness.records.outcome import Outcome


class LawTerm(Record, frozen=True, kw_only=True):
    """Forces of one kind that acted at the compared states.

    Attributes:
        name: Kind of the forces, such as `contacts`.
        count: Number of times that they acted.
    """

    name: str
    count: Count


class WholeStep(Record, frozen=True, kw_only=True):
    """The engine's steps with limits, friction, contacts and drives, compared with their law.

    Attributes:
        outcome: AGREES, DIFFERS, or UNRESOLVED; None if nothing was compared.
        discrepancy: Discrepancy of `component`, relative to its largest value.
        uncertainty: Uncertainty of `discrepancy`: rounding, and the bound of the solver's error.
        component: The deciding component, such as `elbow_ddot`.
        states: Number of compared states.
        step: Time step, seconds.
        next_state: Whether the next state was compared too, beyond accelerations.
        acted: Forces that acted at these states.
        edits: Options of the file that were changed, as `name=value`.
        covered: Parts of the file that only this check compares, with their counts.
        uncovered: Features without a law here; if any act on the bodies, nothing was compared.
    """

    outcome: Outcome | None = None
    discrepancy: Number = None
    uncertainty: Number = None
    component: str = ""
    states: Count = 0
    step: Number = None
    next_state: bool = False
    acted: tuple[LawTerm, ...] = ()
    edits: tuple[str, ...] = ()
    covered: tuple[str, ...] = ()
    uncovered: tuple[str, ...] = ()
