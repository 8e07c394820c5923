"""Masses, centers and moments of bodies: what layers state, and what follows from shapes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from physics_crosscheck.harness.documents.sdf.frames import inverse, solid
from physics_crosscheck.harness.documents.usd import UsdStage
from physics_crosscheck.reference.mechanism.rotations import (
    NO_INERTIA,
    Array,
    Place,
    SpatialInertia,
    from_quaternion,
)

WATER = 1000.0
"""Density of shapes for which no layer states one, kg/m^3."""


def mass_of(stage: UsdStage, prim: Any, place: Place) -> SpatialInertia:
    """Return mass, center of mass and inertia of a body, in its frame, about the center.

    A mass of 0, moments of 0 and a center that is not finite are unset: they follow from the
    collision shapes below the body, whose own masses and densities count first.

    Args:
        stage: the stage.
        prim: of the body.
        place: its frame in the world.
    """
    mass, center, tensor = _stated(stage, prim)
    if mass is not None and center is not None and tensor is not None:
        return SpatialInertia(mass, center, tensor)
    shapes = NO_INERTIA
    for inertia in _shapes(stage, prim, place):
        shapes = shapes.combined(inertia)
    whole = shapes.mass if mass is None else mass
    if tensor is None:
        tensor = shapes.inertia * (whole / shapes.mass if shapes.mass else 0.0)
    return SpatialInertia(whole, shapes.center if center is None else center, tensor)


def _stated(stage: UsdStage, prim: Any) -> tuple[float | None, Array | None, Array | None]:
    """Return the mass, center and tensor that layers state for a body or a shape."""
    unit, kilograms = stage.unit, stage.mass_unit
    mass = stage.value(prim, "physics:mass", 0.0)
    center = np.array(stage.value(prim, "physics:centerOfMass", (-math.inf,) * 3), dtype=float)
    is_stated = np.isfinite(center).all()
    placed = center * stage.world(prim)[1] * unit if is_stated else None
    tensor = _tensor(stage, prim)
    scaled = None if tensor is None else tensor * kilograms * unit**2
    return (mass * kilograms if mass > 0 else None), placed, scaled


def _tensor(stage: UsdStage, prim: Any) -> Array | None:
    """Return the stated moments in the body's axes, in units of the stage; None if unset."""
    six = stage.stated(prim, "newton:inertia") if is_applied(prim, "NewtonMassAPI") else None
    if isinstance(six, tuple) and len(six) == 6:
        xx, yy, zz, xy, xz, yz = six
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    moments = np.array(stage.value(prim, "physics:diagonalInertia", (0.0, 0.0, 0.0)), dtype=float)
    if not moments.any():
        return None
    axes = np.array(stage.value(prim, "physics:principalAxes", (0.0,) * 4), dtype=float)
    length = np.linalg.norm(axes)
    turn = from_quaternion(axes / length) if length else np.eye(3)
    tensor: Array = turn @ np.diag(moments) @ turn.T
    return tensor


def is_applied(prim: Any, schema: str) -> bool:
    """Return whether a schema is applied to a prim, registered or not."""
    listed = prim.GetMetadata("apiSchemas")
    items = listed.GetAddedOrExplicitItems() if listed else ()
    return schema in (*prim.GetAppliedSchemas(), *items)


def _shapes(stage: UsdStage, body: Any, place: Place) -> Iterator[SpatialInertia]:
    """Yield the inertias of the shapes of a body, in its frame."""
    usd, physics = stage.pxr.Usd, stage.pxr.UsdPhysics
    prims = iter(usd.PrimRange(body, usd.TraverseInstanceProxies()))
    for prim in prims:
        if prim != body and prim.HasAPI(physics.RigidBodyAPI):
            prims.PruneChildren()
        elif prim.HasAPI(physics.CollisionAPI) and stage.value(
            prim, "physics:collisionEnabled", default=True
        ):
            inertia = _shape(stage, prim, body)
            if inertia is not None:
                there = inverse(place).compose(stage.world(prim)[0])
                yield inertia.in_frame(there)


