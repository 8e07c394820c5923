"""How far the ends of accepted segments are from where they were, beyond what is uncertain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from physics_crosscheck.harness.records.base import Number, Numbers, Rows
from physics_crosscheck.harness.records.baseline import AcceptedCase, OnAccepted, Snapshot
from physics_crosscheck.harness.records.case import starts_at

EQUATIONS = 1e-11
"""Relative movement of a segment's end, by the equations, that is none: ten times what the two
integrations of a reference may be apart."""

ROUNDING = 1e-15


class Sized(Protocol):
    """What has a discrepancy and an uncertainty: a verdict, and what was accepted of one."""

    @property
    def discrepancy(self) -> Number:
        """Relative."""

    @property
    def uncertainty(self) -> Number:
        """Relative."""


@dataclass(frozen=True, kw_only=True)
class Movement:
    """How far segments' ends are apart, beyond the uncertainties; all zero where they are not.

    Attributes:
        size, uncertainty: relative to the component's movement over a segment.
        component: the one with the largest.
        place: where the segment starts: a time, or which of the states.
    """

    size: float = 0.0
    uncertainty: float = 0.0
    component: str = ""
    place: str = ""

    def __bool__(self) -> bool:
        return self.size > 0.0

    def __str__(self) -> str:
        return (
            f"{self.size:.1e} ± {self.uncertainty:.0e} of its displacement, in "
            f"{self.component} near {self.place}"
        )


def of_model(entry: AcceptedCase, snapshot: Snapshot, now: OnAccepted) -> Movement:
    """How far the model moved since it was accepted."""
    was = _Ends(entry.end, entry.end_uncertainty)
    return _movement(was, _Ends(now.end, now.uncertainty), snapshot)


def apart(entry: AcceptedCase, snapshot: Snapshot, now: OnAccepted) -> Movement:
    """How far the model's ends are from the accepted ones at most, be it within what is known."""
    was = _Ends(entry.end, entry.end_uncertainty)
    return _movement(was, _Ends(now.end, now.uncertainty), snapshot, beyond=False)


def of_equations(snapshot: Snapshot, now: OnAccepted) -> Movement:
    """How far the equations moved since then."""
    nothing = (tuple(EQUATIONS * s for s in snapshot.scale),) * len(snapshot.end)
    return _movement(_Ends(snapshot.end, nothing), _Ends(now.equations, nothing), snapshot)


@dataclass(frozen=True)
class _Ends:
    """Where segments end, and how uncertain that is, (K, 2n) each."""

    value: Sequence[Numbers]
    uncertainty: Rows


def _movement(was: _Ends, now: _Ends, snapshot: Snapshot, *, beyond: bool = True) -> Movement:
    """The largest movement of an end that exceeds both uncertainties, relative to its scale.

    `beyond` False: the largest at all, with the largest of the uncertainties.
    """
    worst = Movement()
    rows = zip(was.value, was.uncertainty, now.value, now.uncertainty, snapshot.t, strict=True)
    for segment, (*ends, time) in enumerate(rows):
        columns = zip(*ends, snapshot.scale, snapshot.components, strict=True)
        for a, ua, b, ub, scale, component in columns:
            if a is None or b is None or ua is None or ub is None:
                continue
            allowed = ua + ub + ROUNDING * (abs(a) + abs(b))
            size = abs(b - a) / scale
            if beyond and abs(b - a) <= allowed:
                continue
            bound = allowed / scale if beyond else max(worst.uncertainty, allowed / scale)
            if size > worst.size:
                place = starts_at(time, segment)
                worst = Movement(size=size, uncertainty=bound, component=component, place=place)
            elif not beyond:
                worst = replace(worst, uncertainty=bound)
    return worst


def discrepancy_moved(was: Sized, now: Sized) -> bool:
    """Whether a discrepancy is another one, beyond both uncertainties."""
    bounds = was.uncertainty, now.uncertainty
    if None in bounds:
        # No digit is claimed of a case whose uncertainty is infinite, before and after alike.
        return bounds != (None, None)
    a, b, ua, ub = was.discrepancy, now.discrepancy, *bounds
    if a is None or b is None or ua is None or ub is None:
        return False
    return abs(a - b) > ua + ub + ROUNDING


def in_words(sized: Sized) -> str:
    """A discrepancy with its uncertainty, either of which may have no finite value."""
    size, bound = sized.discrepancy, sized.uncertainty
    return " ± ".join("unknown" if x is None else f"{x:.3e}" for x in (size, bound))
