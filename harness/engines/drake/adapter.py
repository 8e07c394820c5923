"""Drake, on URDF, SDFormat and MJCF: a discrete `MultibodyPlant`, or RK4 by the adapter.

A plant fixes its step when it is built, so the adapter builds one plant per step. Plants have no
geometry, except for whole steps.

An MJCF in Drake.

Drake's parser ignores springs, tendons, joint equalities, and the armature of joints without
actuators. If a body has several joints, Drake places all except the last at the parent's origin.
Ranges with lower above upper, and moments of inertia without mass, would abort the process, so the
adapter removes or refuses them.

A URDF, or an SDFormat file, in Drake.

Drake's SDFormat parser ignores `<mimic>` and defines its own element.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from physics_crosscheck.harness.documents.document import Document, Mimic, finite_numbers
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.sdf.read import has_no_weight
from physics_crosscheck.reference.mechanism.rotations import minimal_coordinates
from ..mjcf_copy import POSE, copy_mjcf
from ..mjcf_declared import DeclaredMjcf
from ..mjcf_defaults import bodies_of, body_names
from ..mjcf_engine import ADDED, MJCF_NON_PHYSICAL, MjcfModel, sample_mjcf
from ..mjcf_joints import SLIDE, MjcfJoint, rows_of
from ..protocol import ARMATURES, Array, Engine, LoadedModel, ModelSpec, Sample
from ..remark import Remark
from ..runge_kutta import FREE
from ..sdf import SDF_NON_PHYSICAL, load_sdf, sample_sdf
from ..sdf_sidecar import MODEL, sdf_mimics_of, sdf_without_bounds
from ..source import engine_errors, shortened
from ..urdf import URDF_NON_PHYSICAL, UrdfReader, sample_urdf
from ..urdf_copy import (
    Change,
    followers_of,
    mimics_of,
    with_forms,
    without_bounds,
    without_crossed_bounds,
    without_law,
    without_shapes,
    without_visuals,
)
from ..urdf_engine import SDF, UrdfEngine, UrdfModel
from ..urdf_sidecar import ROBOTS, kept_mimics
from .model import CONTINUOUS, SAP, TAMSI, DrakeModel, refuse_balls
from .plant import moving_joints, weight_of
from .whole import FORMS, WHOLE_SETTINGS, DrakeWhole, refuse_words

PREFIX = "drake:"
"""The prefix of elements that only Drake reads."""

WORLD = "world"
"""A link of this name is the world itself."""

SPACE = {"xmlns:drake": "http://drake.mit.edu"}


ROTORS = (f"{PREFIX}rotor_inertia", f"{PREFIX}gear_ratio")


def without_own(model: XmlElement) -> None:
    """Remove joint elements that only Drake reads, except rotors."""
    for joint in model.findall("joint"):
        for part in list(joint):
            if part.tag.startswith(PREFIX) and part.tag not in ROTORS:
                joint.remove(part)


def without_rotors(model: XmlElement) -> None:
    """Remove rotor inertias and gear ratios, which only Drake reads."""
    for element in list(model.iter()):
        for part in [one for one in element if one.tag in ROTORS]:
            element.remove(part)


def reflected_inertias(root: XmlElement) -> dict[str, float]:
    """Return gear ratio^2 times rotor inertia by joint, of a URDF's or SDFormat's root.

    Drake adds them to the mass matrix where an actuator drives the joint: one of a simple
    transmission of a URDF, or any of SDFormat, unless its effort is limited to zero.
    """
    joints = {one.get("name"): one for one in root.iter("joint") if one.get("type")}
    rows = list(joints.items())
    for transmission in root.findall("transmission"):
        kind = transmission.findtext("type") or transmission.get("type")
        driven, actuator = transmission.find("joint"), transmission.find("actuator")
        if "SimpleTransmission" in kind and driven is not None and actuator is not None:
            rows.append((driven.get("name"), actuator))
    result = {}
    for name, element in rows:
        rotor, gear = _number(element, ROTORS[0], 0.0), _number(element, ROTORS[1], 1.0)
        if rotor and name in joints and _effort(joints[name]):
            result[name] = gear**2 * rotor
    return result


def _number(element: XmlElement, tag: str, default: float) -> float:
    """Return a number of an attribute, as in a URDF, or of a text."""
    part = element.find(tag)
    text = "" if part is None else part.get("value") or part.text
    return (finite_numbers(text) or [default])[0] if text.strip() else default


def _effort(joint: XmlElement) -> float:
    limit = joint.find("limit") or joint.find("axis/limit")
    if limit is None:
        return math.inf
    text = limit.get("effort") or limit.findtext("effort")
    return (finite_numbers(text) or [math.inf])[0] if text.strip() else math.inf


def rotor_cause(model: XmlElement) -> str:
    """Return the cause that a diagnosis reports, or "" without rotors."""
    rotors = [f"line {one.place[1]}" for one in model.iter() if one.tag == ROTORS[0]]
    where = shortened(rotors)
    return f"Drake's own rotor inertia times gear ratio^2 ({where})" if rotors else ""


def own_mimics(mimics: Sequence[Mimic]) -> Change:
    """Return a change that writes `<mimic>` as `<drake:mimic>`."""

    def change(model: XmlElement) -> None:
        for joint in model.findall("joint"):
            for mimic in mimics:
                if mimic.joint != joint.get("name"):
                    continue
                attributes = {
                    "joint": mimic.leader,
                    "multiplier": repr(mimic.multiplier),
                    "offset": repr(mimic.offset),
                }
                joint.add(f"{PREFIX}mimic", SPACE | attributes)

    return change


def without_mimics(model: XmlElement) -> None:
    """Remove mimic joints, of a URDF or Drake's own."""
    for joint in model.findall("joint"):
        for mimic in [part for part in joint if part.tag in ("mimic", f"{PREFIX}mimic")]:
            joint.remove(mimic)


