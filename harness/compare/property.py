"""A difference of what two files say."""

from __future__ import annotations

from dataclasses import dataclass

from physics_crosscheck.harness.compare.terms import apart, percent
from physics_crosscheck.harness.records.base import SourceLine


@dataclass(frozen=True, kw_only=True)
class Property:
    """What the files say differently.

    Attributes:
        kind: such as "mass", "centre", "inertia", "axis", "damping", "range", "frame".
        about: the joint or the link; empty for the whole.
        message: a sentence.
        a, b: the values, where it is one number.
        where_a, where_b: the lines, where known.
        effect: how large it is, relative, to sort by.
        moves: whether equations of motion have it.
        relative: by how much it differs, relative; 1 where that is no matter of size.
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


def told(
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
    """One without lines."""
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
    """Two numbers, with as many digits as show that they are two."""
    one, other = apart(here, there, 0.0)
    share = f" ({percent((there - here) / here)})" if here and there else ""
    return f"{one} in A, {other} in B{share}"
