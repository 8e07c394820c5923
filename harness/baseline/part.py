"""One aspect of the comparison of a case with its accepted result."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Part:
    """The result of one comparison; the kinds and messages of several are combined.

    Attributes:
        kinds: what changed.
        messages: sentences for the user.
        worse, better: whether the case became worse or better; worse takes precedence.
    """

    kinds: tuple[str, ...] = ()
    messages: tuple[str, ...] = ()
    worse: bool = False
    better: bool = False
