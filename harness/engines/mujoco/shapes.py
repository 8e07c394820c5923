"""Shapes and sites of a compiled model, and meshes and textures that smooth motions do not need.

Small built-in meshes replace these: they take hundreds of times longer to compile than the rest,
and their files may be missing.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.compiled import CompiledFrame, CompiledShape
from physics_crosscheck.harness.engines.mujoco.pulls import numbers_of
from physics_crosscheck.harness.engines.protocol import Array

_FORMS = {
    0: ("plane", 3),
    2: ("sphere", 1),
    3: ("capsule", 2),
    4: ("ellipsoid", 3),
    5: ("cylinder", 2),
    6: ("box", 3),
}
"""Form of a geom and count of the numbers of its size, by its type."""

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


def shape_name(kind: str, name: str, index: int) -> str:
    """Return the place of a geom or a site; one without a name has its index."""
    return f"{kind}:{name or f'#{index}'}"


MeshFile = tuple[str, tuple[float, ...]]
"""Path of a mesh's file, and the factors of its coordinates."""

_NO_MESH: MeshFile = ("", (1.0, 1.0, 1.0))


def mesh_files(tree: Any) -> dict[str, MeshFile]:
    """Return the files of meshes by their names, without those with a reference frame."""
    folder = Path(tree.modelfiledir, tree.meshdir)
    return {
        mesh.name or Path(mesh.file).stem: (str(folder / mesh.file), numbers_of(mesh.scale))
        for mesh in tree.meshes
        if mesh.file and not np.any(mesh.refpos) and mesh.refquat[0] == 1.0
    }


def fitted_shapes(tree: Any) -> frozenset[int]:
    """Return the indices of geoms of a compiled specification that are fitted to a mesh."""
    import mujoco

    mesh = mujoco.mjtGeom.mjGEOM_MESH
    return frozenset(one.id for one in tree.geoms if one.meshname and one.type != mesh)


def with_mesh_files(
    placed: Iterable[CompiledShape], meshes: Mapping[str, MeshFile], fitted: Collection[int]
) -> tuple[CompiledShape, ...]:
    """Return shapes with the files of their meshes in place of the meshes' names.

    Fitted shapes have no kind: they are fitted to a mesh that replaces the file's.
    """
    rows = [
        (replace(one, kind="") if i in fitted else one, *meshes.get(one.mesh, _NO_MESH))
        for i, one in enumerate(placed)
    ]
    return tuple(
        replace(one, mesh=file, scale=scale) if one.mesh else one for one, file, scale in rows
    )


def placed_shapes(m: Any) -> Iterator[CompiledShape]:
    """Yield geoms and sites, in the frames that the file states; `mesh` is a mesh's name."""
    for i in range(m.ngeom):
        frame = _frame(m.geom_bodyid[i], m.geom_pos[i], m.geom_quat[i])
        if (mesh := mesh_of(m, i)) >= 0:
            frame = _without(frame, *mesh_offset(m, mesh))
        kind, count = _FORMS.get(int(m.geom_type[i]), ("mesh", 0))
        name, size = shape_name("geom", m.geom(i).name, i), numbers_of(m.geom_size[i][:count])
        visual = not (m.geom_contype[i] or m.geom_conaffinity[i])
        yield CompiledShape(
            name=name,
            frame=frame,
            size=size,
            kind=kind,
            visual=visual,
            mesh=m.mesh(mesh).name if mesh >= 0 else "",
        )
    for i in range(m.nsite):
        frame = _frame(m.site_bodyid[i], m.site_pos[i], m.site_quat[i])
        count = _FORMS.get(int(m.site_type[i]), ("", 0))[1]
        name, size = shape_name("site", m.site(i).name, i), numbers_of(m.site_size[i][:count])
        yield CompiledShape(name=name, frame=frame, size=size, kind="site", visual=True)


def mesh_of(m: Any, i: int) -> int:
    """Return the mesh of a geom, or -1."""
    import mujoco

    is_mesh = m.geom_type[i] == mujoco.mjtGeom.mjGEOM_MESH
    return int(m.geom_dataid[i]) if is_mesh else -1


def mesh_offset(m: Any, mesh: int) -> tuple[Array, Array]:
    """Return the origin (3,) and the quaternion (4,) of a file's mesh in its geom.

    MuJoCo moves each mesh to its center of mass and its principal axes.
    """
    import mujoco

    origin, turn = np.zeros(3), np.zeros(4)
    place = np.array(m.mesh_pos[mesh]), np.array(m.mesh_quat[mesh])
    mujoco.mju_negPose(origin, turn, *place)
    return origin, turn


def _frame(body: Any, position: Any, turn: Any) -> CompiledFrame:
    return CompiledFrame(body=int(body), position=numbers_of(position), turn=numbers_of(turn))


def _without(frame: CompiledFrame, origin: Array, turn: Array) -> CompiledFrame:
    """Return the frame of a mesh's file, from that of its geom."""
    import mujoco

    position, rotation = np.zeros(3), np.zeros(4)
    outer = np.array(frame.position), np.array(frame.turn)
    mujoco.mju_mulPose(position, rotation, *outer, origin, turn)
    return _frame(frame.body, position, rotation)
