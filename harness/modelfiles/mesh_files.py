"""Files of meshes: where a model's names lead, and the vertices in them."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np

from physics_crosscheck.reference.mechanism.rotations import Array

MAX_MESH_BYTES = 40_000_000
"""Largest file of a mesh that is read."""

_PACKAGE_PATHS = ("ROS_PACKAGE_PATH",)
"""Environment variables with folders that contain packages."""

_COLLADA_HEAD = 1_000_000
"""Number of bytes of a COLLADA file in which its asset is looked for."""

_COLLADA_UNIT = re.compile(rb"<unit\b[^>]*\bmeter\s*=\s*[\"']([^\"']+)[\"']")

_PREFIX_PATHS = ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH")
"""Environment variables with folders whose `share` contains packages."""


class MeshError(ValueError):
    """A mesh that can't be read; the message names the file and the reason."""


def locate_mesh(model: Path, name: str) -> Path | None:
    """Return the file that a model file means by a name, or None if it does not exist.

    A name with a scheme, such as `package://robot/meshes/arm.stl`, is looked up in the packages of
    the environment, then in the folders above the model.
    """
    return next((path for path in _places(model, name) if path.is_file()), None)


def _places(model: Path, name: str) -> Iterator[Path]:
    scheme, _, rest = name.partition("://")
    if not rest:
        yield model.parent / name
        return
    if scheme == "file":
        yield Path(unquote(urlsplit(name).path))
        return
    package, _, inner = rest.partition("/")
    for folder in package_folders(package):
        yield folder / inner
    for above in model.absolute().parents:
        yield above / rest  # the folder of packages
        if above.name == package:
            yield above / inner
    for above in list(model.absolute().parents)[:6]:  # a copy of the package under another name
        yield above / inner


def package_folders(package: str) -> Iterator[Path]:
    """Yield the possible folders of a package, as ROS 1 and ROS 2 look it up."""
    for variable in _PREFIX_PATHS:
        for folder in filter(None, os.environ.get(variable, "").split(os.pathsep)):
            yield Path(folder, "share", package)
    for variable in _PACKAGE_PATHS:
        for folder in filter(None, os.environ.get(variable, "").split(os.pathsep)):
            yield from (Path(folder, package), *([Path(folder)] * (Path(folder).name == package)))


@lru_cache(maxsize=256)
def mesh_vertices(file: Path) -> Array:
    """Return the vertices of a mesh, (n, 3): in its file's unit, and in meters for COLLADA.

    A COLLADA file states its unit, which engines apply.

    Raises:
        MeshError: if it can't be read, or if its axes are turned in some programs: those of a
            COLLADA file whose `up_axis` is Y, which Assimp turns, and rviz does not.
    """
    try:
        import trimesh

        if file.stat().st_size > MAX_MESH_BYTES:
            raise MeshError(f"{file}: larger than {MAX_MESH_BYTES / 1e6:.0f} MB")
        unit = _collada_unit(file) if file.suffix.lower() == ".dae" else 1.0
        scene = trimesh.load_scene(file, process=False, skip_materials=True)
        meshes = [one for one in scene.dump() if hasattr(one, "faces")]
        # A file may list vertices that no face uses.
        parts = [np.asarray(one.vertices, float)[np.unique(one.faces)] for one in meshes]
    except MeshError:
        raise
    except Exception as error:  # each format's parser has its own errors
        raise MeshError(f"{file}: {type(error).__name__}: {error}") from None
    points = unit * np.concatenate(parts) if parts else np.zeros((0, 3))
    if not len(points) or not np.isfinite(points).all():
        raise MeshError(f"{file}: no vertices")
    return points


def _collada_unit(file: Path) -> float:
    """Return the meters of a COLLADA file's unit.

    Raises:
        MeshError: if the y axis is its upper one.
    """
    with file.open("rb") as opened:
        head = opened.read(_COLLADA_HEAD)
    if b"<up_axis>Y_UP" in head:
        raise MeshError(f"{file}: its up_axis is Y, which some programs turn to Z and some do not")
    unit = _COLLADA_UNIT.search(head)
    return 1.0 if unit is None else float(unit[1])
