"""The scene of a tree for the report: its bodies, and its joints at the compared states."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.expanded import locate_file
from physics_crosscheck.harness.modelfiles.locations import MARKUP
from physics_crosscheck.harness.modelfiles.mesh_files import (
    MeshError,
    decimated_mesh,
    unread_meshes,
)
from physics_crosscheck.harness.modelfiles.robot import PlacedShape
from physics_crosscheck.harness.numerics.stepping import StepDefects
from physics_crosscheck.harness.records.base import Numbers, number, rounded
from physics_crosscheck.harness.records.scene import (
    ActingState,
    EngineInertia,
    Scene,
    SceneBody,
    SceneContact,
    SceneDrive,
    SceneJoint,
    SceneLimit,
    SceneMesh,
    SceneShape,
    ShapeKind,
    Spans,
    StateErrors,
)
from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.laws.mechanics import Posture
from physics_crosscheck.reference.mechanism.bodies import RigidBody
from physics_crosscheck.reference.mechanism.chart import Coupled, MinimalCoordinates
from physics_crosscheck.reference.mechanism.laws import ContactPoint
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import (
    IDENTITY,
    NO_INERTIA,
    Place,
    SpatialInertia,
    to_quaternion,
)
from physics_crosscheck.reference.mechanism.tree import WORLD, Tree
from physics_crosscheck.reference.solving.segments import Segments
from .law_comparison import Evaluated, LawComparison

DIGITS = 7
"""Significant digits of drawn numbers."""

SIZE_DIGITS = 5

FACES, LEAST_FACES, MOST_FACES = 16_000, 120, 2500
"""Triangles of all meshes of a scene together, and of each mesh at least and at most."""

VISIBLE = 1e-3
"""Relative difference of inertias from which a picture marks them."""


def scene_record(
    tree: Tree,
    states: Segments | None,
    bodies: Iterable[RigidBody],
    shapes: Sequence[PlacedShape] = (),
    home: Array | None = None,
) -> Scene:
    """Return the scene of a tree at the starts of its segments.

    Args:
        tree: the tree; its frames have the names of the bodies.
        states: the segments; None for a pose alone.
        bodies: the bodies, parents first.
        shapes: shapes of the file.
        home: coordinates of the pose to open with, (nv,); None: zeros.
    """
    n = tree.dof
    still = np.zeros(tree.nv) if home is None else home
    coordinates = velocities = accelerations = np.zeros((tree.nv, 0))
    if states is not None:
        coordinates = Coupled(tree).positions(states.start[:, :n].T)
        rates = states.start[:, n:], (states.end - states.start)[:, n:] / states.lengths[:, None]
        velocities, accelerations = (joint_rates(tree, coordinates, one) for one in rates)
    placements = _placements(tree, coordinates)
    drawn = [
        (body, _drawn([shape for shape in shapes if shape.body == body.name])) for body in bodies
    ]
    meshes = _Meshes.build([shape for _, mine in drawn for shape in mine])
    return Scene(
        bodies=tuple(_body(tree, body, mine, meshes) for body, mine in drawn),
        joints=tuple(
            SceneJoint(name=link.name, parent=link.parent, twists=_twists(*link.motion))
            for link in tree.links
        ),
        placements=placements,
        velocities=tuple(rounded(row, DIGITS) for row in velocities.tolist()),
        accelerations=tuple(rounded(row, DIGITS) for row in accelerations.tolist()),
        home=_placements(tree, still[:, None]),
        length=number(_length(tree, np.column_stack([coordinates, still]))),
        meshes=meshes.records,
        unread=unread_meshes(filter(_is_mesh, shapes)),
    )


def joint_rates(tree: Tree, coordinates: Array, rates: Array) -> Array:
    """Return rates of the independent coordinates, (K, n), as joint velocities, (nv, K).

    Args:
        tree: the tree.
        coordinates: all coordinates, (nv, K).
        rates: velocities, or differences of velocities.
    """
    whole = Coupled(tree).rates(rates.T)
    velocities: Array = MinimalCoordinates(tree).velocities(coordinates, whole)
    return velocities


def _twists(angular: Array, linear: Array) -> tuple[Numbers, ...]:
    both = np.concatenate([np.broadcast_to(angular, (3, linear.shape[1])), linear])
    return tuple(rounded(column, DIGITS) for column in both.T.tolist())


def _placements(tree: Tree, coordinates: Array) -> tuple[Numbers, ...]:
    """Return the frame of each joint in its parent's at all states, one row per joint."""
    count = coordinates.shape[1]
    rows = []
    for placement in Recursion(tree).placements(MinimalCoordinates(tree).positions(coordinates)):
        rotation = np.moveaxis(np.broadcast_to(placement.rotation, (3, 3, count)), -1, 0)
        origin = np.broadcast_to(placement.origin, (3, count)).T
        places = map(_place, map(Place, rotation, origin))
        rows.append(tuple(value for place in places for value in place))
    return tuple(rows)


