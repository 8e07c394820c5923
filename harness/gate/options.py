"""What a gate may be told."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path

from physics_crosscheck.harness.engines.registry import absent_extras
from physics_crosscheck.harness.jobs.limits import Limits


@dataclass(frozen=True, kw_only=True)
class GateOptions:
    """What a gate may be told.

    Attributes:
        baseline: folder of the accepted baseline.
        engines: only these; none: all.
        every: run every case, changed or not.
        diagnose: name the cause where a model differs, which takes a while.
        resolution, jobs, limits: as in `harness.run.Options`.
        floating, model: the same for robot files; unset: as accepted.
        parents: folders all of whose systems are given, so that one that is missing is gone;
            None: every system of the baseline is expected.
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
        """Those whose cases are not looked at: not asked for, or of extras that aren't there."""
        absent = absent_extras()
        unasked = {name for name in engines if self.engines and name not in self.engines}
        return frozenset(unasked | {name for name in engines if name in absent})
