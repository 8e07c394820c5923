"""A mechanism of bodies as the report draws it: joints, bodies with shapes, and states."""

from typing import Literal

from .base import Count, Number, Numbers, Record, Rows, one_length

ShapeKind = Literal["box", "sphere", "ellipsoid", "cylinder", "capsule", "plane", "mesh", "site"]
"""Kind of a shape; a site is a frame without an extent."""


class SceneShape(Record, frozen=True, kw_only=True):
    """A shape of a model file.

    Attributes:
        kind: Kind of the shape.
        size: Half edges, half axes or radius, m; radius and half length along z.
        place: Position, m, and unit quaternion (w, x, y, z) in the body's frame.
        visual: Whether it is drawn only, without contacts.
        mesh: Index of its mesh in the scene; None without one.
    """

    kind: ShapeKind
    size: Numbers
    place: Numbers
    visual: bool = False
    mesh: Count | None = None


class SceneMesh(Record, frozen=True, kw_only=True):
    """Triangles of a mesh, reduced for a picture.

    Attributes:
        low: Smallest coordinates, m.
        extent: Largest coordinates minus the smallest, m.
        points: Coordinates as 16-bit shares of the extent, little-endian, in base64.
        faces: Indices of three points per triangle, likewise.
    """

    low: Numbers
    extent: Numbers
    points: str
    faces: str


MeshProblem = Literal["missing", "not a regular file", "empty", "unreadable", "without a reader"]


class UnreadMesh(Record, frozen=True, kw_only=True):
    """A mesh that the picture lacks.

    Attributes:
        name: Name of its file, without folders.
        problem: Problem of the file.
    """

    name: str
    problem: MeshProblem


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
        home: Placements in the pose as drawn, or in the first keyframe; empty if unknown.
        length: Largest distance of a joint from the origin, m.
        meshes: Meshes of the shapes.
        unread: Meshes that can't be drawn.
    """

    bodies: tuple[SceneBody, ...]
    joints: tuple[SceneJoint, ...]
    placements: Rows
    velocities: Rows
    accelerations: Rows
    length: Number
    meshes: tuple[SceneMesh, ...] = ()
    unread: tuple[UnreadMesh, ...] = ()
    home: Rows = ()

    def __post_init__(self) -> None:
        if any(not -1 <= joint.parent < i for i, joint in enumerate(self.joints)):
            raise ValueError("a joint of the scene precedes the one that carries it")
        if any(not -1 <= body.joint < len(self.joints) for body in self.bodies):
            raise ValueError("a body of the scene has no joint")
        shapes = (shape.mesh or 0 for body in self.bodies for shape in body.shapes)
        if max(shapes, default=0) > max(0, len(self.meshes) - 1):
            raise ValueError("a shape of the scene has no mesh")
        one_length("the joints", self.joints, self.placements)
        one_length("the states", *self.velocities, *self.accelerations)


class EngineInertia(Record, frozen=True, kw_only=True):
    """Mass and inertia of bodies that are fixed together, in the engine and in the file.

    Attributes:
        body: Index of the first of these bodies, in whose frame the ellipsoids are.
        mass: Mass in the engine, kg.
        ellipsoid: The engine's, as in `SceneBody`.
        stated_mass: Mass by the file, kg.
        stated: Ellipsoid by the file.
        differs: Whether mass, center or inertia visibly differ.
    """

    body: Count
    mass: Number
    ellipsoid: Numbers
    stated_mass: Number
    stated: Numbers
    differs: bool = False


class SceneContact(Record, frozen=True, kw_only=True):
    """A contact that an engine found.

    Attributes:
        point: Its position in the world, m.
        normal: Unit vector from the first surface to the second one.
        distance: Distance of the surfaces, negative where they overlap, m.
    """

    point: Numbers
    normal: Numbers
    distance: Number


class SceneLimit(Record, frozen=True, kw_only=True):
    """A limited joint at one state.

    Attributes:
        joint: Index of the joint.
        lower: Lower limit minus position, rad or m; None without one.
        upper: Upper limit minus position; None without one.
    """

    joint: Count
    lower: Number
    upper: Number


class SceneDrive(Record, frozen=True, kw_only=True):
    """A drive on a joint at one state.

    Attributes:
        joint: Index of the joint.
        force: Force of the drive by its law, N or N m.
        share: Force as a share of its limit, with sign; None without a limit.
    """

    joint: Count
    force: Number
    share: Number


class ActingState(Record, frozen=True, kw_only=True):
    """A state of whole steps, with the forces that act there.

    It is the worst one, or for steps that agree the one where most forces act.

    Attributes:
        joints: Names of the joints, as in `Scene`.
        placements: As in `Scene`, of this state.
        velocities: Velocity of each velocity coordinate.
        accelerations: By the laws.
        apart: Accelerations in the engine minus those by the laws; empty unless steps differ.
        contacts: Contacts of the engine.
        limits: Limited joints.
        drives: Drives on single joints.
    """

    joints: tuple[str, ...]
    placements: Rows
    velocities: Numbers
    accelerations: Numbers
    apart: Numbers = ()
    contacts: tuple[SceneContact, ...] = ()
    limits: tuple[SceneLimit, ...] = ()
    drives: tuple[SceneDrive, ...] = ()

    def __post_init__(self) -> None:
        one_length("the joints of a step", self.joints, self.placements)
        marks: tuple[SceneLimit | SceneDrive, ...] = (*self.limits, *self.drives)
        if any(mark.joint >= len(self.joints) for mark in marks):
            raise ValueError("a mark of a step has no joint")


Spans = tuple[tuple[int, int], ...]
"""First and last lines, from 1."""


class StateErrors(Record, frozen=True, kw_only=True):
    """Differences between engine and equations at each compared state, by coordinate.

    Attributes:
        coordinates: Names of the coordinates.
        error: Difference E of position or velocity, whichever has the larger E/U; one row per
            coordinate.
        uncertainty: Uncertainty U of each.
        accelerations: Mean accelerations in the engine minus those of the equations.
        worst: Index of the state with the largest E of the component with the largest E/U.
        inertias: Inertia of the engine, by joint; empty if the engine does not report it.
        lines: First and last lines of each body in the model file; empty if unknown.
    """

    coordinates: tuple[str, ...]
    error: Rows
    uncertainty: Rows
    accelerations: Rows = ()
    worst: Count = 0
    inertias: tuple[EngineInertia, ...] = ()
    lines: tuple[Spans, ...] = ()

    def __post_init__(self) -> None:
        one_length("the errors by state", self.coordinates, self.error, self.uncertainty)
