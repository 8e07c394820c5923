"""A mechanism of bodies as the report draws it: joints, bodies with shapes, and states."""

from __future__ import annotations

from typing import Literal

from physics_crosscheck.harness.records.base import Count, Number, Numbers, Record, Rows, one_length

ShapeKind = Literal["box", "sphere", "ellipsoid", "cylinder", "capsule", "plane", "mesh", "site"]
"""Kind of a shape; a site is a frame without an extent."""


class SceneShape(Record, frozen=True, kw_only=True):
    """A shape of a model file.

    Attributes:
        kind: Kind of the shape.
        size: Half edges, half axes or radius, m; radius and half length along z.
        place: Position, m, and unit quaternion (w, x, y, z) in the body's frame.
        visual: Whether it is drawn only, without contacts.
    """

    kind: ShapeKind
    size: Numbers
    place: Numbers
    visual: bool = False


class SceneBody(Record, frozen=True, kw_only=True):
    """A body of the file.

    Attributes:
        name: Name of the body.
        joint: Index of the joint that carries it; -1 for the world.
        place: Position and unit quaternion in the frame that the joint carries.
        mass: Mass, kg.
        ellipsoid: Position, quaternion and half axes of a uniform ellipsoid of equal inertia.
        shapes: Shapes on the body.
    """

    name: str
    joint: int
    place: Numbers
    mass: Number
    ellipsoid: Numbers = ()
    shapes: tuple[SceneShape, ...] = ()


class SceneJoint(Record, frozen=True, kw_only=True):
    """A joint, and its frame in the frame of the joint that carries it.

    Attributes:
        name: Name of the joint.
        parent: Index of the joint that carries it; -1 for the world.
        twists: Angular and linear velocity per unit of each velocity coordinate, in its frame.
    """

    name: str
    parent: int
    twists: Rows


class Scene(Record, frozen=True, kw_only=True):
    """Bodies at the compared states.

    Attributes:
        bodies: Bodies, parents first.
        joints: Joints, parents first.
        placements: Position and quaternion in the parent joint's frame, all states in a row.
        velocities: Velocity of each velocity coordinate at each state.
        accelerations: Mean accelerations by the equations, from each state on.
        length: Largest distance of a joint from the origin, m.
    """

    bodies: tuple[SceneBody, ...]
    joints: tuple[SceneJoint, ...]
    placements: Rows
    velocities: Rows
    accelerations: Rows
    length: Number

    def __post_init__(self) -> None:
        if any(not -1 <= joint.parent < i for i, joint in enumerate(self.joints)):
            raise ValueError("a joint of the scene precedes the one that carries it")
        if any(not -1 <= body.joint < len(self.joints) for body in self.bodies):
            raise ValueError("a body of the scene has no joint")
        one_length("the joints", self.joints, self.placements)
        one_length("the states", *self.velocities, *self.accelerations)


class StateErrors(Record, frozen=True, kw_only=True):
    """Differences between engine and equations at each compared state, by coordinate.

    Attributes:
        coordinates: Names of the coordinates.
        error: Difference E of position or velocity, whichever has the larger E/U; one row per
            coordinate.
        uncertainty: Uncertainty U of each.
        accelerations: Mean accelerations in the engine minus those of the equations.
        worst: Index of the state with the largest E of the component with the largest E/U.
    """

    coordinates: tuple[str, ...]
    error: Rows
    uncertainty: Rows
    accelerations: Rows = ()
    worst: Count = 0

    def __post_init__(self) -> None:
        one_length("the errors by state", self.coordinates, self.error, self.uncertainty)
