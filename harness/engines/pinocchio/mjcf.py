"""An MJCF in Pinocchio.

Its parser reads only the first root body, requires names of the model and of bodies, treats geoms
without contacts as visual geometry, and applies the drawn pose of a free joint twice.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.engines import tree_model
from physics_crosscheck.harness.engines.mjcf_copy import POSE, TOUCHES, copy_mjcf, without_pose
from physics_crosscheck.harness.engines.mjcf_declared import DeclaredMjcf
from physics_crosscheck.harness.engines.mjcf_defaults import bodies_of, has_shape_inertia
from physics_crosscheck.harness.engines.mjcf_engine import MjcfModel
from physics_crosscheck.harness.engines.mjcf_joints import FREE, rows_of
from physics_crosscheck.harness.engines.pinocchio.model import PinocchioModel
from physics_crosscheck.harness.engines.pinocchio.reading import GROUND, read_mjcf
from physics_crosscheck.harness.engines.protocol import Array, Engine, EngineError, ModelSpec
from physics_crosscheck.harness.engines.remark import Remark
from physics_crosscheck.harness.engines.source import temporary_file
from physics_crosscheck.reference.mechanism.rotations import minimal_coordinates

ROOTS = "Pinocchio's reading of the first root body alone"
GEOMS = "Pinocchio's leaving out of geoms that touch nothing"


class PinocchioMjcf(PinocchioModel, MjcfModel):
    """An MJCF."""

    body_kind = "body"

    def __init__(
        self, spec: ModelSpec, defaults: Mapping[str, bool], compiler: Engine | None
    ) -> None:
        ignored = frozenset({"timestep", "gravity"})
        MjcfModel.__init__(self, spec, "Pinocchio", defaults, ignored, compiler)
        resolved = self.resolved
        root = copy_mjcf(self.declared, limits=False, touches=True, resolved=resolved, refs=False)
        self._one_root = not self.settings["all_roots"] and len(root.findall("worldbody/body")) > 1
        self._few_geoms = not self.settings["all_geoms"] and any(
            body.find("geom") for body in root.iter("body")
        )
        if self.settings["all_roots"]:
            _attach_to_ground(root)
        if self.settings["all_geoms"]:
            _enable_contacts(root)
        if self.floats:
            self.drawn = _drawn(self._read(root), self.root)
        model = self._read(without_pose(root))
        names = self._names(model)
        refs = {one.name: one.ref for one in self.declared.singles}
        self.take(model, names, np.array([refs[n] for row in names for n in row]), self.mimics)
        self.misread = not resolved and (
            self._differs_from_defaults(model) or any(_unread(self.declared))
        )

    def _read(self, root: XmlElement) -> Any:
        with temporary_file(root, self.path) as path:
            return read_mjcf(path, self.path)

    def _differs_from_defaults(self, model: Any) -> bool:
        """Return whether dampers and armatures of joints differ from those of their classes."""
        stated = {one.name: one for one in self.declared.singles}
        ordered = [
            stated[name] for name in self.coordinates[tree_model.FREE if self.floats else 0 :]
        ]
        pairs = ((model.damping, "damping"), (model.armature, "armature"))
        # A floating root has neither.
        return any(
            sorted(filter(None, map(float, found)))
            != sorted(filter(None, (getattr(one, key) for one in ordered)))
            for found, key in pairs
        )

    def _names(self, model: Any) -> Sequence[Sequence[str]]:
        """Return the names of slides and hinges of each joint; joints of one body form one
        joint.
        """
        rows = {row[0].name: row for _, row in rows_of(self.declared.joints)}
        names_by_joint = []
        for name in list(model.names)[1:]:
            row = rows.get(name) or rows.get(name.removeprefix("Composite_"))
            if row is None:
                raise EngineError(
                    f"{self.path}: Pinocchio makes a joint {name!r}, which the file does not have"
                )
            names_by_joint.append([one.name for one in row if one.kind != FREE])
        return names_by_joint

    @property
    def corrective_settings(self) -> dict[str, Mapping[str, object]]:
        """Elements that Pinocchio leaves out under the current settings, with corrections."""
        settings = {**self.lost_settings, **self.undamped}
        if self._one_root:
            settings[ROOTS] = {"all_roots": True}
        return {**settings, GEOMS: {"all_geoms": True}} if self._few_geoms else settings

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """Yield ignored parts of the MJCF, and omitted dampers."""
        yield from MjcfModel.remarks(self, z, w)
        yield from self.damping_remarks()


def _unread(declared: DeclaredMjcf) -> Iterator[bool]:
    """Yield whether a joint or geom inherits attributes that Pinocchio reads only from the element
    itself.
    """
    for body, inherited in bodies_of(declared.source):
        weighing = has_shape_inertia(declared.source, body) and body not in declared.inertias
        for element in (*body.findall("joint"), *(body.findall("geom") if weighing else ())):
            lost = {"pos"} if element.tag == "joint" else {"mass", *POSE}
            yield bool(
                lost
                & set(declared.defaults.attributes(element, inherited)) - set(element.attributes)
            )


def _attach_to_ground(root: XmlElement) -> None:
    """Attach all root bodies to one fixed body."""
    for world in root.findall("worldbody"):
        bodies, world.children = world.children, []
        ground = world.add("body", {"name": GROUND})
        for body in bodies:
            ground.append(body)


def _enable_contacts(root: XmlElement) -> None:
    for geom in (one for body in root.iter("body") for one in body.findall("geom")):
        for key in TOUCHES:
            geom.set(key, "1")


def _drawn(model: Any, name: str) -> Array:
    """Return the coordinates of a floating body in the drawn configuration, Pinocchio's initial
    one.
    """
    start = model.joints[model.getJointId(name)].idx_q
    positions = np.array(model.referenceConfigurations["qpos0"])[start : start + 7]
    turn = np.roll(positions[3:], 1)
    return np.concatenate([positions[:3], minimal_coordinates(turn, turn)])
