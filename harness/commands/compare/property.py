"""A difference between the contents of two files."""

from __future__ import annotations

import numpy as np

from physics_crosscheck.harness.records.base import SourceLine, number
from physics_crosscheck.harness.records.comparison import ComparedProperty
from physics_crosscheck.reference.mechanism.tree import Tree

Difference = tuple[ComparedProperty, Tree | None]
"""A difference of two files, and A's tree with B's value; None if no tree shows it."""


def make_property(
    kind: str,
    about: str,
    message: str,
    *,
    a: float | None = None,
    b: float | None = None,
    lines: tuple[SourceLine | None, SourceLine | None] = (None, None),
    moves: bool = True,
    relative: float = 1.0,
    changed: Tree | None = None,
) -> Difference:
    """Return a difference.

    Args:
        kind: such as "mass", "centre", "inertia", "axis", "damping", "range", "frame".
        about: the joint or link; empty for the whole model.
        message: a sentence.
        a, b: the values, for single numbers.
        lines: of A and of B, if known.
        moves: whether it is part of the equations of motion.
        relative: the relative difference; 1 for anything without a size.
        changed: A's tree with B's value.
    """
    record = ComparedProperty(
        kind=kind,
        about=about,
        message=message,
        a=number(a),
        b=number(b),
        where_a=lines[0],
        where_b=lines[1],
        moves=moves,
        relative=number(relative),
    )
    return record, changed


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
