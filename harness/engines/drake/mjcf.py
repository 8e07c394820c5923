"""An MJCF in Drake.

Its parser reads over springs, tendons, equalities of joints, and the armature of joints that no
actuator drives. Of several joints of one body it places all but the last at the parent's origin.
Ranges whose lower is above their upper, and moments without mass, end the process: neither gets
there.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.attitude import coordinates
from physics_crosscheck.harness.engines.drake.model import CONTINUOUS, SAP, DrakeModel
from physics_crosscheck.harness.engines.drake.plant import moving_joints
from physics_crosscheck.harness.engines.mjcf_copy import POSE, copied
from physics_crosscheck.harness.engines.mjcf_declared import DeclaredMjcf
from physics_crosscheck.harness.engines.mjcf_defaults import bodies_of
from physics_crosscheck.harness.engines.mjcf_engine import MjcfModel
from physics_crosscheck.harness.engines.mjcf_joints import SLIDE, MjcfJoint, rows_of
from physics_crosscheck.harness.engines.protocol import Array, Engine, ModelSpec
from physics_crosscheck.harness.engines.remark import Remark
from physics_crosscheck.harness.engines.source import finite_numbers
from physics_crosscheck.harness.engines.tree_model import FREE

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
        root = copied(self.declared, limits=not smooth, touches=False, resolved=resolved)
        heavy = [one for one in self.declared.singles if one.armature]
        self._heavy = heavy if self.settings["armature"] else []
        self._light = bool(heavy) and not self._heavy
        rows = [row for _, row in rows_of(self.declared.joints) if _misplaced(row)]
        self._misplaced = bool(rows) and not self.settings["chained"]
        several = [body for body in root.iter("body") if len(body.findall("joint")) > 1]
        for body in several if self.settings["chained"] else ():
            _chain(body)
        held = self.mimics if self.stepping == CONTINUOUS else ()
        self.take(ET.tostring(root, encoding="unicode"), "xml", held)
        if self.floats:
            self.drawn = self._drawn()
        said = {one.name: one.damping for one in self.declared.singles}
        own = [said[name] for name in self.coordinates[FREE if self.floats else 0 :]]
        other = own != np.diag(self._damping).tolist() or any(_lost(self.declared))
        self.misread = not resolved and other

    def complete(self, plant: Any) -> None:
        """Armature, as rotors of actuators that do nothing; and couplings, for SAP."""
        for one in self._heavy:
            joint = plant.GetJointByName(one.name)
            plant.AddJointActuator(one.name, joint).set_default_rotor_inertia(one.armature)
        if self.stepping == SAP and plant.time_step():
            for mimic in self.mimics:
                pair = (plant.GetJointByName(name) for name in (mimic.joint, mimic.leader))
                plant.AddCouplerConstraint(*pair, mimic.multiplier, mimic.offset)

    def _drawn(self) -> Array:
        """Coordinates of a body that floats, where Drake starts it."""
        own = np.array(moving_joints(self._plant)[0].default_positions())
        return np.concatenate([own[4:], coordinates(own[:4], own[:4])])

    @property
    def remedies(self) -> dict[str, Mapping[str, object]]:
        """What Drake leaves out and the settings let stand, with what undoes it."""
        found = self.remedied
        if self._light:
            found[ARMATURE] = {"armature": True}
        if self._misplaced:
            found[MISPLACED] = {"chained": True}
        return {**found, EQUALITIES: {"stepping": SAP}} if self.let_go else found

    @property
    def warnings(self) -> tuple[str, ...]:
        """What Drake's parser has warned of, without lines: they are those of a copy."""
        own = (re.sub(r"^\d+: (warning: )?", "", one) for one in super().warnings)
        return tuple(dict.fromkeys(own))

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """What the MJCF says in vain, and what Drake says of it."""
        yield from MjcfModel.remarks(self, z, w)
        if self._light:
            yield Remark(
                kind="setting",
                message=f"{ARMATURE}, by a setting",
                fault=True,
                address="sidecar:settings.armature",
                shows_in=("inertia",),
            )
        yield from self.said_remarks()

    @property
    def places(self) -> tuple[str, ...]:
        """Bodies and their centres of mass."""
        names = [body.get("name") for body, _ in bodies_of(self.declared.source)]
        return tuple(f"{kind}:{name}" for kind in ("body", "centre") for name in names if name)


def _lost(declared: DeclaredMjcf) -> Iterator[bool]:
    """Yield whether a joint's class says nothing of joints, and Drake loses what those above say.

    Of what is lost so, axis and place show in no damping.
    """
    silent: set[str] = set()

    def search(default: ET.Element, above: bool) -> None:
        states = default.find("joint") is not None
        if above and not states:
            silent.add(default.get("class", ""))
        for nested in default.findall("default"):
            search(nested, above or states)

    for top in declared.source.root.findall("default"):
        search(top, False)
    for body, inherited in bodies_of(declared.source):
        for one in body.findall("joint"):
            said = declared.defaults.of(one, inherited)
            whole = set(said) <= set(one.attrib)
            yield not whole and one.get("class", inherited) in silent


def _misplaced(row: list[MjcfJoint]) -> bool:
    """Whether it matters where joints of one body are, but for the last."""
    body, first = row[0].body, row[:-1]
    turned = any(key in body.attrib for key in POSE if key != "pos")
    away = any(finite_numbers(body.get("pos", "0")) or [1.0])
    return bool(first) and (turned or (away and any(one.kind != SLIDE for one in first)))


def _chain(body: ET.Element) -> None:
    """Give each joint a body of its own, one in the other: what the body has is in the last."""
    name, (first, *others) = body.get("name", ""), body.findall("joint")
    last, inside = body, [one for one in body if one.tag != "joint"]
    for one in list(body):
        body.remove(one)
    body.append(first)
    for i, one in enumerate(others):
        last.set("name", f"{name}_{i}_of_{len(others)}")
        last = ET.SubElement(last, "body", name=name)
        last.append(one)
    last.extend(inside)
