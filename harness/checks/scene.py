"""The scene of a tree for the report: its bodies, and its joints at the compared states."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import get_args

import numpy as np

from physics_crosscheck.harness.modelfiles.robot import PlacedShape
from physics_crosscheck.harness.numerics.stepping import StepDefects
from physics_crosscheck.harness.records.base import Numbers, number, rounded
from physics_crosscheck.harness.records.scene import (
    Scene,
    SceneBody,
    SceneJoint,
    SceneShape,
    ShapeKind,
    StateErrors,
)
from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.mechanism.bodies import RigidBody
from physics_crosscheck.reference.mechanism.chart import MinimalCoordinates
from physics_crosscheck.reference.mechanism.couplings import Coupled
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import to_quaternion
from physics_crosscheck.reference.mechanism.spatial_inertia import Place, SpatialInertia
from physics_crosscheck.reference.mechanism.tree import Tree
from physics_crosscheck.reference.solving.segments import Segments

DIGITS = 7
"""Significant digits of drawn numbers."""

SIZE_DIGITS = 5

_ELEMENTS = ("visual:", "collision:")
"""Beginnings of the names of shapes in URDF and SDFormat files; their meshes are not drawn."""


def scene_record(
    tree: Tree, states: Segments, bodies: Iterable[RigidBody], shapes: Sequence[PlacedShape] = ()
) -> Scene:
    """Return the scene of a tree at the starts of its segments.

    Args:
        tree: the tree; its frames have the names of the bodies.
        states: the segments.
        bodies: the bodies, parents first.
        shapes: shapes of the file.
    """
    n = tree.dof
    coordinates = Coupled(tree).positions(states.start[:, :n].T)
    rates = states.start[:, n:], (states.end - states.start)[:, n:] / states.lengths[:, None]
    velocities, accelerations = (joint_rates(tree, coordinates, one) for one in rates)
    placements = _placements(tree, coordinates)
    return Scene(
        bodies=tuple(_body(tree, one, shapes) for one in bodies),
        joints=tuple(
            SceneJoint(name=link.name, parent=link.parent, twists=_twists(*link.motion))
            for link in tree.links
        ),
        placements=placements,
        velocities=tuple(rounded(row, DIGITS) for row in velocities.tolist()),
        accelerations=tuple(rounded(row, DIGITS) for row in accelerations.tolist()),
        length=number(_length(tree, coordinates)),
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
    """Return a position and a unit quaternion."""
    return rounded([*place.origin.tolist(), *to_quaternion(place.rotation)], DIGITS)


def _length(tree: Tree, coordinates: Array) -> float:
    poses = Recursion(tree).poses(MinimalCoordinates(tree).positions(coordinates))
    return max((float(np.max(np.abs(one.origin), initial=0.0)) for one in poses), default=0.0)


def _body(tree: Tree, body: RigidBody, shapes: Sequence[PlacedShape]) -> SceneBody:
    joint, place = tree.frames[body.name]
    return SceneBody(
        name=body.name,
        joint=joint,
        place=_place(place),
        mass=number(body.mass),
        ellipsoid=_ellipsoid(body.spatial_inertia),
        shapes=tuple(map(_shape, _drawn([one for one in shapes if one.body == body.name]))),
    )


def _drawn(shapes: Sequence[PlacedShape]) -> Sequence[PlacedShape]:
    """Return the visual shapes of a link of a URDF or SDFormat file, or all without any."""
    solids = [one for one in shapes if one.kind != "mesh" or not one.name.startswith(_ELEMENTS)]
    return [one for one in solids if one.name.startswith("visual:")] or solids


def _shape(shape: PlacedShape) -> SceneShape:
    return SceneShape(
        kind=_kind(shape),
        size=rounded(shape.size, SIZE_DIGITS),
        place=_place(shape.place),
        visual=shape.visual,
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


def errors_record(
    tree: Tree, states: Segments, names: tuple[str, ...], defects: StepDefects, apart: Array | None
) -> StateErrors:
    """Return the errors of a case by coordinate and state.

    Args:
        tree: the tree.
        states: the segments.
        names: names of the coordinates, (n,).
        defects: relative differences and uncertainties, (K, 2n) each.
        apart: ends of the segments in the engine minus those in the equations, (K, 2n); None if
            single steps decide. Unused where no error exceeds its uncertainty.
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
    )


def _differences(tree: Tree, states: Segments, apart: Array) -> tuple[Numbers, ...]:
    """Return differences of mean accelerations, by velocity coordinate and state."""
    n = tree.dof
    coordinates = Coupled(tree).positions(states.start[:, :n].T)
    rates = apart[:, n:] / states.lengths[:, None]
    return tuple(rounded(row, DIGITS) for row in joint_rates(tree, coordinates, rates).tolist())
