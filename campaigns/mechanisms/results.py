"""Results of mechanisms: a record each, and tables of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from enum import StrEnum

import msgspec
import numpy as np

from physics_crosscheck.harness.records.outcome import Outcome


class Detection(StrEnum):
    """The detection of a planted fault."""

    MOTION = "detected by a joint's motion"
    FRAMES = "detected by poses of bodies alone"
    FAINT = "invisible: no motion changes, poses change below their resolution"
    INVISIBLE = "invisible: no motion and no pose changes"
    BELOW = "below the uncertainty of the limits"
    MISSED = "MISSED"
    FALSE = "FALSE ALARM"


class MechanismFault(msgspec.Struct, frozen=True, kw_only=True):
    """A fault in one number of a file.

    Attributes:
        where: path of the number, with dots.
        share: size of the fault relative to the number.
        fate: whether and how it is detected.
        effect: largest relative change of a segment's end; 0 below the error of the equations.
        excess: largest change of a segment's end over its uncertainty.
        pose: largest change of a body's position over the largest distance, or of its rotation.
        outside: number of limits whose error by the faulty equations exceeds their uncertainty.
    """

    where: str
    share: float
    fate: Detection
    effect: float
    excess: float
    pose: float
    outside: int

    @property
    def wrong(self) -> bool:
        """True for a missed fault, a false alarm, or a limit outside its uncertainty."""
        return self.fate in (Detection.MISSED, Detection.FALSE) or self.outside > 0


class MechanismResult(msgspec.Struct, frozen=True, kw_only=True):
    """The judgement of a mechanism.

    Attributes:
        index: of the mechanism under the seed.
        group: engine, integrator and format.
        joints: number of joints.
        outcome: of the verdict; FAILED after an exception.
        discrepancy, uncertainty: E and U of the verdict.
        worst: largest error of a limit over its uncertainty.
        limits, outside: number of limits, and of those whose error exceeds their uncertainty.
        explained: digits that the engine loses, if they explain everything outside; else empty.
        truth: largest error bound of the reference ends over the uncertainty of the limits.
        seconds: processor time.
        reason: of an outcome other than AGREES.
        faults: the planted faults with their results.
    """

    index: int
    group: str
    joints: int
    outcome: str
    discrepancy: float = 0.0
    uncertainty: float = 0.0
    worst: float = 0.0
    limits: int = 0
    outside: int = 0
    explained: str = ""
    truth: float = 0.0
    seconds: float = 0.0
    reason: str = ""
    faults: tuple[MechanismFault, ...] = ()

    @property
    def unresolved(self) -> bool:
        """True for the outcome UNRESOLVED, which is neither right nor wrong."""
        return self.outcome == Outcome.UNRESOLVED

    @property
    def wrong(self) -> bool:
        """True for an unexplained wrong outcome or limit, or a wrongly judged fault."""
        is_right = self.outcome in (Outcome.AGREES, Outcome.UNRESOLVED) and not self.outside
        return not (is_right or self.explained) or any(fault.wrong for fault in self.faults)


UNRESOLVED_SHARE = 0.01
"""Largest accepted share of unresolved mechanisms."""


def all_correct(results: Sequence[MechanismResult]) -> bool:
    """Return whether no verdict and no limit is wrong, and few mechanisms are unresolved."""
    unresolved = sum(result.unresolved for result in results)
    return not any(result.wrong for result in results) and unresolved <= UNRESOLVED_SHARE * len(
        results
    )


def json_line(result: MechanismResult) -> bytes:
    """Return a result as a line of JSON."""
    return msgspec.json.encode(result) + b"\n"


def problem_lines(result: MechanismResult, command: str) -> list[str]:
    """Return what is wrong with a mechanism, and the command that runs it again."""
    lines = [
        f"{result.group}, {result.joints} joints: {result.outcome}, E {result.discrepancy:.1e},"
        f" U {result.uncertainty:.1e}, {result.outside} of {result.limits} limits outside,"
        f" worst {result.worst:.2g} U {result.reason}".rstrip()
    ]
    lines += [
        f"    {f.where} off by {f.share:.0e}: {f.fate}; effect {f.effect:.1e}, {f.excess:.1e} U;"
        f" pose {f.pose:.1e}; {f.outside} limits outside"
        for f in result.faults
        if f.wrong
    ]
    return [*lines, f"    {command}"]


def table(results: Sequence[MechanismResult]) -> list[str]:
    """Return a table with a row per group and a row for all, then notes."""
    groups = sorted({result.group for result in results})
    head = (
        "", "number", "AGREES", "UNRESOLVED", "explained", "wrong", "limits", "outside", "worst",
        "E", "U",
    )  # fmt: skip
    rows: list[tuple[str, ...]] = [head]
    rows += [_row(g, [r for r in results if r.group == g]) for g in groups]
    rows.append(_row("all", results))
    widths = [max(len(row[i]) for row in rows) for i in range(len(head))]
    lines = [
        "  ".join(
            cell.ljust(width) if i == 0 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    ]
    seconds = [result.seconds for result in results]
    return [
        *lines,
        "worst: largest error of a limit over its uncertainty; E and U: medians",
        f"processor time: {sum(seconds):.0f} s, median {np.median(seconds):.2f} s per mechanism,"
        f" maximum {max(seconds):.1f} s",
    ]


def _row(name: str, results: Sequence[MechanismResult]) -> tuple[str, ...]:
    unexplained = [r for r in results if not r.explained]
    return (
        name,
        str(len(results)),
        str(sum(r.outcome == Outcome.AGREES for r in results)),
        str(sum(r.unresolved for r in results)),
        str(sum(bool(r.explained) for r in results)),
        str(sum(r.wrong for r in results)),
        str(sum(r.limits for r in unexplained)),
        str(sum(r.outside for r in unexplained)),
        f"{max((r.worst for r in unexplained), default=0.0):.2f}",
        f"{np.median([r.discrepancy for r in results]):.1e}",
        f"{np.median([r.uncertainty for r in results]):.1e}",
    )


def detection_lines(faults: Iterable[MechanismFault]) -> list[str]:
    """Return the number of faults by size and detection, with the largest undetected effects."""
    every = list(faults)
    lines = []
    for share in sorted({f.share for f in every}, reverse=True):
        same_size = [f for f in every if f.share == share]
        lines.append(f"{len(same_size)} faults of {share:.0e}")
        for fate in Detection:
            group = [f for f in same_size if f.fate is fate]
            if group or fate is Detection.MISSED:
                lines.append(f"  {len(group):6d} {fate}{_largest_effects(fate, group)}")
    return lines


def _largest_effects(fate: Detection, group: Sequence[MechanismFault]) -> str:
    if fate is Detection.INVISIBLE:
        effect, pose = max(f.effect for f in group), max(f.pose for f in group)
        return f"; largest effect {effect:.0e} relative to the movement, pose {pose:.0e}"
    if fate is Detection.BELOW:
        return f"; largest effect {max(f.excess for f in group):.2g} U"
    if fate is Detection.FRAMES:
        return f"; smallest change of a pose {min(f.pose for f in group):.0e}"
    if fate is Detection.FAINT:
        return f"; largest change of a pose {max(f.pose for f in group):.0e}"
    return ""
