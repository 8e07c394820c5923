"""What a worker is given: some cases of one system, or of one robot's file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Planned:
    """A case of the plan.

    Attributes:
        index: its number.
        draw: number of its draw.
        constants: that are varied, by name.
        model, engine, scenario, integrator: the case.
        settings: that choose its integrator.
        step: shipped step, seconds; None: the model's own.
        command: that runs it alone.
    """

    index: int
    draw: int
    constants: Mapping[str, float]
    model: str
    engine: str
    scenario: str
    integrator: str
    settings: Mapping[str, Any]
    step: float | None
    command: str


@dataclass(frozen=True, kw_only=True)
class Block:
    """Some cases of one system, for one worker.

    Attributes:
        folder: of the system, or the robot's file.
        content: hash of what is in it.
        system: its name.
        varied: names of all constants that are varied.
        resolution: relative discrepancy to resolve.
        cases: by index.
    """

    folder: str
    content: str
    system: str
    varied: frozenset[str]
    resolution: float
    cases: tuple[Planned, ...]

    def alone(self) -> Iterator[Block]:
        """A block for each of its cases."""
        return (replace(self, cases=(case,)) for case in self.cases)
