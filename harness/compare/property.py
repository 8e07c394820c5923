"""A difference between the contents of two files."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from physics_crosscheck.harness.records.base import SourceLine


@dataclass(frozen=True, kw_only=True)
class Property:
    """A difference between the contents of two files.

    Attributes:
        kind: such as "mass", "centre", "inertia", "axis", "damping", "range", "frame".
        about: the joint or link; empty for the whole model.
        message: a sentence.
        a, b: the values, for single numbers.
        where_a, where_b: the source lines, if known.
        effect: relative size, for sorting.
        moves: whether it is part of the equations of motion.
        relative: the relative difference; 1 for anything without a size.
    """

    kind: str
    about: str
    message: str
    a: float | None = None
    b: float | None = None
    where_a: SourceLine | None = None
    where_b: SourceLine | None = None
    effect: float
    moves: bool = True
    relative: float = 1.0


def make_property(
    kind: str,
    about: str,
    message: str,
    effect: float,
    a: float | None = None,
    b: float | None = None,
    *,
    moves: bool = True,
    relative: float = 1.0,
) -> Property:
    """Return a difference without lines."""
    return Property(
        kind=kind,
        about=about,
        message=message,
        a=a,
        b=b,
        effect=float(effect),
        moves=moves,
        relative=float(relative),
    )


def shown(here: float, there: float) -> str:
    """Format two numbers with enough digits to show their difference."""
    text_a, text_b = apart(here, there, 0.0)
    share = f" ({percent((there - here) / here)})" if here and there else ""
    return f"{text_a} in A, {text_b} in B{share}"


def apart(here: float, there: float, doubt: float) -> tuple[str, str]:
    """Format both numbers with enough digits to show the difference; uncertain ones are 0."""
    here, there = (0.0 if abs(x) <= doubt else x for x in (here, there))
    size = max(abs(here), abs(there))
    share = abs(here - there) / size if size else 0.0
    digits = int(np.clip(np.ceil(-np.log10(share)) + 2, 4, 17)) if share > 0 else 17
    return f"{here:.{digits}g}", f"{there:.{digits}g}"


def percent(share: float) -> str:
    """Format a relative change."""
    if abs(share) >= 1e-4:
        return f"{100 * share:+.3g} %"
    return f"{share:+.1e}"