def weightless_links(model: XmlElement) -> tuple[str, ...]:
    """Return the names of links with `<gravity>false</gravity>`, which Drake ignores."""
    return tuple(link.get("name") for link in model.findall("link") if has_no_weight(link))


def weight_cause(names: Sequence[str]) -> str:
    """Return the cause that a diagnosis reports."""
    return f"Drake's ignoring of <gravity>false</gravity> ({shortened(names)})"


MIMICS = "Drake's leaving out of <mimic>"


class DrakeUrdf(DrakeModel, UrdfModel):
    """A URDF, or an SDFormat file."""

    def __init__(
        self, spec: ModelSpec, defaults: Mapping[str, bool | str], *, touches: bool = False
    ) -> None:
        self.stepping = str(spec.settings.get("stepping", SAP))
        reader = UrdfReader(
            name="drake",
            no_inertial="no mass and no moments",
            equal_bounds=True,
            no_friction="Drake",
            no_stops="Drake" if self.stepping == CONTINUOUS else "",
            stops_turns="Drake",
            positive_limits="Drake",
        )
        changes = _changes(spec, self.stepping, touches=touches)
        UrdfModel.__init__(self, spec, "Drake", reader, defaults, changes)
        self.floats = self.floats and self.declared.root != WORLD
        self._weightless = weightless_links(self.declared.robot) if spec.path.suffix == SDF else ()
        self._rotors = rotor_cause(self.declared.robot)
        held = self.settings["hold_mimics"] and self.stepping == CONTINUOUS
        free = replace(self.declared, changes=(*self.declared.changes, without_mimics)).text
        self.take(self.declared.text, spec.path.suffix[1:], self.mimics if held else (), free)
        if self.settings["weightless_links"]:
            bodies = map(self._plant.GetBodyByName, self._weightless)
            self.lifts = tuple(map(weight_of, bodies))
        refuse_balls(self._plant, self.declared.moments, spec.path)

    def complete(self, plant: Any) -> None:
        """Weld the root to the world, unless it floats or is the world itself."""
        root = self.declared.root
        if not self.floats and root != plant.world_frame().name():
            plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(root))

    def free_name(self, joint: Any) -> str:
        """Return the file's name of one of Drake's free joints."""
        is_root = joint.child_body().name() == self.declared.root
        return self.root if is_root else str(joint.name())

    @property
    def corrective_settings(self) -> Mapping[str, Mapping[str, object]]:
        """Elements that Drake leaves out with this stepping, with the settings that correct
        them.
        """
        settings: dict[str, Mapping[str, object]] = (
            {MIMICS: {"stepping": SAP}} if self.ignores_mimics else {}
        )
        if self._rotors and self.settings["rotors"] and not self.settings.get(ARMATURES):
            settings[self._rotors] = {"rotors": False}
        if self._weightless and not self.lifts:
            settings[weight_cause(self._weightless)] = {"weightless_links": True}
        return settings

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """Yield ignored parts of the file, and Drake's warnings."""
        yield from UrdfModel.remarks(self, z, w)
        yield from self.warning_remarks()

    @property
    def places(self) -> tuple[str, ...]:
        """Links and their centres of mass."""
        names = self.declared.links
        heavy = (name for name in names if name != WORLD)  # the world has no center of mass
        return (*(f"link:{name}" for name in names), *(f"centre:{name}" for name in heavy))


