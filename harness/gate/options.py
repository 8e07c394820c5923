"""Options of the gate."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path

from physics_crosscheck.harness.engines.registry import absent_extras
from physics_crosscheck.harness.jobs.limits import Limits


@dataclass(frozen=True, kw_only=True)
class GateOptions:
    """Options of the gate.

    Attributes:
        baseline: folder of the accepted baseline.
        engines: engines to run; empty: all.
        every: whether to run unchanged cases too.
        diagnose: whether to find the cause of each difference, which takes longer.
        resolution, jobs, limits: as in `harness.run.Options`.
        floating, model: the same for robot files; default: as accepted.
        parents: folders whose systems are all given, so that a missing system counts as gone; None:
            expect every system of the baseline.
    """

    baseline: Path
    engines: tuple[str, ...] = ()
    every: bool = False
    diagnose: bool = False
    resolution: float = 1e-9
    jobs: int = 0
    limits: Limits = field(default_factory=Limits)
    floating: bool = False
    model: str = ""
    parents: tuple[Path, ...] | None = None

    def left_out(self, engines: Collection[str]) -> frozenset[str]:
        """Return the engines to ignore: not requested, or of extras that are not installed."""
        absent = absent_extras()
        unasked = {name for name in engines if self.engines and name not in self.engines}
        return frozenset(unasked | {name for name in engines if name in absent})
