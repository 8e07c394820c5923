"""Coverage of a verdict: the numbers of a model file that it tests, and the others."""

from .base import Count, Record


class Untested(Record, frozen=True, kw_only=True):
    """Untested numbers that share one reason.

    Attributes:
        reason: Why no motion depends on them.
        count: How many there are.
        examples: Some of their names, such as `geom@rgba`.
    """

    reason: str
    count: Count
    examples: tuple[str, ...]


class Coverage(Record, frozen=True, kw_only=True):
    """The numbers of a model file and its sidecar that the check tested.

    Each number counts once. A bound number that the motion also depends on counts under
    `motion`.

    Attributes:
        numbers: All numbers.
        motion: Numbers that accelerations at the tested states depend on.
        audit: Further numbers bound to a formula.
        frames: Further numbers that the pose of a declared frame depends on.
        read: Numbers that no test depends on, but that the engine compiles as the text states.
        untested: All other numbers, by reason.
        note: Reason if the numbers were not counted; empty otherwise.
        left_out: Features of the file that are not compared, such as `dry friction of 7 joints`.
        engine: Engine whose checks are counted, once for all engines of a robot file.
    """

    numbers: Count = 0
    motion: Count = 0
    audit: Count = 0
    frames: Count = 0
    read: Count = 0
    untested: tuple[Untested, ...] = ()
    note: str = ""
    left_out: tuple[str, ...] = ()
    engine: str = ""

    @property
    def seen(self) -> int:
        """Number of tested numbers."""
        return self.motion + self.audit + self.frames
