"""One thing that is found of a case against what was accepted of it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Part:
    """What one comparison tells; of several, kinds and messages add up.

    Attributes:
        kinds: what changed.
        messages: sentences.
        worse, better: whether that makes the case so; what is worse counts.
    """

    kinds: tuple[str, ...] = ()
    messages: tuple[str, ...] = ()
    worse: bool = False
    better: bool = False
