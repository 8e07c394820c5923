"""What became of mechanisms: records of a line each, and the tables made of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from enum import StrEnum

import msgspec
import numpy as np

from physics_crosscheck.harness.records.outcome import Outcome


class Fate(StrEnum):
    """What became of a planted fault."""

    MOTION = "caught by a joint's motion"
    FRAMES = "caught by frames alone: the engine poses a body elsewhere"
    FAINT = "a pose is another by less than frames resolve, and no motion is"
    INVISIBLE = "invisible: no motion and no pose is another"
    BELOW = "below the uncertainty: its effect is smaller than what is claimed"
    MISSED = "MISSED"
    FALSE = "TOLD WHERE THERE IS NOTHING"


class Planted(msgspec.Struct, frozen=True, kw_only=True):
    """A fault in one number of a file.

    Attributes:
        where: which number.
        share: by which share of itself it is off.
        effect: largest change of a segment's end, by what counts as one; 0 where none is known.
        excess: the same by the uncertainty of that end.
        pose: largest change of a body's place, by the largest distance of any, or turn.
        outside: limits outside their uncertainty about what the faulty file must do.
    """

    where: str
    share: float
    fate: Fate
    effect: float
    excess: float
    pose: float
    outside: int

    @property
    def wrong(self) -> bool:
        return self.fate in (Fate.MISSED, Fate.FALSE) or self.outside > 0


class Result(msgspec.Struct, frozen=True, kw_only=True):
    """What became of a mechanism.

    Attributes:
        index: its number under the seed.
        group: how it was stepped.
        outcome: of the harness; "no mechanism" where none could be posed.
        discrepancy, uncertainty: E and U of the verdict.
        worst: largest error of a limit by its uncertainty.
        limits, outside: how many there were, and how many with an error above it.
        explained: why what would be wrong is the engine's own.
        truth: error of what the limits are compared with, at most, by their uncertainty.
        seconds: processor time of all of it.
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
    faults: tuple[Planted, ...] = ()

    @property
    def unresolved(self) -> bool:
        """Nothing is claimed: no wrong verdict, and none that is wanted."""
        return self.outcome == Outcome.UNRESOLVED

    @property
    def wrong(self) -> bool:
        claimed = self.outcome in (Outcome.AGREES, Outcome.UNRESOLVED) and not self.outside
        return not (claimed or self.explained) or any(fault.wrong for fault in self.faults)


SOME = 0.01
"""Share of the mechanisms that may be left unresolved."""


def all_right(results: Sequence[Result]) -> bool:
    """Whether no verdict and no limit is wrong, and few are left open."""
    unresolved = sum(result.unresolved for result in results)
    return not any(result.wrong for result in results) and unresolved <= SOME * len(results)


def line(result: Result) -> bytes:
    """As JSON, in a line."""
    return msgspec.json.encode(result) + b"\n"


def offender(result: Result, command: str) -> list[str]:
    """What is wrong with it, and the command that shows it again."""
    told = [
        f"{result.group}, {result.joints} joints: {result.outcome}, E {result.discrepancy:.1e},"
        f" U {result.uncertainty:.1e}, {result.outside} of {result.limits} limits outside, by"
        f" {result.worst:.2g} U at most {result.reason}".rstrip()
    ]
    told += [
        f"    {f.where} off by {f.share:.0e}: {f.fate}; effect {f.effect:.1e}, {f.excess:.1e} U;"
        f" pose {f.pose:.1e}; {f.outside} limits outside"
        for f in result.faults
        if f.wrong
    ]
    return [*told, f"    {command}"]


def table(results: Sequence[Result]) -> list[str]:
    """A line a group, and one of all."""
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
        "worst: error of a limit by its uncertainty; E and U: medians",
        f"{sum(seconds):.0f} s of processor time, {np.median(seconds):.2f} s a mechanism in the"
        f" median, {max(seconds):.1f} s at most",
    ]


def _row(name: str, results: Sequence[Result]) -> tuple[str, ...]:
    free = [r for r in results if not r.explained]
    return (
        name,
        str(len(results)),
        str(sum(r.outcome == Outcome.AGREES for r in results)),
        str(sum(r.unresolved for r in results)),
        str(sum(bool(r.explained) for r in results)),
        str(sum(r.wrong for r in results)),
        str(sum(r.limits for r in free)),
        str(sum(r.outside for r in free)),
        f"{max((r.worst for r in free), default=0.0):.2f}",
        f"{np.median([r.discrepancy for r in results]):.1e}",
        f"{np.median([r.uncertainty for r in results]):.1e}",
    )


def fates(planted: Iterable[Planted]) -> list[str]:
    """How many faults of each size met which fate, and what is known of those not told."""
    every = list(planted)
    told = []
    for share in sorted({f.share for f in every}, reverse=True):
        own = [f for f in every if f.share == share]
        told.append(f"{len(own)} faults of {share:.0e}")
        for fate in Fate:
            met = [f for f in own if f.fate is fate]
            if met or fate is Fate.MISSED:
                told.append(f"  {len(met):6d} {fate}{_known(fate, met)}")
    return told


def _known(fate: Fate, met: Sequence[Planted]) -> str:
    if fate is Fate.INVISIBLE:
        effect, pose = max(f.effect for f in met), max(f.pose for f in met)
        return f"; largest effect {effect:.0e} of a segment's movement, pose {pose:.0e}"
    if fate is Fate.BELOW:
        return f"; largest effect {max(f.excess for f in met):.2g} U"
    if fate is Fate.FRAMES:
        return f"; smallest change of a pose {min(f.pose for f in met):.0e}"
    if fate is Fate.FAINT:
        return f"; largest change of a pose {max(f.pose for f in met):.0e}"
    return ""
