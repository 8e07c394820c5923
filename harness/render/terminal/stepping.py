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
    steppings = [(case, case.stepping) for case in cases if case.stepping is not None]
    alike = [(case, stepping) for case, stepping in steppings if stepping.outcome is Outcome.AGREES]
    lines = [_alike(alike)] if alike else []
    seen = set()
    for case, stepping in steppings:
        model = case.id.of_model
        if stepping.outcome is Outcome.AGREES or case.outcome is Outcome.DIFFERS or model in seen:
            continue
        seen.add(model)
        lines.append(f"single step of {model} {_apart(stepping)}")
    return lines


def _alike(cases: list[tuple[Case, Stepping]]) -> str:
    worst, stepping = max(cases, key=lambda entry: entry[1].discrepancy or 0.0)
    verb = "follows" if len(cases) == 1 else "follow"
    return (
        f"single step of {counted(len(cases), 'case')} {verb} the engine's own rule to"
        f" {stepping.discrepancy or 0.0:.1e} of how far it moves (worst: {worst.id})"
    )


def _apart(stepping: Stepping) -> str:
    if stepping.outcome is Outcome.UNRESOLVED:
        return (
            f"is too uncertain to compare with {stepping.rule} ({stepping.uncertainty or 0.0:.1e})"
        )
    why = f"; also acting: {stepping.besides}" if stepping.besides else (
        "; the integrator differs, or something acts at this step only"
    )  # fmt: skip
    off = "without bound" if stepping.discrepancy is None else f"by {stepping.discrepancy:.1e}"
    return (
        f"deviates from {stepping.rule} at {stepping.step:g} s: {stepping.component} {off}"
        f" of how far it moves (uncertainty {stepping.uncertainty or 0.0:.1e}){why}"
    )
