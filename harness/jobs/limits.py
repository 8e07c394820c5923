"""Limits of a task's time and memory."""

from dataclasses import dataclass

SECONDS = 120.0
"""Default limit of a task's processor time, seconds."""

FAULT_SECONDS = 600.0
"""Limit for one planted fault, seconds: the diagnosis may try many pairs of causes."""

MEMORY = 4.0
"""Default limit of a worker's memory, GiB."""

PATIENCE = 10.0
"""Limit of the elapsed time as a multiple of the processor time: a task that sleeps or waits for
itself uses no processor.
"""


LEAST_SECONDS = 1e-3
"""Smallest valid limit of processor time, seconds; no task ends sooner."""

LEAST_MEMORY = 0.5
"""Smallest valid limit of memory, GiB; Python and an engine need as much."""

MAX_LIMIT = 1e6
"""Largest valid limit, seconds or GiB."""


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits of a task.

    Processor time counts all threads of the task itself; other load of the machine does not count.

    Attributes:
        seconds: processor seconds.
        memory: GiB.
        options: prefix of the options that raise them: `--`.
    """

    seconds: float = SECONDS
    memory: float = MEMORY
    options: str = "--"

    @property
    def wall(self) -> float:
        """Elapsed time, seconds, after which a task counts as waiting forever."""
        return PATIENCE * self.seconds

    @property
    def spent(self) -> str:
        """Message for a task that exceeded its processor time."""
        return f"it used up its limit of {self.seconds:g} processor seconds; {self._raise('limit')}"

    @property
    def waited(self) -> str:
        """Message for a task that exceeded the elapsed time with almost no processor time."""
        return (
            f"stopped after {self.wall:g} s by the clock, {PATIENCE:g} times its "
            f"limit of {self.seconds:g} processor seconds: it sleeps or waits; "
            f"{self._raise('limit')}"
        )

    @property
    def full(self) -> str:
        """Message for a task that exceeded its memory."""
        return (
            f"it needs more than its limit of {self.memory:g} GiB of memory; "
            f"{self._raise('memory')}"
        )

    def _raise(self, option: str) -> str:
        return f"{self.options}{option} raises it"
