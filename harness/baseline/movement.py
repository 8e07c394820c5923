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
"""Relative movement of a segment's end, by the equations, that is none: ten times what the two
integrations of a reference may be apart."""

ROUNDING = 1e-15


class Sized(Protocol):
    """A discrepancy with its uncertainty, as a verdict and an accepted case have."""

    @property
    def discrepancy(self) -> Number:
        """Relative."""

    @property
    def uncertainty(self) -> Number:
        """Relative."""


@dataclass(frozen=True, kw_only=True)
class Movement:
    """The largest change of a segment's end; all zero where uncertainties cover it.

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
        size = percent(self.size)
        if "%" not in size:  # close to what rounding does
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
    """Return whether a discrepancy changed by more than both uncertainties."""
    bounds = was.uncertainty, now.uncertainty
    if None in bounds:
        # No digit is claimed of a case whose uncertainty is infinite, before and after alike.
        return bounds != (None, None)
    a, b, ua, ub = was.discrepancy, now.discrepancy, *bounds
    if a is None or b is None or ua is None or ub is None:
        return False
    return abs(a - b) > ua + ub + ROUNDING


def in_words(sized: Sized) -> str:
    """Format a discrepancy with its uncertainty; either may have no finite value."""
    size, bound = sized.discrepancy, sized.uncertainty
    return " ± ".join("unknown" if x is None else f"{x:.3e}" for x in (size, bound))
