"""Why a task has no value."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Failure:
    """Why a task has no value: one sentence, and what was printed meanwhile.

    Attributes:
        usage: whether what was asked makes no sense, rather than something having gone wrong.
    """

    reason: str
    stdout: str
    usage: bool = False
