"""Shapes and sites of a compiled model, and meshes and textures that smooth motions do not need.

Small built-in meshes replace these: they take hundreds of times longer to compile than the rest,
and their files may be missing.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from physics_crosscheck.reference.mechanism.bodies import Quaternion, Site, Triple
from ..compiled import CompiledShape, Numbers
from ..protocol import Array
from .pulls import as_triple, body_name, numbers_of

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


def without_idle_files(tree: Any, *, contacts: bool = False) -> None:
    """Remove the files of textures and of idle meshes from a specification.

    Args:
        tree: the specification.
        contacts: whether meshes in contact are needed, besides those with inertia.
    """
    needed = {*_meshes_with_inertia(tree), *(_acting_meshes(tree) if contacts else ())}
    missing = _missing_meshes(tree) if contacts else set()
    for mesh in tree.meshes:
        name = mesh.name or Path(mesh.file).stem
        if mesh.file and (name not in needed or name in missing):
            _replace_file(mesh)
    for geom in tree.geoms:
        if geom.meshname in missing:
            geom.contype = geom.conaffinity = 0
    import mujoco

    for texture in tree.textures:
        texture.file, texture.cubefiles = "", [""] * len(texture.cubefiles)
        texture.content_type, texture.gridlayout = "", ""
        texture.builtin = int(mujoco.mjtBuiltin.mjBUILTIN_FLAT)
        texture.width = texture.height = 1


def _replace_file(mesh: Any) -> None:
    """Replace the file of a mesh by a few built-in corners, unless a plugin makes the mesh."""
    if not mesh.plugin.active:
        # Versions before 3.4 name an unnamed mesh after its file when they compile it.
        mesh.name = mesh.name or Path(mesh.file).stem
        mesh.file, mesh.uservert, mesh.userface = "", _CORNERS, _FACES
        mesh.refpos, mesh.refquat, mesh.scale = [0, 0, 0], [1, 0, 0, 0], [1, 1, 1]


def without_mesh_files(tree: Any) -> Mapping[str, Numbers]:
    """Replace the files of all meshes; return the scale of each mesh by name."""
    scales = {mesh.name: numbers_of(mesh.scale) for mesh in tree.meshes}
    for mesh in tree.meshes:
        _replace_file(mesh)
    return scales


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


def _missing_meshes(tree: Any) -> set[str]:
    """Return the names of meshes without a file that only contacts need."""
    import mujoco

    folders, paired = (tree.modelfiledir, tree.meshdir), set[str]()
    for pair in tree.pairs:
        paired |= {pair.geomname1, pair.geomname2}
    used = {
        geom.meshname
        for geom in tree.geoms
        if geom.type != mujoco.mjtGeom.mjGEOM_MESH or geom.fluid_ellipsoid or geom.name in paired
    }
    return {
        name
        for mesh in tree.meshes
        if mesh.file and not Path(_path(*folders, mesh.file)).is_file()
        if (name := mesh.name or Path(mesh.file).stem) not in used
    } - set(_meshes_with_inertia(tree))


def _acting_meshes(tree: Any) -> Iterator[str]:
    """Yield the names of meshes of geoms that may touch or feel a fluid, or are fitted to one."""
    import mujoco

    paired = {name for pair in tree.pairs for name in (pair.geomname1, pair.geomname2)}
    for geom in tree.geoms:
        fitted = geom.type != mujoco.mjtGeom.mjGEOM_MESH
        touches = geom.contype or geom.conaffinity or geom.name in paired
        if geom.meshname and (touches or fitted or geom.fluid_ellipsoid):
            yield geom.meshname


def shape_name(kind: str, name: str, index: int) -> str:
    """Return the place of a geom or a site; one without a name has its index."""
    return f"{kind}:{name or f'#{index}'}"


MeshFile = tuple[str, tuple[float, ...]]
"""Path of a mesh's file, and the factors of its coordinates."""

_NO_MESH: MeshFile = ("", (1.0, 1.0, 1.0))


def mesh_files(tree: Any) -> dict[str, MeshFile]:
    """Return the files of meshes by their names, without those with a reference frame."""
    folders = tree.modelfiledir, tree.meshdir
    return {
        mesh.name or Path(file).stem: (_path(*folders, file), numbers_of(mesh.scale))
        for mesh in tree.meshes
        if (file := mesh.file) and not mesh.refpos.any() and mesh.refquat[0] == 1.0
    }


