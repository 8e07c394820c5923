"""An MJCF in Drake.

Drake's parser ignores springs, tendons, joint equalities, and the armature of joints without
actuators. If a body has several joints, Drake places all except the last at the parent's origin.
Ranges with lower above upper, and moments of inertia without mass, would abort the process, so the
adapter removes or refuses them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from physics_crosscheck.harness.documents.document import finite_numbers
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.engines.drake.model import CONTINUOUS, SAP, DrakeModel
from physics_crosscheck.harness.engines.drake.plant import moving_joints
from physics_crosscheck.harness.engines.mjcf_copy import POSE, copy_mjcf
from physics_crosscheck.harness.engines.mjcf_declared import DeclaredMjcf
from physics_crosscheck.harness.engines.mjcf_defaults import bodies_of
from physics_crosscheck.harness.engines.mjcf_engine import MjcfModel
from physics_crosscheck.harness.engines.mjcf_joints import SLIDE, MjcfJoint, rows_of
from physics_crosscheck.harness.engines.protocol import Array, Engine, ModelSpec
from physics_crosscheck.harness.engines.remark import Remark
from physics_crosscheck.harness.engines.tree_model import FREE
from physics_crosscheck.reference.mechanism.rotations import minimal_coordinates

ARMATURE = "Drake's leaving out of armature where no actuator drives a joint"
MISPLACED = "Drake's placing of a body's first joints at its parent's origin"
EQUALITIES = "TAMSI's leaving out of joint equalities"


class DrakeMjcf(DrakeModel, MjcfModel):
    """An MJCF."""

    no_fromto = frozenset({"box", "ellipsoid"})

    def __init__(
        self, spec: ModelSpec, defaults: Mapping[str, bool | str], compiler: Engine | None
    ) -> None:
        self.stepping = str(spec.settings.get("stepping", SAP))
        MjcfModel.__init__(self, spec, "Drake", defaults, frozenset({"timestep"}), compiler)
        smooth, resolved = bool(self.settings["smooth"]), self.resolved
        root = copy_mjcf(self.declared, limits=not smooth, touches=False, resolved=resolved)
        heavy = [joint for joint in self.declared.singles if joint.armature]
        self._heavy = heavy if self.settings["armature"] else []
        self._light = bool(heavy) and not self._heavy
        rows = [row for _, row in rows_of(self.declared.joints) if _misplaced(row)]
        self._misplaced = bool(rows) and not self.settings["chained"]
        several = [body for body in root.iter("body") if len(body.findall("joint")) > 1]
        for body in several if self.settings["chained"] else ():
            _chain(body)
        held = self.mimics if self.stepping == CONTINUOUS else ()
        self.take(root.written().decode(), "xml", held)
        if self.floats:
            self.drawn = self._drawn()
        stated = {joint.name: joint.damping for joint in self.declared.singles}
        ordered = [stated[name] for name in self.coordinates[FREE if self.floats else 0 :]]
        other = ordered != np.diag(self._damping).tolist() or any(_lost(self.declared))
        self.misread = not resolved and other

    def complete(self, plant: Any) -> None:
        """Add armature, as rotors of unused actuators, and couplings for SAP."""
        for heavy in self._heavy:
            joint = plant.GetJointByName(heavy.name)
            plant.AddJointActuator(heavy.name, joint).set_default_rotor_inertia(heavy.armature)
        if self.stepping == SAP and plant.time_step():
            for mimic in self.mimics:
                pair = (plant.GetJointByName(name) for name in (mimic.joint, mimic.leader))
                plant.AddCouplerConstraint(*pair, mimic.multiplier, mimic.offset)

    def _drawn(self) -> Array:
        """Return the coordinates of a floating body at Drake's default state."""
        positions = np.array(moving_joints(self._plant)[0].default_positions())
        return np.concatenate([positions[4:], minimal_coordinates(positions[:4], positions[:4])])

    @property
    def corrective_settings(self) -> dict[str, Mapping[str, object]]:
        """Elements that Drake leaves out under the current settings, with corrections."""
        settings = self.lost_settings
        if self._light:
            settings[ARMATURE] = {"armature": True}
        if self._misplaced:
            settings[MISPLACED] = {"chained": True}
        return {**settings, EQUALITIES: {"stepping": SAP}} if self.ignores_mimics else settings

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of Drake's parser, without line numbers, which refer to a copy."""
        messages = (re.sub(r"^\d+: (warning: )?", "", one) for one in super().warnings)
        return tuple(dict.fromkeys(messages))

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """Yield ignored parts of the MJCF, and Drake's warnings."""
        yield from MjcfModel.remarks(self, z, w)
        if self._light:
            yield Remark(
                kind="setting",
                message=f"{ARMATURE}, by a setting",
                fault=True,
                address="sidecar:settings.armature",
                shows_in=("inertia",),
            )
        yield from self.warning_remarks()

    @property
    def places(self) -> tuple[str, ...]:
        """Bodies and their centres of mass."""
        names = [body.get("name") for body, _ in bodies_of(self.declared.source)]
        return tuple(f"{kind}:{name}" for kind in ("body", "centre") for name in names if name)


def _lost(declared: DeclaredMjcf) -> Iterator[bool]:
    """Yield whether a joint's class states no joint defaults, so that Drake loses inherited ones.

    Lost axes and positions are visible, unlike damping.
    """
    silent: set[str] = set()

    def search(default: XmlElement, above: bool) -> None:
        states = default.find("joint") is not None
        if above and not states:
            silent.add(default.get("class", ""))
        for nested in default.findall("default"):
            search(nested, above or states)

    for top in declared.source.root.findall("default"):
        search(top, False)
    for body, inherited in bodies_of(declared.source):
        for joint in body.findall("joint"):
            attributes = declared.defaults.attributes(joint, inherited)
            whole = set(attributes) <= set(joint.attributes)
            yield not whole and joint.get("class", inherited) in silent


def _misplaced(row: list[MjcfJoint]) -> bool:
    """Return whether the positions of a body's joints, except the last, affect the motion."""
    body, first = row[0].body, row[:-1]
    turned = any(key in body.attributes for key in POSE if key != "pos")
    away = any(finite_numbers(body.get("pos", "0")) or [1.0])
    return bool(first) and (turned or (away and any(one.kind != SLIDE for one in first)))


def _chain(body: XmlElement) -> None:
    """Give each joint its own body, in a chain; the last body gets the content."""
    name, (first, *others) = body.get("name", ""), body.findall("joint")
    last, inside = body, [part for part in body if part.tag != "joint"]
    for part in list(body):
        body.remove(part)
    body.append(first)
    for i, part in enumerate(others):
        last.set("name", f"{name}_{i}_of_{len(others)}")
        last = last.add("body", {"name": name})
        last.append(part)
    for part in inside:
        last.append(part)
