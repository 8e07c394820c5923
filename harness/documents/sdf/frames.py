"""Frames of an SDFormat model, by its pose semantics (SDFormat 1.7 and later), and its shapes.

A `<pose>` gives the pose of a frame in another one. By default a link's is in the model's frame, a
joint's in its child's, and a `<frame>`'s in the frame that it is attached to; `relative_to` names
another (http://sdformat.org/tutorials?tut=pose_frame_semantics). Versions to 1.6 have the defaults
only. Angles rotate about the fixed axes x, y and z in that order.

For `<inertial auto="true">` the format computes a link's mass, center and moments from its
collision shapes and their densities
(http://sdformat.org/tutorials?tut=auto_inertial_params_proposal).
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from physics_crosscheck.reference.mechanism.rotations import (
    IDENTITY,
    NO_INERTIA,
    Place,
    SpatialInertia,
    from_quaternion,
    from_rpy,
)
from ..document import Document, named_elements
from ..elements import XmlElement
from ..errors import quote

MODEL, WORLD = "__model__", "world"
"""Names of frames that no file declares."""

NAMED = ("link", "joint", "frame")


StatedPose = tuple[Place, str]
"""The content of a `<pose>`: the pose and its reference frame, empty for the default."""


def read_pose(document: Document, owner: XmlElement, what: str) -> StatedPose:
    """Return the pose of an element; the identity without one."""
    element = document.child(owner, "pose")
    if element is None:
        return IDENTITY, ""
    relative_to = element.attributes.get("relative_to", "")
    if element.attributes.get("frame", ""):
        document.add_problem(
            element,
            f"frame= of the pose of {what} is not covered",
            "use relative_to=",
            "unsupported",
        )
    if element.attributes.get("rotation_format") == "quat_xyzw":
        default = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
        x, y, z, i, j, k, w = document.text_numbers(element, default, what)
        if not (i or j or k or w):
            document.add_problem(element, f"the rotation of {what} has no length", "write 0 0 0 1")
            w = 1.0
        turn = from_quaternion(np.array([w, i, j, k]) / np.linalg.norm([w, i, j, k]))
        return Place(turn, np.array([x, y, z])), relative_to
    x, y, z, *angles = document.text_numbers(element, (0.0,) * 6, what)
    if element.attributes.get("degrees", "").strip().lower() in ("1", "true"):
        angles = np.radians(angles).tolist()
    roll, pitch, yaw = angles
    return Place(from_rpy(roll, pitch, yaw), np.array([x, y, z])), relative_to


class SdfFrames:
    """Poses of links, joints and frames of a model in its drawn configuration.

    Args:
        document: the file.
        model: its `<model>`.
    """

    def __init__(self, document: Document, model: XmlElement) -> None:
        self._document, self._model = document, model
        parts = (one for one in model if one.tag in NAMED)
        self.named = named_elements(document, parts, "link, joint or frame", (MODEL, WORLD))
        self._poses: dict[str, StatedPose] = {
            name: read_pose(document, element, f"{element.tag} {quote(name)}")
            for name, element in self.named.items()
        }
        self._places: dict[str, Place] = {MODEL: IDENTITY}

    def tagged(self, tag: str) -> Mapping[str, XmlElement]:
        """Return the elements of a tag, by name."""
        return {name: one for name, one in self.named.items() if one.tag == tag}

    def link(self, name: str) -> str:
        """Return the link, or `world`, that a frame is attached to, or an empty text."""
        return attached(name, self.named, self._model)

    def place(self, name: str) -> Place:
        """Return the pose of a frame in the model; an invalid frame is noted in the document."""
        return self._place(name, ())

    def _place(self, name: str, within: tuple[str, ...]) -> Place:
        if name in self._places:
            return self._places[name]
        if name == WORLD:
            return inverse(self.of_model())
        element = self.named.get(name)
        if element is None or name in within:
            last = self.named[within[-1]] if within and within[-1] in self.named else self._model
            problem = "is defined in itself" if element is not None else "does not exist"
            self._document.add_problem(
                last, f"frame {quote(name)}, which a pose refers to, {problem}", "name another"
            )
            return IDENTITY
        pose, relative_to = self._poses[name]
        outer = self._place(relative_to or _default(element), (*within, name))
        placed = self._places[name] = outer.compose(pose)
        return placed

    def of_model(self) -> Place:
        """Return the pose of the model's frame in the world."""
        pose, relative_to = read_pose(self._document, self._model, "the model")
        if relative_to not in ("", WORLD):
            self._document.add_problem(
                self._model,
                f"the pose of the model is relative to {quote(relative_to)}, which is not covered",
                "give the pose in the world",
            )
        placed = self._model.attributes.get("placement_frame", "")
        return pose.compose(inverse(self.place(placed))) if placed else pose


