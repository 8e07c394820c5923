"""Pinocchio, on URDF and MJCF: accelerations by the articulated-body algorithm, stepped by the
adapter.

Pinocchio has no integrator. It reads joint dampers and friction, but its dynamics ignore them, and
ignore limits, contacts and `<mimic>`. In an MJCF it also ignores springs, tendons, actuators and
joint equalities.

An MJCF in Pinocchio.

Its parser reads only the first root body, requires names of the model and of bodies, treats geoms
without contacts as visual geometry, and applies the drawn pose of a free joint twice.
"""

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.reference.mechanism.rotations import minimal_coordinates
from ..mjcf_copy import POSE, TOUCHES, copy_mjcf, without_pose
from ..mjcf_declared import DeclaredMjcf
from ..mjcf_defaults import bodies_of, has_shape_inertia
from ..mjcf_engine import ADDED, MJCF_NON_PHYSICAL, MjcfModel, sample_mjcf
from ..mjcf_joints import rows_of
from ..protocol import Array, Engine, EngineError, LoadedModel, ModelSpec, Sample
from ..remark import Remark
from ..runge_kutta import FREE
from ..source import temporary_file
from ..stepped_here import ADDED_HERE, CAPABILITIES, dampers_not_added
from ..urdf import URDF_NON_PHYSICAL, UrdfReader, refuse_negative_masses, sample_urdf
from ..urdf_copy import (
    TRIMMED,
    dropped_cause,
    refuse_blanks,
    temporary_urdf,
    trim_numbers,
    without_shapes,
)
from ..urdf_engine import UrdfEngine, UrdfModel
from .model import GROUND, PinocchioModel, build_urdf, read_mjcf

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
        drawn: Any = self._read(root) if self.floats else None
        model = self._read(without_pose(root))
        names, springs = self._names(model), list[tuple[float, Array]]()
        for free in self.declared.frees:
            if not model.existJointName(free.name):
                continue  # of a root that Pinocchio does not read
            rest = _drawn(drawn, free.name)
            turn = minimal_coordinates(rest[3:], rest[3:])
            self.drawn[free.name] = np.concatenate([rest[:3], turn])
            rest[4:] *= -1
            springs.append((free.stiffness * bool(self.settings["springs"]), rest))
            start = model.joints[model.getJointId(free.name)].idx_v
            model.armature[start : start + FREE] = free.armature
            model.damping[start : start + FREE] = free.damping
        refs = {one.name: one.ref for one in self.declared.singles}
        self.take(model, names, refs, self.mimics)
        pairs = zip(self._frees, springs, strict=True)
        self._frees = [free._replace(stiffness=k, rest=rest) for free, (k, rest) in pairs]
        self.misread = not resolved and (
            self._differs_from_defaults(model) or any(_unread(self.declared))
        )

    def _read(self, root: XmlElement) -> Any:
        with temporary_file(root.written(), self.path) as path:
            return read_mjcf(path, self.path)

    def _differs_from_defaults(self, model: Any) -> bool:
        """Return whether dampers and armatures of joints differ from those of their classes."""
        rows = [(one, FREE) for one in self.declared.frees]
        rows += [(one, 1) for one in self.declared.singles]
        stated = {
            key: [getattr(one, key) for one, size in rows for _ in range(size)]
            for key in ("damping", "armature")
        }
        return any(
            sorted(filter(None, map(float, getattr(model, key)))) != sorted(filter(None, numbers))
            for key, numbers in stated.items()
        )

    def _names(self, model: Any) -> Sequence[Sequence[str]]:
        """Return the names of the joints of each body, which form one joint."""
        rows = {row[0].name: row for _, row in rows_of(self.declared.joints)}
        names_by_joint = []
        for name in list(model.names)[1:]:
            row = rows.get(name) or rows.get(name.removeprefix("Composite_"))
            if row is None:
                raise EngineError(
                    f"{self.path}: Pinocchio makes a joint {name!r}, which the file does not have"
                )
            names_by_joint.append([one.name for one in row])
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
    """Return origin and quaternion, real part first, of a floating body as drawn, (7,)."""
    start = model.joints[model.getJointId(name)].idx_q
    positions: Array = np.array(model.referenceConfigurations["qpos0"])[start : start + 7]
    return np.concatenate([positions[:3], np.roll(positions[3:], 1)])


