"""What an audit has to say, one thing at a time."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Finding:
    """One thing that the audit has to say.

    Attributes:
        kind: "literal", "inertia", "damping", "friction", "stiffness", "rest", "acceleration",
            "unresolved" or "default".
        message: a sentence.
        where: file:line, or empty.
        expected, found: numbers, where it is about two.
        severity: "finding", or "note" for what is no fault in itself.
    """

    kind: str
    message: str
    where: str = ""
    expected: float | None = None
    found: float | None = None
    severity: str = "finding"

    def record(self) -> dict[str, Any]:
        """As results.json has it."""
        return asdict(self)
