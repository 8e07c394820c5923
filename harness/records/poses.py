"""Where a model's bodies are in the world, beside where the equations have them."""

from __future__ import annotations

from physics_crosscheck.harness.records.base import Count, Number, Record


class FramePose(Record, frozen=True, kw_only=True):
    """One frame or point of the system in one model.

    Attributes:
        name: of the frame, as declared.
        place: what it is in the model, such as `body:rod`.
        position: how far off it is at most, m.
        rotation: by what angle at most, degrees; None for a point.
        agrees: whether both are within the uncertainty, or below the resolution.
    """

    name: str
    place: str
    position: Number
    rotation: Number
    agrees: bool


class Poses(Record, frozen=True, kw_only=True):
    """What was found of a model's poses.

    Attributes:
        frames: those that were compared.
        states: at how many positions, of the motions and at random.
        length: the largest distance of anything of the model from its origin, m.
        uncertainty: of a position, m; of a rotation, that over the length, rad.
        unchecked: frames that the sidecar does not map.
        note: why nothing was compared; empty where something was.
    """

    frames: tuple[FramePose, ...] = ()
    states: Count = 0
    length: Number = None
    uncertainty: Number = None
    unchecked: tuple[str, ...] = ()
    note: str = ""
