"""PyBullet's rounding of inertia tensors, and a URDF that avoids it.

PyBullet rotates a tensor with products to its principal axes by Jacobi sweeps that stop one step
after all off-diagonal elements are below 1e-6 of the trace (`btMatrix3x3::diagonalize`, called by
`BulletURDFImporter::getMassAndInertia2`). It drops the remaining elements. The only remedy in the
file is to give principal axes in the `<origin>` of the `<inertial>`.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from physics_crosscheck.harness.documents.document import finite_numbers
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.urdf import UrdfFile
from physics_crosscheck.reference.mechanism.rotations import SpatialInertia, from_rpy, to_rpy
from ..protocol import Array, EngineError
from ..remark import Remark
from ..source import refused, shortened

PRODUCTS = ("ixy", "ixz", "iyz")
"""Products of inertia in a URDF."""

_PLACES = {"ixx": (0, 0), "iyy": (1, 1), "izz": (2, 2), "ixy": (0, 1), "ixz": (0, 2), "iyz": (1, 2)}

ROUNDING = 1e-14
"""Relative difference of tensors that rounding explains."""

EXACT: Mapping[str, object] = {"exact_axes": True}
"""The adapter's setting that computes principal axes to the last digits."""


def lost_inertias(robot: XmlElement, held: Mapping[str, SpatialInertia]) -> dict[str, float]:
    """Return the relative error of PyBullet's tensor of each link, if it exceeds rounding.

    Args:
        robot: the URDF.
        held: PyBullet's, in their links' frames.
    """
    errors = {}
    for link in robot.findall("link"):
        name, inertial = link.get("name", ""), _with_products(link)
        if inertial is not None and name in held:
            turn = from_rpy(*_origin(inertial))
            stated = turn @ _tensor(inertial) @ turn.T
            off = float(np.max(np.abs(held[name].inertia - stated)) / np.max(np.abs(stated)))
            if off > ROUNDING:
                errors[name] = off
    return errors


def held_inertias(body: int, *, base: bool = False) -> dict[str, SpatialInertia]:
    """Return PyBullet's mass and inertia of links, in their frames, with or without the base."""
    import pybullet as p

    held = {}
    for index in range(-1 if base else 0, p.getNumJoints(body)):
        mass, _, moments, center, turn = p.getDynamicsInfo(body, index)[:5]
        axes = np.array(p.getMatrixFromQuaternion(turn)).reshape(3, 3)
        tensor = (axes * np.array(moments)) @ axes.T
        held[_link(body, index)] = SpatialInertia(mass, np.array(center), tensor)
    return held


def check_inertias(path: str, body: int, robot: XmlElement | None) -> None:
    """Refuse inertias that PyBullet replaces without an error.

    A moving link without moments of inertia is accepted: its joint moves correctly with a mass off
    its axis, or with child links.

    Args:
        path: of the file.
        body: PyBullet's index of the body.
        robot: the file, if its inertias are used.

    Raises:
        EngineError: naming file and link.
    """
    import pybullet as p

    stated = {} if robot is None else {e.get("name"): e for e in robot if _has_moments(e)}
    # Also for a link behind a fixed joint, and one without mass, such as a rotor.
    links = (
        _link(body, i)
        for i in range(p.getNumJoints(body))
        if not any(p.getDynamicsInfo(body, i)[2])
    )
    if zeroed := [name for name in links if name in stated]:
        names, whose = shortened(list(map(repr, zeroed))), "their" if len(zeroed) > 1 else "its"
        raise refused(
            stated[zeroed[0]],
            f"PyBullet sets the inertia of link{'s' * (len(zeroed) > 1)} {names} to zero; {whose} "
            "principal moments of inertia violate the triangle inequality (each must be at most "
            "the sum of the other two)",
        )
    _check_moved(path, body)


def refuse_fixed_root(file: UrdfFile, body: int) -> None:
    """Refuse a floating root without mass: PyBullet fixes it.

    `ConvertURDF2BulletInternal` in URDF2Bullet.cpp: `bool isFixedBase = (mass == 0)`. Such a root
    has the mass zero in its file, or the name `world` and no `<inertial>`.

    Raises:
        EngineError: naming file, line and link.
    """
    import pybullet as p

    if p.getDynamicsInfo(body, -1)[0] == 0:
        link = file.links[file.root].element
        raise refused(
            link.find("inertial/mass") or link,
            f"PyBullet fixes the floating root {file.root!r}, since its mass is zero; "
            "give it a mass",
        )


