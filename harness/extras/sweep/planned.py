"""Tasks of a worker: some cases of one system or one robot file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Planned:
    """A planned case.

    Attributes:
        index: its number.
        draw: number of its draw.
        constants: values of varied constants, by name.
        model, engine, scenario, integrator: names of the case.
        settings: settings that select its integrator.
        step: time step, seconds; None: the model's own.
        command: command that runs it alone.
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
        folder: folder of the system, or the robot file.
        content: hash of its content.
        system: its name.
        varied: names of all varied constants.
        resolution: smallest relative discrepancy to detect.
        cases: cases by index.
    """

    folder: str
    content: str
    system: str
    varied: frozenset[str]
    resolution: float
    cases: tuple[Planned, ...]

    def single_blocks(self) -> Iterator[Block]:
        """Yield one block per case."""
        return (replace(self, cases=(case,)) for case in self.cases)