def _shape(stage: UsdStage, prim: Any, body: Any) -> SpatialInertia | None:
    """Return the inertia of a shape in its own frame; None for one without volume."""
    volume, center, moments = _solid(stage, prim)
    mass, placed, tensor = _stated(stage, prim)
    if not volume and (mass is None or tensor is None):
        return None
    whole = volume * _density(stage, prim, body) if mass is None else mass
    return SpatialInertia(
        whole, center if placed is None else placed, whole * moments if tensor is None else tensor
    )


def _density(stage: UsdStage, prim: Any, body: Any) -> float:
    """Return the density of a shape, kg/m^3: its own, its body's, its material's, or water's."""
    unit = stage.mass_unit / stage.unit**3
    binding = stage.pxr.UsdShade.MaterialBindingAPI(prim)
    material = binding.ComputeBoundMaterial("physics")[0].GetPrim()
    for owner in (prim, body, material):
        density = stage.value(owner, "physics:density", 0.0) if owner else 0.0
        if density > 0:
            return float(density * unit)
    return WATER


def _solid(stage: UsdStage, prim: Any) -> tuple[float, Array, Array]:
    """Return volume, center and moments for a mass of 1 of a shape, in its own frame, in m."""
    kind, scale = str(prim.GetTypeName()), abs(stage.world(prim)[1]) * stage.unit
    none = 0.0, np.zeros(3), np.zeros((3, 3))
    if kind == "Mesh":
        return _mesh(prim, scale) or none
    if kind == "Cube":
        parts = solid("box", (scale * stage.value(prim, "size", 2.0)).tolist())
        return parts[0], np.zeros(3), np.diag(parts[2])
    if kind == "Sphere":
        parts = solid("sphere", [scale.max() * stage.value(prim, "radius", 1.0)])
        return parts[0], np.zeros(3), np.diag(parts[2])
    if kind not in ("Cylinder", "Capsule", "Cone"):
        return none
    axis = "XYZ".index(str(stage.value(prim, "axis", "Z")))
    defaults = (0.5, 1.0) if kind == "Capsule" else (1.0, 2.0)
    radius = stage.value(prim, "radius", defaults[0]) * np.delete(scale, axis).max()
    length = stage.value(prim, "height", defaults[1]) * scale[axis]
    volume, along, moments = solid(kind.lower(), (radius, length))
    order = np.roll([0, 1, 2], axis + 1)  # the shape's z is this axis
    return volume, along * np.eye(3)[axis], np.diag(np.array(moments)[order])


def _mesh(prim: Any, scale: Array) -> tuple[float, Array, Array] | None:
    """Return those of a closed mesh by its triangles; None if it has no volume."""
    points = np.array(prim.GetAttribute("points").Get() or (), dtype=float).reshape(-1, 3) * scale
    counts = np.array(prim.GetAttribute("faceVertexCounts").Get() or (), dtype=int)
    corners = np.array(prim.GetAttribute("faceVertexIndices").Get() or (), dtype=int)
    if not len(points) or counts.sum() != len(corners) or len(corners) == 0:
        return None
    starts = np.repeat(np.cumsum(counts) - counts, np.maximum(counts - 2, 0))
    fan = np.concatenate([np.arange(max(count - 2, 0)) for count in counts.tolist()])
    triangles = points[corners[np.stack([starts, starts + fan + 1, starts + fan + 2], axis=1)]]
    volumes = np.einsum("ni,ni->n", triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2])) / 6
    volume = float(volumes.sum())
    if abs(volume) < 1e-300:
        return None
    sums = triangles.sum(axis=1)
    center = (volumes[:, None] * sums).sum(axis=0) / (4 * volume)
    # Second moments of a tetrahedron with one corner at the origin.
    second = np.einsum("n,nki,nkj->ij", volumes, triangles, triangles)
    second = (second + np.einsum("n,ni,nj->ij", volumes, sums, sums)) / (20 * volume)
    second -= np.outer(center, center)
    return abs(volume), center, np.trace(second) * np.eye(3) - second
