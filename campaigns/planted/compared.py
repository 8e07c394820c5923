"""Judgement of faults by `crosscheck compare OLD NEW`: a robot file and its changed copy."""

from __future__ import annotations

from pathlib import Path

from campaigns.planted.fates import RESOLUTION, FaultBaseline, FaultFate, RobotFault, judge_fault
from physics_crosscheck.harness.commands.compare.candidate import (
    CompareError,
    FailureError,
    candidate,
)
from physics_crosscheck.harness.commands.compare.compare import CompareOptions, compare
from physics_crosscheck.harness.documents.elements import Number
from physics_crosscheck.harness.jobs.executor import InThisProcess
from physics_crosscheck.harness.records.comparison import Compared
from physics_crosscheck.harness.records.outcome import Outcome

MIN_EXPLAINED_SHARE = 0.99
"""Smallest share of a resolved discrepancy that the named difference must explain."""


def judge_by_compare(baseline: FaultBaseline, index: int, share: float) -> RobotFault:
    """Change a number by a share of its size, and judge the comparison of both files."""
    old, engine = baseline.prepared.place, baseline.engine
    return judge_fault(baseline, index, share, lambda new, n, *_: _fate(engine, old, new, n))


def _fate(engine: str, old: Path, new: Path, number: Number) -> tuple[FaultFate, str]:
    a, b = candidate("A", old, engine), candidate("B", new, engine)
    try:
        comparison = compare(CompareOptions(a=a, b=b, resolution=RESOLUTION), InThisProcess())
    except (FailureError, CompareError) as error:
        return FaultFate.REFUSED, str(error)
    compared = comparison.compared
    assert compared is not None
    discrepancy, uncertainty = compared.discrepancy or 0.0, compared.uncertainty or 0.0
    explanation = f"{comparison.outcome} {discrepancy:.1e}, {_first_difference(compared)}"
    if comparison.outcome is not Outcome.DIFFERS:
        # The comparison runs other motions than the equations: the effect may be small in them.
        small = discrepancy <= RESOLUTION + 2 * uncertainty
        return (FaultFate.FAINT if small else FaultFate.MISSED), explanation
    return (FaultFate.NAMED if _names(compared, number) else FaultFate.CAUGHT), explanation


def _names(compared: Compared, number: Number) -> bool:
    """Return whether the first difference is the number's line and explains the discrepancy."""
    if not compared.differences:
        return False
    first = compared.differences[0]
    resolved = (compared.discrepancy or 0.0) > 100 * (compared.uncertainty or 0.0)
    lines = {edit.where_b.line for edit in first.edits}
    return lines == {number.line} and (
        (first.explained or 0) >= MIN_EXPLAINED_SHARE or not resolved
    )


def _first_difference(compared: Compared) -> str:
    """Return the first difference of the files and the first property, as a text."""
    first = [
        f"{one.edits[0].what} line {one.edits[0].where_b.line} explains {one.explained:.2%}"
        for one in compared.differences[:1]
    ]
    return "; ".join([*first, *(one.message for one in compared.properties[:1])])
