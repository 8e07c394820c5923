"""Print single steps of engines at the model's time step, compared with their own rule."""

from __future__ import annotations

from collections.abc import Iterable

from physics_crosscheck.harness.records.case import Case, Stepping
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.results.status import counted


def stepping_lines(cases: Iterable[Case]) -> list[str]:
    """Return one line for all steps that follow their rule, then one per model that does not.

    A case that differs in the limit of small steps is omitted: its single step differs too.
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
        lines.append(f"single step of {model} {_apart(one)}")
    return lines


def _alike(cases: list[tuple[Case, Stepping]]) -> str:
    worst, one = max(cases, key=lambda entry: entry[1].discrepancy or 0.0)
    verb = "follows" if len(cases) == 1 else "follow"
    return (
        f"single step of {counted(len(cases), 'case')} {verb} the engine's own rule to"
        f" {one.discrepancy or 0.0:.1e} of how far it moves (worst: {worst.id})"
    )


def _apart(one: Stepping) -> str:
    if one.outcome is Outcome.UNRESOLVED:
        return f"is too uncertain to compare with {one.rule} ({one.uncertainty or 0.0:.1e})"
    why = f"; also acting: {one.besides}" if one.besides else (
        "; the integrator differs, or something acts at this step only"
    )  # fmt: skip
    off = "without bound" if one.discrepancy is None else f"by {one.discrepancy:.1e}"
    return (
        f"deviates from {one.rule} at {one.step:g} s: {one.component} {off} of how far it moves"
        f" (uncertainty {one.uncertainty or 0.0:.1e}){why}"
    )
