"""Poses of a model's bodies, compared with those of the equations."""

from .base import Count, Number, Record


class FramePose(Record, frozen=True, kw_only=True):
    """One declared frame or point in one model.

    Attributes:
        name: Declared name of the frame.
        place: Matching object in the model, such as `body:rod`.
        position: Largest position difference, m.
        rotation: Largest rotation difference, degrees; None for a point.
        agrees: Whether both differences are within the uncertainty or the resolution.
    """

    name: str
    place: str
    position: Number
    rotation: Number
    agrees: bool


class Poses(Record, frozen=True, kw_only=True):
    """Comparison of frames and points.

    Attributes:
        frames: The compared frames and points, and shapes and sites that differ.
        shapes: Number of compared shapes and sites of a robot file.
        states: Number of compared states, from the motions and at random.
        length: Largest distance of anything in the model from its origin, m.
        uncertainty: Position uncertainty, m; divided by `length`, the rotation uncertainty, rad.
        unchecked: Frames that the sidecar does not map.
        note: Reason if nothing was compared; empty otherwise.
    """

    frames: tuple[FramePose, ...] = ()
    shapes: Count = 0
    states: Count = 0
    length: Number = None
    uncertainty: Number = None
    unchecked: tuple[str, ...] = ()
    note: str = ""

    @property
    def wrong(self) -> tuple[FramePose, ...]:
        """Frames and points that differ."""
        return tuple(frame for frame in self.frames if not frame.agrees)

    @property
    def differs(self) -> bool:
        """True if a frame differs."""
        return bool(self.wrong)