def _place(place: Place) -> Numbers:
    return rounded([*place.origin.tolist(), *to_quaternion(place.rotation)], DIGITS)


def _length(tree: Tree, coordinates: Array) -> float:
    poses = Recursion(tree).poses(MinimalCoordinates(tree).positions(coordinates))
    return max((float(np.max(np.abs(one.origin), initial=0.0)) for one in poses), default=0.0)


def _body(tree: Tree, body: RigidBody, shapes: Sequence[PlacedShape], meshes: _Meshes) -> SceneBody:
    joint, place = tree.frames[body.name]
    return SceneBody(
        name=body.name,
        joint=joint,
        place=_place(place),
        mass=number(body.mass),
        ellipsoid=_ellipsoid(body.spatial_inertia),
        shapes=tuple(
            _shape(shape, meshes)
            for shape in shapes
            if not _is_mesh(shape) or meshes.index(shape) is not None
        ),
    )


@dataclass(frozen=True)
class _Meshes:
    """The meshes of a scene."""

    records: tuple[SceneMesh, ...]
    places: Mapping[_MeshKey, int]

    @staticmethod
    def build(shapes: Sequence[PlacedShape]) -> _Meshes:
        """Read and reduce the meshes of shapes; visual ones have more triangles."""
        keys = dict.fromkeys(map(_mesh_key, filter(_is_mesh, shapes)))
        budget = int(np.clip(FACES / max(len(keys), 1), LEAST_FACES, MOST_FACES))
        meshes = {key: mesh for key in keys if (mesh := _mesh_record(key, budget)) is not None}
        return _Meshes(tuple(meshes.values()), {key: i for i, key in enumerate(meshes)})

    def index(self, shape: PlacedShape) -> int | None:
        """Return the index of a shape's mesh; None without one."""
        return self.places.get(_mesh_key(shape)) if _is_mesh(shape) else None


_MeshKey = tuple[Path, str, tuple[float, ...]]


def _mesh_key(shape: PlacedShape) -> _MeshKey:
    return shape.file, shape.mesh, shape.scale


def _is_mesh(shape: PlacedShape) -> bool:
    return shape.kind == "mesh" and bool(shape.mesh)


def _mesh_record(key: _MeshKey, faces: int) -> SceneMesh | None:
    """Return a reduced mesh in the shape's frame; None if it is missing or can't be read."""
    model, name, scale = key
    file = locate_file(model, name)
    try:
        mesh = None if file is None else decimated_mesh(file, faces)
    except MeshError:
        return None
    if mesh is None or not len(mesh.faces) or len(mesh.points) > 1 << 16:
        return None
    points = mesh.points * np.array(scale)
    low, extent = np.min(points, axis=0), np.ptp(points, axis=0)
    shares = np.rint((points - low) / np.where(extent, extent, 1.0) * 65535)
    return SceneMesh(
        low=rounded(low.tolist(), SIZE_DIGITS),
        extent=rounded(extent.tolist(), SIZE_DIGITS),
        points=_base64(shares),
        faces=_base64(mesh.faces),
    )


def _base64(values: NDArray[Any]) -> str:
    return base64.b64encode(values.astype("<u2").tobytes()).decode("ascii")


def _drawn(shapes: Sequence[PlacedShape]) -> Sequence[PlacedShape]:
    """Return the visual shapes of a body if its file separates them, or all; without lost meshes.

    In an MJCF, visual shapes without a mesh are additions to those that collide.
    """
    solids = [one for one in shapes if not _is_mesh(one) or not unread_meshes([one])]
    visual = [one for one in solids if one.visual]
    separate = any(_is_mesh(one) or one.name.startswith("visual:") for one in visual)
    return visual if separate else solids


def _shape(shape: PlacedShape, meshes: _Meshes) -> SceneShape:
    return SceneShape(
        kind=_kind(shape),
        size=rounded(shape.size, SIZE_DIGITS),
        place=_place(shape.place),
        visual=shape.visual,
        mesh=meshes.index(shape),
    )


def _kind(shape: PlacedShape) -> ShapeKind:
    kinds: tuple[ShapeKind, ...] = get_args(ShapeKind)
    return next((kind for kind in kinds if kind == shape.kind), "mesh")


def _ellipsoid(inertia: SpatialInertia) -> Numbers:
    """Return the uniform ellipsoid of equal mass and inertia: its place and half axes, m."""
    if not (inertia.mass > 0 and np.isfinite(inertia.inertia).all()):
        return ()
    moments, axes = np.linalg.eigh(inertia.inertia)
    if np.linalg.det(axes) < 0:
        axes[:, 0] *= -1
    squares = 2.5 * (moments.sum() - 2 * moments) / inertia.mass
    if np.min(squares) < -1e-9 * np.max(np.abs(squares)) or not np.any(squares):
        return ()
    half = np.sqrt(np.maximum(squares, 0.0)).tolist()
    return (*_place(Place(axes, inertia.center)), *rounded(half, SIZE_DIGITS))


