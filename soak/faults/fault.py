"""A fault while running."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from soak.faults.scene import Undisturbed


@dataclass(frozen=True, kw_only=True)
class Fault:
    """One of them.

    Attributes:
        check: given the verdicts of an undisturbed run of the same folders; says what is wrong.
    """

    name: str
    check: Callable[[Undisturbed], list[str]]
