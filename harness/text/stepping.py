"""What is said of engines' next states: one step at the step that a model ships with."""

from __future__ import annotations

from collections.abc import Iterable

from physics_crosscheck.harness.records.case import Case, Stepping
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.text.status import counted


def stepping_lines(cases: Iterable[Case]) -> list[str]:
    """One line for all that step as they say, then one for each model that does not.

    What differs as its step goes to zero is told by that; its step can be no other.
    """
    known = [(case, case.stepping) for case in cases if case.stepping is not None]
    alike = [(case, one) for case, one in known if one.outcome is Outcome.AGREES]
    lines = [_alike(alike)] if alike else []
    seen = set()
    for case, one in known:
        model = case.id.of_model
        if one.outcome is Outcome.AGREES or case.outcome is Outcome.DIFFERS or model in seen:
            continue
        seen.add(model)
        lines.append(f"The next state of {model} {_apart(one)}")
    return lines


def _alike(cases: list[tuple[Case, Stepping]]) -> str:
    worst, one = max(cases, key=lambda entry: entry[1].discrepancy or 0.0)
    return (
        f"The engines' next states at the shipped step, in {counted(len(cases), 'case')}, are"
        f" the equations' by the engines' own rules to {one.discrepancy or 0.0:.1e} of a step's"
        f" movement (worst: {worst.id})."
    )


def _apart(one: Stepping) -> str:
    if one.outcome is Outcome.UNRESOLVED:
        return f"can't be told from {one.rule}: the uncertainty is {one.uncertainty or 0.0:.1e}."
    why = f"; besides act {one.besides}" if one.besides else (
        "; it has another integrator than it says, or something acts at this step alone"
    )  # fmt: skip
    far = "without end" if one.discrepancy is None else f"{one.discrepancy:.1e}"
    return (
        f"is not that of {one.rule} at {one.step:g} s: {one.component} is {far} of its movement"
        f" off, where {one.uncertainty or 0.0:.1e} is uncertain{why}."
    )
