"""What a task may use up before it is stopped."""

from __future__ import annotations

from dataclasses import dataclass

SECONDS = 120.0
"""Processor seconds that a task may take unless told otherwise."""

FAULT_SECONDS = 600.0
"""Those that one planted fault may take: many pairs of causes may be tried."""

MEMORY = 4.0
"""GiB that a worker may hold unless told otherwise."""

PATIENCE = 10.0
"""A task that sleeps or waits for itself uses no processor: it has so many times its limit."""


LEAST_SECONDS = 1e-3
"""Processor seconds below which no task ends."""

LEAST_MEMORY = 0.5
"""GiB in which Python and an engine find room."""

MOST = 1e6
"""Seconds or GiB that no limit reaches."""


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What a task may use up.

    Processor seconds are those of the task itself, of all its threads: what else the machine is
    busy with takes nothing from them.

    Attributes:
        seconds: of the processor.
        memory: GiB.
        options: what a person raises them with, before their names: `--`.
    """

    seconds: float = SECONDS
    memory: float = MEMORY
    options: str = "--"

    @property
    def wall(self) -> float:
        """Seconds by the clock, after which a task is taken for one that waits for ever."""
        return PATIENCE * self.seconds

    @property
    def spent(self) -> str:
        """What is said of a task that used its time up."""
        return f"it used up its limit of {self.seconds:g} processor seconds; {self._raise('limit')}"

    @property
    def waited(self) -> str:
        """What is said of one that has not ended by the clock, and used hardly any processor."""
        return (
            f"stopped after {self.wall:g} s by the clock, {PATIENCE:g} times its "
            f"limit of {self.seconds:g} processor seconds: it sleeps or waits; "
            f"{self._raise('limit')}"
        )

    @property
    def full(self) -> str:
        """What is said of one that asked for more memory."""
        return (
            f"it needs more than its limit of {self.memory:g} GiB of memory; "
            f"{self._raise('memory')}"
        )

    def _raise(self, option: str) -> str:
        return f"{self.options}{option} raises it"
