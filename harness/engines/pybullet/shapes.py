"""Collision shapes of a loaded URDF: their frames in the links, and their sizes, as PyBullet reads
them.

They are read from a copy in which a cube of `pybullet_data` replaces each mesh: meshes take longer
to load than the rest, and their files may be missing. PyBullet reports the numbers of a cylinder
only with `URDF_USE_IMPLICIT_CYLINDER`; without the flag it is a polyhedron with 32 sides.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.reference.mechanism.rotations import Place, from_quaternion
from ..protocol import ShapeError
from ..urdf_copy import collision_shapes
from .base import real_first
from .stepper import link_places

Numbers = Sequence[float]

_SIZES: Mapping[str, Callable[[Numbers], tuple[float, ...]]] = MappingProxyType(
    {
        "box": lambda edges: tuple(edge / 2 for edge in edges),
        "sphere": lambda radii: (radii[0],),
        "cylinder": lambda sizes: (sizes[1], sizes[0] / 2),
        "capsule": lambda sizes: (sizes[1], sizes[0] / 2),
        "mesh": tuple,
    }
)
"""Half sizes of each form, m, or a mesh's scale, from the numbers that PyBullet reports."""


class LinkShape(NamedTuple):
    """A collision shape: the place of its link, its frame in the link, and its half sizes,
    m, or a mesh's scale.
    """

    link: str
    frame: Place
    size: tuple[float, ...]


def simple_shapes(robot: XmlElement) -> None:
    """Replace meshes by cubes, and remove the forms that have no size here."""
    import pybullet_data

    cube = str(Path(pybullet_data.getDataPath()) / "cube.obj")
    for link in robot.findall("link"):
        for shape in link.findall("collision"):
            form = shape.find("geometry/*")
            if form is None or form.tag not in _SIZES:
                link.remove(shape)
            elif form.tag == "mesh":
                form.set("filename", cube)


LARGEST = 1e6
"""Length of a bounding box from which on PyBullet stops simulating a body, m."""


def refuse_large_shapes(body: int, robot: XmlElement, *, floating: bool) -> None:
    """Refuse moving links whose bounding box makes PyBullet stop their simulation.

    Meshes and scales that are not finite do so, and planes.
    Source: `btCollisionWorld::updateSingleAabb`.

    Raises:
        ShapeError: naming file, line, link and meshes.
    """
    import pybullet as p

    moves = {-1: floating}
    for joint in range(p.getNumJoints(body)):
        info = p.getJointInfo(body, joint)
        moves[joint] = info[2] != p.JOINT_FIXED or moves[info[16]]
    places = {name: index for name, index in link_places(body).items() if moves[index]}
    for link in robot.findall("link"):
        index = places.get(f"link:{link.get('name')}")
        box = np.zeros((2, 3)) if index is None else np.array(p.getAABB(body, index))
        if not np.linalg.norm(box[1] - box[0]) < LARGEST:
            planes = link.findall("collision/geometry/plane")
            shapes = planes or link.findall("collision/geometry/mesh")
            names = ", ".join(one.get("filename", f"its {one.tag}") for one in shapes)
            file, line = (*shapes, link)[0].place
            raise ShapeError(
                f"the shape of link {link.get('name')!r} is larger than 1000 km or not finite, so "
                f"PyBullet stops simulating the link; check {names or 'its collision geometry'}",
                file=file,
                line=line,
            )


def link_shapes(body: int, robot: XmlElement) -> Mapping[str, LinkShape]:
    """Return the collision shapes of a body with `simple_shapes`, by name.

    Args:
        body: PyBullet's index.
        robot: the file as it was.
    """
    import pybullet as p

    by_name = {link.get("name", ""): link for link in robot.findall("link")}
    shapes = {}
    for place, index in link_places(body).items():
        link = by_name.get(place.removeprefix("link:"))
        if link is None:
            continue
        # PyBullet reports frames in the principal axes of the link.
        inertial = _place(*p.getDynamicsInfo(body, index)[3:5])
        rows = p.getCollisionShapeData(body, index)
        for (name, form), row in zip(_forms(link), rows, strict=True):
            frame = inertial.compose(_place(*row[5:7]))
            shapes[name] = LinkShape(link=place, frame=frame, size=_SIZES[form](row[3]))
    return shapes


def _forms(link: XmlElement) -> Iterator[tuple[str, str]]:
    for name, shape in collision_shapes(link):
        form = shape.find("geometry/*")
        if form is not None and form.tag in _SIZES:
            yield name, form.tag


def _place(origin: Numbers, quaternion: Numbers) -> Place:
    return Place(from_quaternion(real_first(quaternion)), np.array(origin))
