"""What cases of a sweep are drawn from, in a worker: a system's folder, or a robot's file."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from physics_crosscheck.harness.extras.sweep.known import Known
from physics_crosscheck.harness.extras.sweep.planned import Planned


class Source(ABC):
    """Models, and what numbers of theirs may be varied."""

    signed: bool
    """Whether a constant keeps the sign that it is declared with."""

    @property
    @abstractmethod
    def name(self) -> str:
        """Of the system or the robot."""

    @abstractmethod
    def varying(self, varied: frozenset[str]) -> Source:
        """The same with other constants varied; what doesn't depend on these is shared."""

    @property
    @abstractmethod
    def constants(self) -> Mapping[str, float]:
        """What may be varied, with the values that are declared."""

    @property
    @abstractmethod
    def scenarios(self) -> tuple[str, ...]:
        """Their names."""

    @abstractmethod
    def runs(self, only: Sequence[str]) -> Iterator[tuple[str, str]]:
        """Models, each with an engine that runs it, installed or not.

        Args:
            only: engines; empty: those that are meant.

        Raises:
            SidecarError: for a model that can't be read.
        """

    @abstractmethod
    def prepare(self, model: str, engine: str) -> tuple[str, Mapping[str, Mapping[str, object]]]:
        """Make what all cases of a model in an engine share, where that is not done yet.

        Returns:
            Its integrator, and others that the engine offers, with the settings that choose them.

        Raises:
            SidecarError, LocationError, EngineError, RobotError: naming file, place and remedy.
        """

    @abstractmethod
    def run(self, case: Planned, resolution: float, place: Path, known: Known) -> None:
        """Run a case.

        Args:
            case: which.
            resolution: relative discrepancy to resolve.
            place: an empty folder, for a copy of the model with other numbers.
            known: is told what is known, step by step.

        Raises:
            Exception: of any kind that says why it can't be run.
        """