def attached(name: str, named: Mapping[str, XmlElement], model: XmlElement) -> str:
    """Return the link, or `world`, that a frame is attached to, or an empty text.

    Args:
        name: of a link, joint or frame, or `__model__`.
        named: links, joints and frames by name.
        model: the model, which is attached to its canonical link: by default the first.
    """
    passed: set[str] = set()
    while name not in passed:
        passed.add(name)
        if name == MODEL:
            first = next((key for key, one in named.items() if one.tag == "link"), "")
            name = model.get("canonical_link") or first
        element = named.get(name)
        if element is None or element.tag == "link":
            return name if element is not None or name == WORLD else ""
        name = child_of(element) if element.tag == "joint" else carrier(element)
    return ""


def child_of(joint: XmlElement) -> str:
    """Return the text of a joint's `<child>`."""
    return joint.findtext("child").strip()


def carrier(frame: XmlElement) -> str:
    """Return the frame that a `<frame>` is attached to."""
    return frame.get("attached_to") or MODEL


def inverse(place: Place) -> Place:
    """Return the pose of the outer frame in the inner one."""
    return Place(place.rotation.T, -place.rotation.T @ place.origin)


def _default(element: XmlElement) -> str:
    """Return the default reference frame of a pose."""
    if element.tag == "joint":
        return child_of(element)
    return carrier(element) if element.tag == "frame" else MODEL


WATER = 1000.0
"""The default density of a shape, kg/m^3."""

SIZES: Mapping[str, Mapping[str, tuple[float, ...]]] = MappingProxyType({
    "box": {"size": (1.0, 1.0, 1.0)},
    "sphere": {"radius": (1.0,)},
    "ellipsoid": {"radii": (1.0, 1.0, 1.0)},
    "cylinder": {"radius": (1.0,), "length": (1.0,)},
    "capsule": {"radius": (0.5,), "length": (1.0,)},
    "cone": {"radius": (0.5,), "length": (1.0,)},
})  # fmt: skip
"""The sizes of each shape that has moments, m, with their defaults."""

Solid = tuple[float, float, tuple[float, float, float]]
"""Volume, m^3; height of the center along z, m; moments about it per kg, m^2."""


def is_automatic(inertial: XmlElement) -> bool:
    """Return whether the attribute `auto` of an `<inertial>` selects the shapes' inertia."""
    return inertial.get("auto").strip().lower() in ("1", "true")


def has_automatic(link: XmlElement) -> bool:
    """Return whether a link's inertia follows from its collision shapes."""
    return any(map(is_automatic, link.findall("inertial")))


def solid(shape: str, sizes: Sequence[float]) -> Solid:
    """Return the volume, center and moments of a solid shape.

    Args:
        shape: one of `SIZES`.
        sizes: its sizes, in the order of `SIZES`, m.
    """
    if shape == "box":
        return _box(*sizes)
    if shape == "cone":
        return _cone(*sizes)
    if shape == "cylinder":
        return _round(sizes[0], sizes[1], 0.0)
    if shape == "capsule":
        return _round(sizes[0], sizes[1], sizes[0])
    a, b, c = sizes if shape == "ellipsoid" else (*sizes, *sizes, *sizes)
    moments = ((b * b + c * c) / 5, (a * a + c * c) / 5, (a * a + b * b) / 5)
    return 4 / 3 * math.pi * a * b * c, 0.0, moments


