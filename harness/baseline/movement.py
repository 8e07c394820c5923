"""Changes of the ends of accepted segments that exceed their uncertainties."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from physics_crosscheck.harness.records.base import Number, Numbers, Rows
from physics_crosscheck.harness.records.baseline import AcceptedCase, OnAccepted, Snapshot
from physics_crosscheck.harness.records.case import starts_at
from physics_crosscheck.harness.results.status import percent

EQUATIONS = 1e-11
"""Relative movement of a segment's end, by the equations, below which it is unchanged: ten times
the tolerated difference of the two integrations of a reference.
"""

ROUNDING = 1e-15


class Sized(Protocol):
    """A discrepancy with its uncertainty, as in a verdict or an accepted case."""

    @property
    def discrepancy(self) -> Number:
        """Relative discrepancy."""

    @property
    def uncertainty(self) -> Number:
        """Relative uncertainty."""


@dataclass(frozen=True, kw_only=True)
class Movement:
    """The largest change of a segment's end; all zero if uncertainties cover it.

    Attributes:
        size, uncertainty: relative to the component's movement over a segment.
        component: component with the largest change.
        place: start of the segment: a time, or the number of the state.
    """

    size: float = 0.0
    uncertainty: float = 0.0
    component: str = ""
    place: str = ""

    def __bool__(self) -> bool:
        return self.size > 0.0

    def __str__(self) -> str:
        size = percent(self.size)
        if "%" not in size:  # close to rounding
            size += f" ± {self.uncertainty:.0e}"
        return f"{size} of its displacement, in {self.component} near {self.place}"


def of_model(entry: AcceptedCase, snapshot: Snapshot, now: OnAccepted) -> Movement:
    """Return the change of the model's motion since it was accepted."""
    was = _Ends(entry.end, entry.end_uncertainty)
    return _movement(was, _Ends(now.end, now.uncertainty), snapshot)


def apart(entry: AcceptedCase, snapshot: Snapshot, now: OnAccepted) -> Movement:
    """Return the largest change of the model's ends, even one that uncertainties cover."""
    was = _Ends(entry.end, entry.end_uncertainty)
    return _movement(was, _Ends(now.end, now.uncertainty), snapshot, beyond=False)


def of_equations(snapshot: Snapshot, now: OnAccepted) -> Movement:
    """Return the change of the equations' motion since it was accepted."""
    nothing = (tuple(EQUATIONS * s for s in snapshot.scale),) * len(snapshot.end)
    return _movement(_Ends(snapshot.end, nothing), _Ends(now.equations, nothing), snapshot)


@dataclass(frozen=True)
class _Ends:
    """Ends of segments and their uncertainty, (K, 2n) each."""

    value: Sequence[Numbers]
    uncertainty: Rows


def _movement(was: _Ends, now: _Ends, snapshot: Snapshot, *, beyond: bool = True) -> Movement:
    """Return the largest movement of an end beyond both uncertainties, relative to its scale.

    With `beyond` False, return the largest movement of all, with the largest uncertainty.
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
    """Return whether a discrepancy changed by more than both uncertainties."""
    bounds = was.uncertainty, now.uncertainty
    if None in bounds:
        # A case with infinite uncertainty claims no digit, before and now.
        return bounds != (None, None)
    a, b, ua, ub = was.discrepancy, now.discrepancy, *bounds
    if a is None or b is None or ua is None or ub is None:
        return False
    return abs(a - b) > ua + ub + ROUNDING


def in_words(sized: Sized) -> str:
    """Format a discrepancy with its uncertainty; either may have no finite value."""
    size, bound = sized.discrepancy, sized.uncertainty
    return " ± ".join("unknown" if x is None else f"{x:.3e}" for x in (size, bound))
