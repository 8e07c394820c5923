"""Print engines' accelerations without a step, compared with the equations."""

from __future__ import annotations

from collections.abc import Iterable

from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.results.status import counted


def dynamics_lines(cases: Iterable[Case]) -> list[str]:
    """Return one line for all that agree; a case that differs reports it as its reason."""
    alike = [
        (one.forward_dynamics, one)
        for one in cases
        if one.forward_dynamics is not None and one.forward_dynamics.outcome is Outcome.AGREES
    ]
    if not alike:
        return []
    largest, worst = max(alike, key=lambda entry: entry[0].discrepancy or 0.0)
    states = sum(one.states for one, _ in alike)
    return [
        f"accelerations of {counted(len(alike), 'case')} at {counted(states, 'state')} agree to"
        f" {largest.discrepancy or 0.0:.1e} of the largest (worst: {worst.id})"
    ]