def _box(x: float, y: float, z: float) -> Solid:
    moments = ((y * y + z * z) / 12, (x * x + z * z) / 12, (x * x + y * y) / 12)
    return x * y * z, 0.0, moments


def _cone(radius: float, length: float) -> Solid:
    """Return those of a cone whose tip is on +z; its center is at a quarter of its length."""
    across = 3 / 80 * (4 * radius**2 + length**2)
    volume = math.pi * radius**2 * length / 3
    return volume, -length / 4, (across, across, 0.3 * radius**2)


def _round(radius: float, length: float, cap: float) -> Solid:
    """Return those of a cylinder with half a ball of radius `cap` on each end."""
    cylinder, ball = math.pi * radius**2 * length, 4 / 3 * math.pi * cap**3
    across = cylinder * (length**2 / 12 + radius**2 / 4)
    across += ball * (0.4 * cap**2 + length**2 / 4 + 3 / 8 * length * cap)
    along = cylinder * radius**2 / 2 + ball * 0.4 * cap**2
    volume = cylinder + ball
    return volume, 0.0, (across / volume, across / volume, along / volume)


def automatic_inertia(
    document: Document, frames: SdfFrames, link: XmlElement, inertial: XmlElement, name: str
) -> SpatialInertia:
    """Return the inertia of an `<inertial auto="true">` from the shapes of a link, in the link's
    frame.

    A `<mass>` in it scales the densities; `<pose>` and `<inertia>` have no meaning there. Shapes
    without such an inertia are noted in the document.

    Args:
        document: the file.
        frames: of its model.
        link, inertial: the elements.
        name: of the link.
    """
    what, total = f"link {quote(name)}", NO_INERTIA
    collisions = [one for one in link.children if one.tag == "collision"]
    if not collisions:
        document.add_problem(
            inertial,
            f'<inertial auto="true"> of {what} has no <collision> to compute it from',
            "give the link a <collision>, or write its mass and inertia",
        )
    for collision in collisions:
        density = _positive(
            document,
            document.child(collision, "density") or document.child(inertial, "density"),
            (WATER,),
            what,
        )[0]
        for shape_inertia in _solid(document, collision, what, density):
            place, relative_to = read_pose(document, collision, f"a <collision> of {what}")
            if relative_to:
                outer = inverse(frames.place(name)).compose(frames.place(relative_to))
                place = outer.compose(place)
            total = total.combined(shape_inertia.in_frame(place))
    mass = document.child(inertial, "mass")
    if mass is None or not total.mass:
        return total
    ratio = _positive(document, mass, (total.mass,), what)[0] / total.mass
    return SpatialInertia(total.mass * ratio, total.center, total.inertia * ratio)


def _solid(
    document: Document, collision: XmlElement, what: str, density: float
) -> Iterator[SpatialInertia]:
    """Yield the inertia of a collision shape in its own frame, if it has one."""
    geometry = document.child(collision, "geometry")
    shape = next(iter(geometry.children), None) if geometry is not None else None
    if shape is None or shape.tag not in SIZES:
        label = "an empty <geometry>" if shape is None else f"a <{shape.tag}>"
        document.add_problem(
            shape or collision,
            f'<inertial auto="true"> of {what} is not computed from {label}',
            f"use {', '.join(SIZES)}, or write its mass and inertia",
        )
        return
    sizes = [
        size
        for tag, default in SIZES[shape.tag].items()
        for size in _positive(document, document.child(shape, tag), default, what)
    ]
    volume, height, moments = solid(shape.tag, sizes)
    mass = density * volume
    yield SpatialInertia(mass, np.array([0.0, 0.0, height]), mass * np.diag(moments))


def _positive(
    document: Document, element: XmlElement | None, default: tuple[float, ...], what: str
) -> tuple[float, ...]:
    values = document.text_numbers(element, default, what)
    if element is not None and min(values) <= 0:
        document.add_problem(
            element, f"<{element.tag}> of {what} is not positive", "write a positive number"
        )
        return default
    return values