MIMICS = "Pinocchio's leaving out of <mimic>"

READER = UrdfReader(
    name="pinocchio",
    no_inertial="no mass and no moments",
    no_friction="Pinocchio",
    no_stops="Pinocchio",
    positive_limits="Pinocchio",
)


class PinocchioUrdf(PinocchioModel, UrdfModel):
    """A URDF."""

    def __init__(self, spec: ModelSpec, defaults: Mapping[str, bool]) -> None:
        trimmed = bool(spec.settings.get("trimmed_numbers", False))
        changes = (without_shapes, *([trim_numbers] if trimmed else []))
        UrdfModel.__init__(self, spec, "Pinocchio", READER, defaults, changes)
        if not trimmed:
            refuse_blanks(self.declared.file.document, "Pinocchio")
        self._dropped = "" if trimmed else dropped_cause(self.declared.file.document, "Pinocchio")
        with temporary_urdf(self.declared.robot, spec.path, self.declared.changes) as path:
            model = build_urdf(path, spec.path, self.root if self.floats else "")
        if any(
            one.mass < 0 for one in model.inertias
        ):  # it replaces such a mass by 1e-30 in a division
            refuse_negative_masses(self.declared.file, "Pinocchio", floats=self.floats)
        moving = list(model.names)[1:]
        names = [[self.root if self.floats and i == 0 else name] for i, name in enumerate(moving)]
        self._held = self.mimics if self.settings["hold_mimics"] else ()
        self.take(model, names, {}, self._held)

    @property
    def corrective_settings(self) -> dict[str, Mapping[str, object]]:
        """Elements that Pinocchio leaves out under the current settings, with corrections."""
        lost: Mapping[str, object] = {"hold_mimics": True}
        settings = {**self.undamped, **({MIMICS: lost} if self.mimics and not self._held else {})}
        return {**settings, **({self._dropped: TRIMMED} if self._dropped else {})}

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """Yield ignored parts of the URDF, and omitted dampers."""
        yield from UrdfModel.remarks(self, z, w)
        yield from self.damping_remarks()


DEFAULTS: Mapping[str, bool] = MappingProxyType({
    **ADDED_HERE,
    **ADDED,
    # Whether blanks after numbers of a URDF are removed; Pinocchio drops an <inertial> that
    # contains one.
    "trimmed_numbers": False,
    # Whether all root bodies of an MJCF are read; Pinocchio reads only the first.
    "all_roots": True,
    # Whether an MJCF's geoms without contacts have mass; Pinocchio treats them as visual geometry.
    "all_geoms": True,
})  # fmt: skip


class PinocchioEngine(UrdfEngine):
    """Adapter of Pinocchio (Carpentier et al. 2019)."""

    name = "pinocchio"
    title = "Pinocchio"
    formats = (".urdf", ".xml")
    package, distribution, extra = "pinocchio", "pin", "pinocchio"
    defaults = DEFAULTS
    capabilities = CAPABILITIES
    default_settings_note = "no step, since it takes none, and -9.81 m/s^2"
    ignores = frozenset({"dynamics@friction", "joint@frictionloss"})
    non_physical = MappingProxyType({**URDF_NON_PHYSICAL, **MJCF_NON_PHYSICAL})
    switches = frozenset({"smooth", "couplings", "held", "actuators", "controls"})
    usual_mistakes = (dampers_not_added("Pinocchio"),)

    def loaded(self, spec: ModelSpec) -> LoadedModel:
        """Load a file whose settings are valid."""
        if spec.path.suffix == ".urdf":
            return PinocchioUrdf(spec, DEFAULTS)
        return PinocchioMjcf(spec, DEFAULTS, self.compilers.get(".xml"))

    def samples(self) -> tuple[Sample, ...]:
        """Return one sample of each format."""
        return sample_urdf(), sample_mjcf()
