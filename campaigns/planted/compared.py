"""`crosscheck compare OLD NEW` of a robot's file and a copy of it with one number changed."""

from __future__ import annotations

from pathlib import Path

from campaigns.planted.fates import (
    RESOLUTION,
    Fate,
    Ground,
    Planted,
    planted,
)
from physics_crosscheck.harness.commands.compare.candidate import CompareError, candidate
from physics_crosscheck.harness.commands.compare.compare import CompareOptions, compare
from physics_crosscheck.harness.commands.compare.execute import FailureError
from physics_crosscheck.harness.jobs.executor import InThisProcess
from physics_crosscheck.harness.modelfiles.numbers import Number
from physics_crosscheck.harness.records.comparison import Compared
from physics_crosscheck.harness.records.outcome import Outcome

MOST = 0.99
"""Share of the discrepancy that the difference which is named must explain where it is resolved."""


def compared(ground: Ground, index: int, share: float) -> Planted:
    """One changed number, and what the comparison says of it."""
    old = ground.prepared.place
    return planted(ground, index, share, lambda new, one, *_: _fate(ground.engine, old, new, one))


def _fate(engine: str, old: Path, new: Path, one: Number) -> tuple[Fate, str]:
    a, b = candidate("A", old, engine), candidate("B", new, engine)
    try:
        comparison = compare(CompareOptions(a=a, b=b, resolution=RESOLUTION), InThisProcess())
    except (FailureError, CompareError) as error:
        return Fate.REFUSED, str(error)
    found = comparison.compared
    assert found is not None
    discrepancy, uncertainty = found.discrepancy or 0.0, found.uncertainty or 0.0
    said = f"{comparison.outcome} {discrepancy:.1e}, {_told(found)}"
    if comparison.outcome is not Outcome.DIFFERS:
        # What the comparison's own runs show of it: they are others than those of the equations.
        small = discrepancy <= RESOLUTION + 2 * uncertainty
        return (Fate.FAINT if small else Fate.MISSED), said
    return (Fate.NAMED if _names(found, one) else Fate.CAUGHT), said


def _names(found: Compared, one: Number) -> bool:
    """Whether the line is that of the first difference, and that makes up the discrepancy."""
    if not found.differences:
        return False
    first = found.differences[0]
    resolved = (found.discrepancy or 0.0) > 100 * (found.uncertainty or 0.0)
    lines = {edit.where_b.line for edit in first.edits}
    return lines == {one.line} and ((first.explained or 0) >= MOST or not resolved)


def _told(found: Compared) -> str:
    """The first difference of the files, and the first property."""
    first = [
        f"{one.edits[0].what} line {one.edits[0].where_b.line} explains {one.explained:.2%}"
        for one in found.differences[:1]
    ]
    return "; ".join([*first, *(one.message for one in found.properties[:1])])