def _changes(spec: ModelSpec, stepping: str, *, touches: bool) -> list[Change]:
    """Return the changes to a file before Drake reads it, besides those that settings make for all
    engines.
    """
    smooth, free = bool(spec.settings.get("smooth", False)), stepping != SAP
    rotors = [] if spec.settings.get("rotors", True) else [without_rotors]
    if spec.path.suffix == SDF:
        bounds = [sdf_without_bounds, without_own] if smooth else []
        file = load_sdf(spec.path, spec.settings.get(MODEL, ""))
        kept = kept_mimics(file.mimics, followers_of(spec.settings, f"{spec.path}.toml"))
        return [*bounds, *rotors, sdf_mimics_of(()) if free else own_mimics(kept)]
    bounds_change = without_bounds if smooth else without_crossed_bounds
    shapes = (without_visuals, with_forms(FORMS), refuse_words) if touches else (without_shapes,)
    return [*shapes, *rotors, bounds_change, *([mimics_of(())] if free else [])]


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
        for free in self.declared.frees:
            for key in ("armature", "damping", "stiffness"):
                if getattr(free, key):
                    raise self.declared.source.unsupported(
                        free.element,
                        f"{key} of a free joint, which Drake's adapter does not support",
                    )
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
        self.drawn = dict(self._drawn())
        stated = {joint.name: joint.damping for joint in self.declared.singles}
        ordered = [stated.get(name, 0.0) for name in self.coordinates]
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

    def free_name(self, joint: Any) -> str:
        """Return the file's name of one of Drake's free joints."""
        names, body = body_names(self.declared.source), joint.child_body().name()
        return next(one.name for one in self.declared.frees if names[one.body] == body)

    def _drawn(self) -> Iterator[tuple[str, Array]]:
        """Yield the coordinates of free joints in the drawn configuration."""
        for joint in moving_joints(self._plant):
            if joint.num_velocities() == FREE:
                turn, place = np.split(np.array(joint.default_positions()), [4])
                drawn = np.concatenate([place, minimal_coordinates(turn, turn)])
                yield self.free_name(joint), drawn

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


DEFAULTS: Mapping[str, bool | str] = MappingProxyType({
    **ROBOTS,
    # Stepping: a discrete plant with either solver, or a continuous one with RK4 by the adapter.
    "stepping": SAP,
    # Whether mimic joints of a URDF are constrained where Drake itself ignores them.
    "hold_mimics": False,
    # Whether rotor inertias and gear ratios act that only Drake reads.
    "rotors": True,
    # Whether a force cancels the weight of SDFormat links with <gravity>false</gravity>; Drake
    # ignores the element.
    "weightless_links": False,
    **ADDED,
    # Whether armature of an MJCF is added to its joints; Drake reads it for driven joints only.
    "armature": True,
    # Whether several joints of one body are written as a chain of bodies; Drake places all of them
    # except the last at the parent's origin.
    "chained": False,
})  # fmt: skip


class DrakeEngine(UrdfEngine):
    """Adapter of Drake (Tedrake et al.)."""

    name = "drake"
    title = "Drake"
    formats = (".urdf", ".sdf", ".xml")
    takes_springs = (".urdf", ".sdf")
    package, distribution, extra = "pydrake", "drake", "drake"
    defaults = DEFAULTS
    words = MappingProxyType({"stepping": (SAP, TAMSI, CONTINUOUS)})
    capabilities = (
        "joints: slide, hinge, ball (SDFormat), floating root",
        "springs: added by the adapter; SDFormat springs by Drake",
        "mimic: soft in SAP, ignored in TAMSI",
        "next state: fixed base; continuous plants always",
        "accelerations: yes; couplers held exactly",
        "linearization: from steps",
        "steps: SAP, TAMSI: order 1; continuous: RK4 by the adapter",
        "whole step: limits and contacts of URDF in SAP, by its law",
    )
    default_settings_note = "no step of its own and -9.81 m/s^2"
    ignores = frozenset({"dynamics@friction", "joint@frictionloss"})
    non_physical = MappingProxyType({**URDF_NON_PHYSICAL, **SDF_NON_PHYSICAL, **MJCF_NON_PHYSICAL})
    switches = frozenset({"smooth", "couplings", "held", "actuators", "controls"})

    def loaded(self, spec: ModelSpec) -> LoadedModel:
        """Load a file whose settings are valid."""
        if spec.path.suffix == ".xml":
            return DrakeMjcf(spec, DEFAULTS, self.compilers.get(".xml"))
        return DrakeUrdf(spec, DEFAULTS)

    def load_whole(self, spec: ModelSpec) -> DrakeWhole | None:
        """Load a URDF with its limits and shapes."""
        if spec.path.suffix != ".urdf":
            return None
        whole = replace(spec, settings={**spec.settings, **WHOLE_SETTINGS})
        with engine_errors(spec.path, self.title):
            model = DrakeUrdf(whole, DEFAULTS, touches=True)
            robot = model.declared.robot
            return DrakeWhole(model, robot, tuple(without_law(robot, FORMS)))

    def armatures(self, path: Path) -> Mapping[str, float]:
        """Return reflected inertias of rotors, by joint."""
        if path.suffix not in (".urdf", SDF):
            return {}
        try:
            return reflected_inertias(Document(path).root)
        except LocationError:
            return {}  # loading it reports the error

    def samples(self) -> tuple[Sample, ...]:
        """Return one sample of each format."""
        return sample_urdf(), sample_sdf(), sample_mjcf()
