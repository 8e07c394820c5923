"""Frames of an SDFormat model, by its pose semantics (SDFormat 1.7 and later).

A `<pose>` gives the pose of a frame in another one. By default a link's is in the model's frame, a
joint's in its child's, and a `<frame>`'s in the frame that it is attached to; `relative_to` names
another (http://sdformat.org/tutorials?tut=pose_frame_semantics). Versions to 1.6 have the defaults
only. Angles rotate about the fixed axes x, y and z in that order.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from physics_crosscheck.reference.mechanism.rotations import from_quaternion, from_rpy
from physics_crosscheck.reference.mechanism.spatial_inertia import IDENTITY, Place
from ..document import Document
from ..elements import XmlElement
from ..errors import quote
from ..tree import named_elements

MODEL, WORLD = "__model__", "world"
"""Names of frames that no file declares."""

NAMED = ("link", "joint", "frame")


@dataclass(frozen=True)
class StatedPose:
    """The content of a `<pose>`: the pose and its reference frame, empty for the default."""

    place: Place
    relative_to: str


def read_pose(document: Document, owner: XmlElement, what: str) -> StatedPose:
    """Return the pose of an element; the identity without one."""
    element = document.child(owner, "pose")
    if element is None:
        return StatedPose(IDENTITY, "")
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
        return StatedPose(Place(turn, np.array([x, y, z])), relative_to)
    x, y, z, *angles = document.text_numbers(element, (0.0,) * 6, what)
    if element.attributes.get("degrees", "").strip().lower() in ("1", "true"):
        angles = np.radians(angles).tolist()
    roll, pitch, yaw = angles
    return StatedPose(Place(from_rpy(roll, pitch, yaw), np.array([x, y, z])), relative_to)


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
        pose = self._poses[name]
        outer = pose.relative_to or _default(element)
        placed = self._places[name] = self._place(outer, (*within, name)).compose(pose.place)
        return placed

    def of_model(self) -> Place:
        """Return the pose of the model's frame in the world."""
        pose = read_pose(self._document, self._model, "the model")
        if pose.relative_to not in ("", WORLD):
            self._document.add_problem(
                self._model,
                f"the pose of the model is relative to {quote(pose.relative_to)}, which is not"
                " covered",
                "give the pose in the world",
            )
        placed = self._model.attributes.get("placement_frame", "")
        return pose.place.compose(inverse(self.place(placed))) if placed else pose.place


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
