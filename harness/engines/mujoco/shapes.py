"""Meshes and textures on which no smooth motion depends: replaced by small ones of no file.

To compile them takes hundreds of times as long as all else, and files may lack them.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

_CORNERS = [0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1]
_FACES = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]


def without_idle_files(tree: Any) -> None:
    """Take from a specification the files of textures, and of meshes that make no inertia."""
    needed = set(_meshes_with_inertia(tree))
    for mesh in tree.meshes:
        name = mesh.name or Path(mesh.file).stem
        if name not in needed and mesh.file and not mesh.plugin.active:
            # One without a name is called as its file, by versions before 3.4 when it is compiled.
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
    """Files that a specification is compiled of: meshes, height fields and skins, as it names them.

    Each once.
    """
    shapes = (*tree.meshes, *tree.hfields, *tree.skins)
    return tuple(dict.fromkeys(one.file for one in shapes if one.file))


def _meshes_with_inertia(tree: Any) -> Iterator[str]:
    """Names of meshes from which the inertia of a body follows."""
    import mujoco

    always = tree.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    for body in tree.bodies:
        if always or not body.explicitinertial:
            yield from (geom.meshname for geom in body.geoms if geom.meshname)