def inertia_records(
    tree: Tree, bodies: Sequence[SceneBody], inertias: Mapping[str, SpatialInertia]
) -> tuple[EngineInertia, ...]:
    """Compare the inertia of an engine's bodies with the file's, of all that move as one.

    Args:
        tree: the tree; its frames have the names of the bodies.
        bodies: of the scene.
        inertias: the engine's, in the frames of its bodies; it may merge bodies.
    """
    whole = compiled_inertias(tree, inertias)
    first = {body.joint: i for i, body in reversed(list(enumerate(bodies)))}
    return tuple(
        _inertia_record(tree, first[i], bodies[first[i]].name, inertia)
        for i, inertia in sorted(whole.items())
        if i in first and inertia.mass > 0
    )


def compiled_inertias(
    tree: Tree, inertias: Mapping[str, SpatialInertia]
) -> dict[int, SpatialInertia]:
    """Return the inertia of an engine's bodies by link, each in the link's frame.

    Args:
        tree: the tree; its frames have the names of the bodies.
        inertias: the engine's, in the frames of its bodies; it may merge bodies.
    """
    whole: dict[int, SpatialInertia] = {}
    for name, inertia in inertias.items():
        link, place = tree.frames.get(name, (WORLD, IDENTITY))
        if link != WORLD:
            whole[link] = whole.get(link, NO_INERTIA).combined(inertia.in_frame(place))
    return whole


def _inertia_record(tree: Tree, body: int, name: str, inertia: SpatialInertia) -> EngineInertia:
    joint, place = tree.frames[name]
    link = tree.links[joint]
    stated = SpatialInertia(link.mass, link.center, link.inertia)
    inverse = Place(place.rotation.T, -place.rotation.T @ place.origin)
    return EngineInertia(
        body=body,
        mass=number(inertia.mass),
        ellipsoid=_ellipsoid(inertia.in_frame(inverse)),
        stated_mass=number(stated.mass),
        stated=_ellipsoid(stated.in_frame(inverse)),
        differs=not inertia_difference(inertia, stated) <= VISIBLE,
    )


def inertia_difference(first: SpatialInertia, second: SpatialInertia) -> float:
    """Return the largest relative difference of mass, center and moments of inertia."""
    return max(off for *_, off in inertia_differences(second, first))


def inertia_differences(
    stated: SpatialInertia, other: SpatialInertia
) -> Iterator[tuple[str, float, float, float]]:
    """Yield the number of mass, center and inertia that differs most: its name, both values, and
    the difference of all, relative to the stated size.
    """
    size = float(np.sqrt(np.trace(stated.inertia) / max(stated.mass, 1e-300)))
    for what, first, second, scale in (
        ("mass", np.array([stated.mass]), np.array([other.mass]), stated.mass),
        ("center", stated.center, other.center, size),
        ("inertia", stated.inertia, other.inertia, float(np.linalg.norm(stated.inertia))),
    ):
        index = int(np.argmax(np.abs(second - first)))
        axes = "".join("xyz"[k] for k in np.unravel_index(index, first.shape) if first.size > 1)
        off = float(np.linalg.norm(second - first)) / (scale if scale > 0 else 1.0)
        yield f"{what} {axes}".strip(), float(first.flat[index]), float(second.flat[index]), off


def acting_state(comparison: LawComparison, sample: Evaluated, *, differs: bool) -> ActingState:
    """Return a state of whole steps with the contacts, limits and drives that act there.

    Args:
        comparison: of laws and engine.
        sample: the state.
        differs: whether to draw the engine's accelerations too.
    """
    posture, tree = sample.solution.posture, comparison.laws.tree.tree
    placements = Recursion(tree).placements(posture.q)
    chart = MinimalCoordinates(tree)
    engine = sample.engine.acceleration[comparison.order]
    speeds = [posture.m, sample.acceleration, engine - sample.acceleration]
    y = np.repeat(posture.y[:, None], len(speeds), axis=1)
    rows = chart.tree_velocities(y, np.stack(speeds, axis=1)).T
    velocity, acceleration, apart = (rounded(row.tolist(), DIGITS) for row in rows)
    return ActingState(
        joints=tuple(link.name for link in tree.links),
        placements=tuple(_place(Place(*map(np.asarray, one))) for one in placements),
        velocities=velocity,
        accelerations=acceleration,
        apart=apart if differs else (),
        contacts=tuple(map(_contact, sample.engine.contacts)),
        limits=tuple(_limits(comparison, posture)),
        drives=tuple(
            SceneDrive(
                joint=joint,
                force=rounded([force], SIZE_DIGITS)[0],
                share=number(round(force / largest, 4)) if 0 < largest < np.inf else None,
            )
            for joint, force, largest in sample.solution.law.efforts
        ),
    )


