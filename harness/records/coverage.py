"""What a verdict covers: the numbers of a model file that had a say in it, and the others."""

from __future__ import annotations

from physics_crosscheck.harness.records.base import Count, Record


class Untested(Record, frozen=True, kw_only=True):
    """Numbers that nothing looked at, for one reason.

    Attributes:
        reason: a few words.
        count: how many.
        examples: what some of them are called, such as `geom@rgba`.
    """

    reason: str
    count: Count
    examples: tuple[str, ...]


class Coverage(Record, frozen=True, kw_only=True):
    """Which numbers of a model file, and of its sidecar's settings and springs, had a say.

    Each counts once, where it is first seen: a number that a motion depends on and that is bound
    counts as seen by motion.

    Attributes:
        numbers: all of them.
        motion: those that accelerations depend on, at positions and velocities of the motions.
        audit: of the others, those that are bound to a formula of the constants.
        frames: of the others, those that the pose of a declared frame depends on.
        untested: the others.
        note: why they were not counted; empty where they were.
        left_out: what the file says and the check leaves out, such as `dry friction of 7 joints`.
    """

    numbers: Count = 0
    motion: Count = 0
    audit: Count = 0
    frames: Count = 0
    untested: tuple[Untested, ...] = ()
    note: str = ""
    left_out: tuple[str, ...] = ()

    @property
    def seen(self) -> int:
        """Those that had a say."""
        return self.motion + self.audit + self.frames
