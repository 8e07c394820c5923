"""Masses, centers and moments of bodies: what layers state, and what follows from shapes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import reduce
from typing import Any

import numpy as np

from physics_crosscheck.harness.documents.sdf.frames import WATER, inverse, solid
from physics_crosscheck.harness.documents.usd import UsdStage
from physics_crosscheck.reference.mechanism.rotations import (
    NO_INERTIA,
    Array,
    SpatialInertia,
    from_quaternion,
)


def mass_of(stage: UsdStage, prim: Any) -> SpatialInertia:
    """Return mass, center of mass and inertia of a body, in its frame, about the center.

    A mass of 0, moments of 0 and a center that is not finite are unset: they follow from the
    collision shapes below the body, whose own masses and densities count first.
    """
    mass, center, tensor = stated_of(stage, prim)
    if mass is not None and center is not None and tensor is not None:
        return SpatialInertia(mass, center, tensor)
    shapes = reduce(SpatialInertia.combined, _shapes(stage, prim), NO_INERTIA)
    whole = shapes.mass if mass is None else mass
    if tensor is None:
        tensor = shapes.inertia * (whole / shapes.mass if shapes.mass else 0.0)
    return SpatialInertia(whole, shapes.center if center is None else center, tensor)


def stated_of(stage: UsdStage, prim: Any) -> tuple[float | None, Array | None, Array | None]:
    """Return the mass, center and tensor that layers state for a body or a shape."""
    mass = stage.value(prim, "physics:mass", 0.0)
    center = np.array(stage.value(prim, "physics:centerOfMass", (-math.inf,) * 3))
    is_stated = np.isfinite(center).all()
    placed = center * stage.world(prim)[1] * stage.unit if is_stated else None
    tensor = _tensor(stage, prim)
    scaled = None if tensor is None else tensor * stage.mass_unit * stage.unit**2
    return (mass * stage.mass_unit if mass else None), placed, scaled


def _tensor(stage: UsdStage, prim: Any) -> Array | None:
    # With schemas that no package registers.
    schemas = {*prim.GetAppliedSchemas(), *prim.GetPrimTypeInfo().GetAppliedAPISchemas()}
    six = stage.stated(prim, "newton:inertia") if "NewtonMassAPI" in schemas else None
    if isinstance(six, tuple) and len(six) == 6:
        xx, yy, zz, xy, xz, yz = six
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    moments = stage.value(prim, "physics:diagonalInertia", (0.0, 0.0, 0.0))
    if not any(moments):
        return None
    turn = rotation_of(stage.value(prim, "physics:principalAxes", (0.0,) * 4))
    tensor: Array = turn @ np.diag(moments) @ turn.T
    return tensor


def rotation_of(quaternion: tuple[float, ...]) -> Array:
    """Return the rotation of a quaternion of any length; none for one without length."""
    q = np.array(quaternion, dtype=float)
    length = np.linalg.norm(q)
    rotation: Array = from_quaternion(q / length) if length else np.eye(3)
    return rotation


def _shapes(stage: UsdStage, body: Any) -> Iterator[SpatialInertia]:
    """Yield the inertias of the shapes of a body, in its frame; one without volume has none."""
    usd, physics, outer = stage.pxr.Usd, stage.pxr.UsdPhysics, inverse(stage.world(body)[0])
    prims = iter(usd.PrimRange(body, usd.TraverseInstanceProxies()))
    for prim in prims:
        if prim != body and prim.HasAPI(physics.RigidBodyAPI):
            prims.PruneChildren()
            continue
        is_on = stage.value(prim, "physics:collisionEnabled", default=True)
        if not is_on or not prim.HasAPI(physics.CollisionAPI):
            continue
        volume, middle, moments = _solid(stage, prim)
        mass, center, tensor = stated_of(stage, prim)
        if volume or (mass is not None and tensor is not None):
            mass = volume * _density(stage, prim, body) if mass is None else mass
            center = middle if center is None else center
            inertia = SpatialInertia(mass, center, mass * moments if tensor is None else tensor)
            yield inertia.in_frame(outer.compose(stage.world(prim)[0]))


def _density(stage: UsdStage, prim: Any, body: Any) -> float:
    """Return the density of a shape, kg/m^3: its own, its body's, its material's, or water's."""
    binding = stage.pxr.UsdShade.MaterialBindingAPI(prim)
    material = binding.ComputeBoundMaterial("physics")[0].GetPrim()
    for owner in (prim, body, material):
        density = float(stage.value(owner, "physics:density", 0.0))
        if density > 0:
            return density * (stage.mass_unit / stage.unit**3)
    return WATER


def _solid(stage: UsdStage, prim: Any) -> tuple[float, Array, Array]:
    """Return volume, center and moments for a mass of 1 of a shape, in its own frame, in m."""
    kind, scale = str(prim.GetTypeName()), abs(stage.world(prim)[1]) * stage.unit
    center = np.zeros(3)
    if kind == "Mesh":
        return _mesh(prim, scale) or (0.0, center, np.zeros((3, 3)))
    if kind == "Cube":
        volume, _, moments = solid("box", (scale * stage.value(prim, "size", 2.0)).tolist())
    elif kind == "Sphere":
        volume, _, moments = solid("sphere", [scale.max() * stage.value(prim, "radius", 1.0)])
    elif kind in ("Cylinder", "Capsule", "Cone"):
        axis = "XYZ".index(str(stage.value(prim, "axis", "Z")))
        defaults = (0.5, 1.0) if kind == "Capsule" else (1.0, 2.0)
        radius = stage.value(prim, "radius", defaults[0]) * np.delete(scale, axis).max()
        length = stage.value(prim, "height", defaults[1]) * scale[axis]
        volume, center[axis], around = solid(kind.lower(), (radius, length))
        x, y, z = np.roll(around, axis + 1).tolist()  # the shape's z is this axis
        moments = x, y, z
    else:
        return 0.0, center, np.zeros((3, 3))
    return volume, center, np.diag(moments)


def _mesh(prim: Any, scale: Array) -> tuple[float, Array, Array] | None:
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