def _contact(contact: ContactPoint) -> SceneContact:
    return SceneContact(
        point=rounded(contact.position.tolist(), DIGITS),
        normal=rounded(contact.frame[0].tolist(), SIZE_DIGITS),
        distance=rounded([contact.distance], SIZE_DIGITS)[0],
    )


def _limits(comparison: LawComparison, posture: Posture) -> Iterator[SceneLimit]:
    tree = comparison.laws.tree.tree
    for joint, *bounds in comparison.laws.limits:
        if tree.links[joint].kind in ("hinge", "slide"):
            position = float(posture.y[tree.velocities[joint].start])
            lower, upper = rounded([bound - position for bound in bounds], SIZE_DIGITS)
            yield SceneLimit(joint=joint, lower=lower, upper=upper)


def errors_record(
    tree: Tree,
    states: Segments,
    names: tuple[str, ...],
    defects: StepDefects,
    apart: Array | None,
    inertias: tuple[EngineInertia, ...] = (),
) -> StateErrors:
    """Return the errors of a case by coordinate and state.

    Args:
        tree: the tree.
        states: the segments.
        names: names of the coordinates, (n,).
        defects: relative differences and uncertainties, (K, 2n) each.
        apart: ends of the segments in the engine minus those in the equations, (K, 2n); None if
            single steps decide. Unused where no error exceeds its uncertainty.
        inertias: of the engine.
    """
    half = len(names)
    with np.errstate(all="ignore"):
        share = np.nan_to_num(defects.defect / defects.uncertainty, nan=0.0)
    differs = bool(np.max(share, initial=0.0) > 1)
    component = int(np.argmax(np.max(share, axis=0)))
    later = share[:, half:] > share[:, :half]
    error, uncertainty = (
        np.where(later, one[:, half:], one[:, :half]).T
        for one in (defects.defect, defects.uncertainty)
    )
    return StateErrors(
        coordinates=names,
        error=tuple(rounded(row, 3) for row in error.tolist()),
        uncertainty=tuple(rounded(row, 3) for row in uncertainty.tolist()),
        accelerations=_differences(tree, states, apart) if apart is not None and differs else (),
        worst=int(np.argmax(defects.defect[:, component])),
        inertias=inertias,
    )


def _differences(tree: Tree, states: Segments, apart: Array) -> tuple[Numbers, ...]:
    """Return differences of mean accelerations, by velocity coordinate and state."""
    n = tree.dof
    coordinates = Coupled(tree).positions(states.start[:, :n].T)
    rates = apart[:, n:] / states.lengths[:, None]
    return tuple(rounded(row, DIGITS) for row in joint_rates(tree, coordinates, rates).tolist())


def body_lines(file: Path, bodies: Sequence[str]) -> tuple[Spans, ...]:
    """Return the lines of each body in a URDF, an SDFormat file or an MJCF; empty in others.

    Args:
        file: path of the file.
        bodies: names of the bodies, in the order of an MJCF.
    """
    try:
        root = Document(file).root if file.suffix in MARKUP else None
    except LocationError:
        root = None
    if root is None:
        return ()
    stated = _flat(root) if root.tag in ("robot", "sdf") else _nested(root)
    spans: dict[str, list[tuple[int, int]]] = {}
    for body, span in stated:
        spans.setdefault(body, []).append(span)
    return tuple(tuple(spans.get(body, ())) for body in bodies)


def _flat(root: XmlElement) -> Iterator[tuple[str, tuple[int, int]]]:
    """Yield links, and each joint with its child link."""
    for element in root.iter():
        if element.tag == "link" and element.get("name"):
            yield element.get("name"), _span(element)
        elif element.tag == "joint" and (child := element.find("child")) is not None:
            yield child.get("link") or child.text.strip(), _span(element)


def _nested(root: XmlElement) -> Iterator[tuple[str, tuple[int, int]]]:
    """Yield bodies with their lines before the first body in them."""
    for i, element in enumerate(root.iter("body"), start=1):
        first, last = _span(element)
        inner = next((one for one in element.iter("body") if one is not element), None)
        if inner is not None:
            last = max(first, (inner.place[1] or 0) - 1)
        yield element.get("name") or f"body_{i}", (first, last)


def _span(element: XmlElement) -> tuple[int, int]:
    source = element.source
    assert source is not None  # it is of a file
    closed = source.data[element.end : element.end + 2] == b"</"
    return source.line(element.start), source.line(element.end - (not closed))
