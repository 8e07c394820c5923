"""Files of meshes, and the triangles in them."""

import re
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.documents.expanded import is_irregular, locate_file
from physics_crosscheck.harness.records.scene import MeshProblem, UnreadMesh
from physics_crosscheck.reference.mechanism.rotations import Array
from .robot import PlacedShape

MAX_MESH_BYTES = 40_000_000
"""Largest file of a mesh that is read."""

_COLLADA_HEAD = 1_000_000
"""Number of bytes of a COLLADA file in which its unit and upper axis are looked for."""

_COLLADA_UNIT = re.compile(rb"<unit\b[^>]*\bmeter\s*=\s*[\"']([^\"']+)[\"']")

_FINEST = 400
"""Most cells along the longest edge of a decimated mesh."""

_TO_THE_MIDDLE = 0.01
"""Weight of the mean of merged vertices beside the planes of their faces."""


class MeshError(ValueError):
    """A mesh that can't be read; the message names the file and the reason."""

    problem: MeshProblem = "unreadable"


def unread_meshes(shapes: Iterable[PlacedShape]) -> tuple[UnreadMesh, ...]:
    """Return the meshes of shapes whose files are missing, empty or can't be read, each once."""
    problems = {
        PurePosixPath(name).name: problem
        for file, name in dict.fromkeys((one.file, one.mesh) for one in shapes if one.mesh)
        if (problem := _problem(file, name))
    }
    return tuple(UnreadMesh(name=name, problem=problem) for name, problem in problems.items())


def _problem(model: Path, name: str) -> MeshProblem | None:
    file = locate_file(model, name)
    if file is None:
        return "not a regular file" if is_irregular(model, name) else "missing"
    try:
        read_mesh(file)
    except MeshError as error:
        return error.problem if error.problem != "unreadable" or file.stat().st_size else "empty"
    return None


class Mesh(NamedTuple):
    """Triangles: points, (n, 3), in the file's unit or in meters for COLLADA; corners, (m, 3)."""

    points: Array
    faces: NDArray[np.int64]


@lru_cache(maxsize=256)
def read_mesh(file: Path) -> Mesh:
    """Return the triangles of a mesh, with the vertices that they use.

    A COLLADA file states its unit, which engines apply. In glTF, y is up; engines turn it to z.

    Raises:
        MeshError: if it can't be read.
    """
    try:
        import trimesh

        if file.exists() and not file.is_file():  # opening a pipe waits for its writer
            raise MeshError(f"{file}: not a regular file")
        if file.stat().st_size > MAX_MESH_BYTES:
            raise MeshError(f"{file}: larger than {MAX_MESH_BYTES / 1e6:.0f} MB")
        unit = _COLLADA_UNIT.search(_collada_head(file))
        scene = trimesh.load_scene(file, process=False, skip_materials=True)
        scale = 1.0 if unit is None else float(unit[1])
        parts = [_used(one, scale) for one in scene.dump() if hasattr(one, "faces")]
    except MeshError:
        raise
    except ImportError as error:
        missing = MeshError(f"{file}: {error}; install this module")
        missing.problem = "without a reader"
        raise missing from None
    except Exception as error:  # each format's parser has its own errors
        raise MeshError(f"{file}: {type(error).__name__}: {error}") from None
    if file.suffix.lower() in (".gltf", ".glb"):
        parts = [one._replace(points=one.points[:, [0, 2, 1]] * (1, -1, 1)) for one in parts]
    starts = np.cumsum([0, *(len(one.points) for one in parts)])
    mesh = Mesh(
        np.concatenate([np.zeros((0, 3)), *(one.points for one in parts)]),
        np.concatenate(
            [np.zeros((0, 3), int), *(one.faces + n for one, n in zip(parts, starts, strict=False))]
        ),
    )
    if not len(mesh.points) or not np.isfinite(mesh.points).all():
        raise MeshError(f"{file}: no vertices")
    return mesh


