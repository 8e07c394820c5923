"""Frames of an SDFormat model, by its pose semantics (SDFormat 1.7 and later).

A `<pose>` says where a frame stands in another one: that of a link in the model's, that of a joint
in its child's, that of a `<frame>` in what it is attached to, unless `relative_to` names one
(http://sdformat.org/tutorials?tut=pose_frame_semantics). In versions to 1.6 the defaults are the
only way. Angles turn about the fixed axes x, y and z in that order.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from physics_crosscheck.harness.modelfiles.document import Document
from physics_crosscheck.harness.modelfiles.locations.xml import RawElement
from physics_crosscheck.harness.modelfiles.quote import brief
from physics_crosscheck.reference.mechanism.rotations import from_quaternion, from_rpy
from physics_crosscheck.reference.mechanism.spatial_inertia import IDENTITY, Place

MODEL, WORLD = "__model__", "world"
NAMED = ("link", "joint", "frame")


@dataclass(frozen=True)
class Pose:
    """What a `<pose>` says: where, and relative to what; empty where it names nothing."""

    place: Place
    relative_to: str


def read_pose(document: Document, owner: RawElement, what: str) -> Pose:
    """The pose of an element; none is none at all."""
    element = document.child(owner, "pose")
    if element is None:
        return Pose(IDENTITY, "")
    relative_to = element.attributes.get("relative_to", "")
    if element.attributes.get("frame", ""):
        document.hinder(
            element,
            f"frame= of the pose of {what} is not covered",
            "use relative_to=",
            "unsupported",
        )
    if element.attributes.get("rotation_format") == "quat_xyzw":
        default = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
        x, y, z, i, j, k, w = document.text_numbers(element, default, what)
        if not (i or j or k or w):
            document.hinder(element, f"the rotation of {what} has no length", "write 0 0 0 1")
            w = 1.0
        turn = from_quaternion(np.array([w, i, j, k]) / np.linalg.norm([w, i, j, k]))
        return Pose(Place(turn, np.array([x, y, z])), relative_to)
    x, y, z, *angles = document.text_numbers(element, (0.0,) * 6, what)
    if element.attributes.get("degrees", "").strip().lower() in ("1", "true"):
        angles = np.radians(angles).tolist()
    roll, pitch, yaw = angles
    return Pose(Place(from_rpy(roll, pitch, yaw), np.array([x, y, z])), relative_to)


class Frames:
    """Where links, joints and frames of a model stand, as it is drawn.

    Args:
        document: the file.
        model: its `<model>`.
    """

    def __init__(self, document: Document, model: RawElement) -> None:
        self._document, self._model = document, model
        self.named: dict[str, RawElement] = {}
        for element in model.children:
            if element.tag in NAMED:
                self._add(element)
        self._poses: dict[str, Pose] = {
            name: read_pose(document, element, f"{element.tag} {brief(name)}")
            for name, element in self.named.items()
        }
        self._places: dict[str, Place] = {MODEL: IDENTITY}

    def _add(self, element: RawElement) -> None:
        name, document = element.attributes.get("name", ""), self._document
        if not name:
            document.hinder(element, f"a <{element.tag}> has no name", "give it a unique name")
        elif name in (*self.named, MODEL, WORLD):
            document.hinder(
                element,
                f"a second link, joint or frame is called {brief(name)}",
                "give it a unique name",
            )
        else:
            self.named[name] = element

    def of(self, tag: str) -> Mapping[str, RawElement]:
        """Those of a tag, by their names."""
        return {name: one for name, one in self.named.items() if one.tag == tag}

    def link(self, name: str) -> str:
        """The link, or `world`, with which a frame moves; empty where there is none."""
        passed: set[str] = set()
        while name not in passed:
            passed.add(name)
            if name == MODEL:
                name = self._canonical
            element = self.named.get(name)
            if element is None or element.tag == "link":
                return name if element is not None or name == WORLD else ""
            name = child_of(element) if element.tag == "joint" else _carrier(element)
        return ""

    @property
    def _canonical(self) -> str:
        told = self._model.attributes.get("canonical_link", "")
        return told or next(iter(self.of("link")), "")

    def place(self, name: str) -> Place:
        """Where it stands in the model; a frame that can't be had is noted in the document."""
        return self._place(name, ())

    def _place(self, name: str, within: tuple[str, ...]) -> Place:
        if name in self._places:
            return self._places[name]
        if name == WORLD:
            return inverse(self.of_model())
        element = self.named.get(name)
        if element is None or name in within:
            last = self.named[within[-1]] if within and within[-1] in self.named else self._model
            told = "is defined in itself" if element is not None else "does not exist"
            self._document.hinder(
                last, f"frame {brief(name)}, which a pose refers to, {told}", "name another"
            )
            return IDENTITY
        pose = self._poses[name]
        outer = pose.relative_to or _default(element)
        found = self._places[name] = self._place(outer, (*within, name)).compose(pose.place)
        return found

    def of_model(self) -> Place:
        """Where the model's frame stands in the world."""
        pose = read_pose(self._document, self._model, "the model")
        if pose.relative_to not in ("", WORLD):
            self._document.hinder(
                self._model,
                f"the pose of the model is relative to {brief(pose.relative_to)}, which is not"
                " covered",
                "give the pose in the world",
            )
        placed = self._model.attributes.get("placement_frame", "")
        return pose.place.compose(inverse(self.place(placed))) if placed else pose.place


def inverse(place: Place) -> Place:
    """Where the outer frame stands in the inner one."""
    return Place(place.rotation.T, -place.rotation.T @ place.origin)


def child_of(joint: RawElement) -> str:
    """What stands in a joint's `<child>`."""
    return next((one.text.strip() for one in joint.children if one.tag == "child"), "")


def _carrier(frame: RawElement) -> str:
    return frame.attributes.get("attached_to", "") or MODEL


def _default(element: RawElement) -> str:
    """In which frame a pose stands that names none."""
    if element.tag == "joint":
        return child_of(element)
    return _carrier(element) if element.tag == "frame" else MODEL