def _check_moved(path: str, body: int) -> None:
    """Refuse a joint that moves no inertia: PyBullet does not move it.

    Raises:
        EngineError: naming file and joint.
    """
    import pybullet as p

    infos = [p.getJointInfo(body, joint) for joint in range(p.getNumJoints(body))]
    rows = {
        info[1].decode(): range(info[4], info[4] + (3 if info[2] == p.JOINT_SPHERICAL else 1))
        for info in infos
        if info[2] != p.JOINT_FIXED
    }
    count = sum(map(len, rows.values()))
    try:
        moved = p.calculateMassMatrix(body, [0.0] * count) if rows else ()
    except SystemError:
        # Bullet's mass matrix asks for symmetry to 1e-15 kg m^2, which a heavy link turned
        # by rpy can't have (IDMath.cpp, isValidInertiaMatrix); its steps don't.
        return
    # Velocity indices start at 6, after the base's, but a fixed base has no rows here.
    first = 6 + count - len(moved)
    for name, indices in rows.items():
        if not all(moved[row - first][row - first] > 0 for row in indices):
            raise EngineError(
                f"{path}: joint {name!r} moves nothing with inertia, so PyBullet "
                "holds it still; give its link a mass and moments of inertia"
            )


def _link(body: int, index: int) -> str:
    import pybullet as p

    info = p.getBodyInfo(body)[0] if index < 0 else p.getJointInfo(body, index)[12]
    name: str = info.decode()
    return name


def _has_moments(link: XmlElement) -> bool:
    inertia = link.find("inertial/inertia")
    return inertia is not None and any(float(inertia.get(key, "0")) for key in _PLACES)


def axes_cause(lost: Mapping[str, float]) -> str:
    """Return the cause that a diagnosis reports."""
    whose = "an" if len(lost) > 1 else "its"
    off = max(lost.values())
    names = shortened(tuple(lost), 3)
    return f"PyBullet's own principal axes of {names}, {off:.1e} of {whose} inertia off"


def axes_remarks(lost: Mapping[str, float]) -> Iterator[Remark]:
    """Yield a remark for each link."""
    for name, off in lost.items():
        yield Remark(
            message=(
                f"PyBullet computes the principal axes of link {name} inexactly, so its "
                f"tensor is off by {off:.1e}; no number of the file corrects that, but "
                "the setting exact_axes = true does"
            ),
            subject=(name, "principal axes"),
            address=f"robot/link[{name}]",
            value=off,
            shows_in=("inertia", "acceleration"),
            undone_by=EXACT,
        )


def exact_axes(robot: XmlElement) -> None:
    """Rotate each `<inertial>` with products to principal axes, computed to the last digits."""
    for link in robot.findall("link"):
        inertial = _with_products(link)
        if inertial is not None:
            _diagonalize(inertial)


def _with_products(link: XmlElement) -> XmlElement | None:
    inertial = link.find("inertial")
    inertia = inertial.find("inertia") if inertial is not None else None
    if inertia is None or not any(float(inertia.get(key, "0")) for key in PRODUCTS):
        return None
    return inertial


def _tensor(inertial: XmlElement) -> Array:
    tensor = np.zeros((3, 3))
    inertia = inertial.find("inertia")
    assert inertia is not None  # it has products
    for key, (i, j) in _PLACES.items():
        tensor[i, j] = tensor[j, i] = float(inertia.get(key, "0"))
    return tensor


def _origin(inertial: XmlElement) -> list[float]:
    origin = inertial.find("origin")
    return finite_numbers("" if origin is None else origin.get("rpy", "")) or [0.0, 0.0, 0.0]


def _diagonalize(inertial: XmlElement) -> None:
    moments, axes = np.linalg.eigh(_tensor(inertial))  # ascending
    axes[:, 0] *= np.linalg.det(axes)  # right-handed
    # PyBullet zeroes moments that exceed the sum of the others by rounding, as for a flat body.
    beyond = float(moments[2] - (moments[0] + moments[1]))
    if 0 < beyond <= ROUNDING * float(moments[2]):
        moments[2] = moments[0] + moments[1]
    turn = from_rpy(*_origin(inertial)) @ axes
    roll, pitch, yaw = to_rpy(turn)
    origin, inertia = inertial.find("origin"), inertial.find("inertia")
    if origin is None:
        origin = inertial.add("origin")
    origin.set("rpy", " ".join(repr(float(angle)) for angle in (roll, pitch, yaw)))
    assert inertia is not None  # it has products
    for key, moment in zip(("ixx", "iyy", "izz"), moments.tolist(), strict=True):
        inertia.set(key, repr(moment))
    for key in PRODUCTS:
        inertia.set(key, "0")