def _used(mesh: Any, scale: float) -> Mesh:
    """Return a part without the vertices that no face uses, scaled."""
    used, corners = np.unique(np.asarray(mesh.faces), return_inverse=True)
    return Mesh(scale * np.asarray(mesh.vertices, float)[used], corners.reshape(-1, 3))


def _collada_head(file: Path) -> bytes:
    """Return the beginning of a COLLADA file, with its unit and upper axis; else nothing."""
    if file.suffix.lower() != ".dae":
        return b""
    with file.open("rb") as opened:
        return opened.read(_COLLADA_HEAD)


@lru_cache(maxsize=512)
def decimated_mesh(file: Path, faces: int) -> Mesh:
    """Return a mesh with at most a number of triangles, for a picture.

    Raises:
        MeshError: if it can't be read.
    """
    fine, cells = _merged(read_mesh(file), _FINEST), float(_FINEST)
    result = fine
    while len(result.faces) > faces:  # their number is about that of cells on a surface
        cells *= min(0.9, (0.9 * faces / len(result.faces)) ** 0.5)
        result = _merged(fine, cells)
    return result if cells == _FINEST else _merged(fine, cells, sharp=True)


def _merged(mesh: Mesh, cells: float, sharp: bool = False) -> Mesh:
    points, low = mesh.points, np.min(mesh.points, axis=0)
    size = float(np.max(np.ptp(points, axis=0))) / cells or 1.0
    grid = np.floor((points - low) / size).astype(np.int64)
    owner = np.unique(grid @ np.array([1, 1 << 20, 1 << 40]), return_inverse=True)[1].ravel()
    count = np.bincount(owner)
    places = np.stack([np.bincount(owner, axis) / count for axis in points.T], axis=1)
    corners = owner[mesh.faces]
    if sharp:
        moved = np.clip(_to_planes(mesh, corners, places), -size, size)
        places = np.clip(places + moved, low, np.max(points, axis=0))
    solid = np.all(corners != np.roll(corners, 1, axis=1), axis=1)
    alike = np.sort(corners[solid], axis=1) @ np.array([1, len(count), len(count) ** 2])
    first = np.unique(alike, return_index=True)[1]
    kept, faces = np.unique(corners[solid][first], return_inverse=True)
    return Mesh(places[kept], faces.reshape(-1, 3))


def _to_planes(mesh: Mesh, corners: NDArray[np.int64], places: Array) -> Array:
    """Return displacements of merged vertices to the planes of their faces, (n, 3).

    Source: Lindstrom 2000, Out-of-core simplification of large polygonal models.

    Args:
        mesh: before it was merged.
        corners: merged vertex at each corner of its faces, (m, 3).
        places: the merged vertices, (n, 3).
    """
    count = len(places)
    a, b, c = (mesh.points[mesh.faces[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)  # long for large faces
    matrix, moments = np.zeros((3, 3, count)), np.zeros((3, count))
    for corner in corners.T:
        away = np.einsum("fi,fi->f", normals, a - places[corner])
        for i in range(3):
            moments[i] += np.bincount(corner, normals[:, i] * away, count)
            for j in range(3):
                matrix[i, j] += np.bincount(corner, normals[:, i] * normals[:, j], count)
    weight = np.where(trace := np.trace(matrix), trace, 1.0)
    stiff = np.moveaxis(matrix / weight, 2, 0) + _TO_THE_MIDDLE * np.eye(3)
    moved = np.linalg.solve(stiff, (moments / weight).T[:, :, None])[:, :, 0]
    return np.asarray(moved, dtype=np.float64)


def mesh_vertices(file: Path) -> Array:
    """Return the vertices of a mesh, (n, 3), as `read_mesh` does.

    Raises:
        MeshError: if it can't be read, or if its axes are turned in some programs: those of a
            COLLADA file whose `up_axis` is Y, which Assimp turns, and rviz does not.
    """
    points = read_mesh(file).points
    if b"<up_axis>Y_UP" in _collada_head(file):
        raise MeshError(f"{file}: its up_axis is Y, which some programs turn to Z and some do not")
    return points