@lru_cache(maxsize=4096)
def _path(*parts: str) -> str:
    return str(Path(*parts))


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
    return tuple(
        _with_mesh_file(one, meshes.get(one.mesh, _NO_MESH), i in fitted)
        if one.mesh or i in fitted
        else one
        for i, one in enumerate(placed)
    )


# A file is compiled once for each of its numbers: equal shapes are the same object.
@lru_cache(maxsize=4096)
def _with_mesh_file(shape: CompiledShape, mesh: MeshFile, fitted: bool) -> CompiledShape:
    kind = "" if fitted else shape.kind
    file, scale = mesh if shape.mesh else (shape.mesh, shape.scale)
    return replace(shape, kind=kind, mesh=file, scale=scale)


def placed_shapes(m: Any) -> Iterator[CompiledShape]:
    """Yield geoms and sites, in the frames that the file states; `mesh` is a mesh's name."""
    import mujoco

    visual = ((m.geom_contype == 0) & (m.geom_conaffinity == 0)).tolist()
    meshes = [
        (m.mesh(i).name, tuple(place), tuple(turn))
        for i, (place, turn) in enumerate(
            zip(m.mesh_pos.tolist(), m.mesh_quat.tolist(), strict=True)
        )
    ]
    bodies = [body_name(m, i) for i in range(m.nbody)]
    rows = zip(*_columns(m, "geom"), m.geom_dataid.tolist(), visual, strict=True)
    for i, (form, body, position, turn, size, data, unseen) in enumerate(rows):
        name, mesh = shape_name("geom", m.geom(i).name, i), ()
        if form == mujoco.mjtGeom.mjGEOM_MESH:
            mesh = meshes[data]
        kind, count = _FORMS.get(form, ("mesh", 0))
        yield _shape(
            name, kind, bodies[body], *map(tuple, (position, turn, size[:count])), unseen, mesh
        )
    for i, (form, body, position, turn, size) in enumerate(zip(*_columns(m, "site"), strict=True)):
        name, count = shape_name("site", m.site(i).name, i), _FORMS.get(form, ("", 0))[1]
        yield _shape(
            name, "site", bodies[body], *map(tuple, (position, turn, size[:count])), True, ()
        )


def _columns(m: Any, kind: str) -> Iterator[list[Any]]:
    """Yield types, bodies, positions, quaternions and sizes of all geoms or sites."""
    for name in ("type", "bodyid", "pos", "quat", "size"):
        yield getattr(m, f"{kind}_{name}").tolist()


@lru_cache(maxsize=4096)
def _shape(
    name: str,
    kind: str,
    body: str | None,
    position: Triple,
    turn: Quaternion,
    size: Numbers,
    visual: bool,
    mesh: tuple[()] | tuple[str, Numbers, Numbers],
) -> CompiledShape:
    """Return a shape; `mesh` is the name, position and quaternion of its mesh."""
    frame = Site(body=body, position=position, quaternion=turn)
    if mesh:
        frame = _without(frame, *_inverse(*mesh[1:]))
    about = mesh[0] if mesh else ""
    return CompiledShape(name=name, frame=frame, size=size, kind=kind, visual=visual, mesh=about)


def mesh_of(m: Any, i: int) -> int:
    """Return the mesh of a geom, or -1."""
    import mujoco

    is_mesh = m.geom_type[i] == mujoco.mjtGeom.mjGEOM_MESH
    return int(m.geom_dataid[i]) if is_mesh else -1


def mesh_offset(m: Any, mesh: int) -> tuple[Array, Array]:
    """Return the origin (3,) and the quaternion (4,) of a file's mesh in its geom.

    MuJoCo moves each mesh to its center of mass and its principal axes.
    """
    return _inverse(m.mesh_pos[mesh], m.mesh_quat[mesh])


def _inverse(position: Any, turn: Any) -> tuple[Array, Array]:
    """Return the inverse of a pose: origin (3,) and quaternion (4,)."""
    import mujoco

    origin, inverse = np.zeros(3), np.zeros(4)
    mujoco.mju_negPose(origin, inverse, np.array(position), np.array(turn))
    return origin, inverse


def _without(frame: Site, origin: Array, turn: Array) -> Site:
    """Return the frame of a mesh's file, from that of its geom."""
    import mujoco

    position, rotation = np.zeros(3), np.zeros(4)
    outer = np.array(frame.position), np.array(frame.quaternion)
    mujoco.mju_mulPose(position, rotation, *outer, origin, turn)
    w, x, y, z = map(float, rotation)
    return replace(frame, position=as_triple(position), quaternion=(w, x, y, z))
