"""Replacement of meshes and textures that do not affect smooth motions by small built-in ones.

They take hundreds of times longer to compile than the rest, and their files may be missing.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

_CORNERS = [0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1]
_FACES = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]


def without_idle_files(tree: Any) -> None:
    """Remove the files of textures, and of meshes without inertia, from a specification."""
    needed = set(_meshes_with_inertia(tree))
    for mesh in tree.meshes:
        name = mesh.name or Path(mesh.file).stem
        if name not in needed and mesh.file and not mesh.plugin.active:
            # Versions before 3.4 name an unnamed mesh after its file when they compile it.
            mesh.name = name
            mesh.file, mesh.uservert, mesh.userface = "", _CORNERS, _FACES
            mesh.refpos, mesh.refquat, mesh.scale = [0, 0, 0], [1, 0, 0, 0], [1, 1, 1]
    import mujoco

    for texture in tree.textures:
        texture.file, texture.cubefiles = "", [""] * len(texture.cubefiles)
        texture.content_type, texture.gridlayout = "", ""
        texture.builtin = int(mujoco.mjtBuiltin.mjBUILTIN_FLAT)
        texture.width = texture.height = 1


def files_of_shapes(tree: Any) -> tuple[str, ...]:
    """Return the files of meshes, height fields and skins, as the specification names them.

    Each file appears once.
    """
    shapes = (*tree.meshes, *tree.hfields, *tree.skins)
    return tuple(dict.fromkeys(one.file for one in shapes if one.file))


def _meshes_with_inertia(tree: Any) -> Iterator[str]:
    """Yield the names of meshes that determine the inertia of a body."""
    import mujoco

    always = tree.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    for body in tree.bodies:
        if always or not body.explicitinertial:
            yield from (geom.meshname for geom in body.geoms if geom.meshname)
