"""A URDF, or an SDFormat file, in Drake.

Drake's SDFormat parser ignores `<mimic>` and defines its own element.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.sdf.read import has_no_weight
from physics_crosscheck.harness.documents.tree import Mimic
from physics_crosscheck.harness.engines.drake.model import CONTINUOUS, SAP, DrakeModel, refuse_balls
from physics_crosscheck.harness.engines.drake.plant import weight_of
from physics_crosscheck.harness.engines.protocol import Array, ModelSpec
from physics_crosscheck.harness.engines.remark import Remark
from physics_crosscheck.harness.engines.sdf import load_sdf
from physics_crosscheck.harness.engines.sdf_sidecar import MODEL, sdf_mimics_of, sdf_without_bounds
from physics_crosscheck.harness.engines.urdf import UrdfReader
from physics_crosscheck.harness.engines.urdf_copy import (
    Change,
    followers_of,
    mimics_of,
    without_bounds,
    without_crossed_bounds,
    without_shapes,
)
from physics_crosscheck.harness.engines.urdf_engine import SDF, UrdfModel
from physics_crosscheck.harness.engines.urdf_sidecar import kept_mimics

PREFIX = "drake:"
"""The prefix of elements that only Drake reads."""

SPACE = {"xmlns:drake": "http://drake.mit.edu"}


def without_own(model: XmlElement) -> None:
    """Remove joint elements that only Drake reads, such as rotor inertias."""
    for joint in model.findall("joint"):
        for part in list(joint):
            if part.tag.startswith(PREFIX):
                joint.remove(part)


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


def weightless_links(model: XmlElement) -> tuple[str, ...]:
    """Return the names of links with `<gravity>false</gravity>`, which Drake ignores."""
    return tuple(link.get("name") for link in model.findall("link") if has_no_weight(link))


def weight_cause(names: Sequence[str]) -> str:
    """Return the cause that a diagnosis reports."""
    listed = ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")
    return f"Drake's ignoring of <gravity>false</gravity> ({listed})"


MIMICS = "Drake's leaving out of <mimic>"


class DrakeUrdf(DrakeModel, UrdfModel):
    """A URDF, or an SDFormat file."""

    def __init__(self, spec: ModelSpec, defaults: Mapping[str, bool | str]) -> None:
        self.stepping = str(spec.settings.get("stepping", SAP))
        reader = UrdfReader(
            name="drake",
            no_inertial="no mass and no moments",
            equal_bounds=True,
            no_friction="Drake",
            no_stops="Drake" if self.stepping == CONTINUOUS else "",
        )
        UrdfModel.__init__(self, spec, "Drake", reader, defaults, _changes(spec, self.stepping))
        self._weightless = weightless_links(self.declared.robot) if spec.path.suffix == SDF else ()
        held = self.settings["hold_mimics"] and self.stepping == CONTINUOUS
        self.take(self.declared.text, spec.path.suffix[1:], self.mimics if held else ())
        if self.settings["weightless_links"]:
            bodies = map(self._plant.GetBodyByName, self._weightless)
            self.lifts = tuple(map(weight_of, bodies))
        refuse_balls(self._plant, self.declared.moments, spec.path)

    def complete(self, plant: Any) -> None:
        """Weld the root to the world, unless it floats or is the world itself."""
        root = self.declared.root
        if not self.floats and root != plant.world_frame().name():
            plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(root))

    @property
    def corrective_settings(self) -> Mapping[str, Mapping[str, object]]:
        """Elements that Drake leaves out with this stepping, with the settings that correct
        them.
        """
        settings: dict[str, Mapping[str, object]] = (
            {MIMICS: {"stepping": SAP}} if self.ignores_mimics else {}
        )
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
        return tuple(f"{kind}:{name}" for kind in ("link", "centre") for name in names)


def _changes(spec: ModelSpec, stepping: str) -> list[Change]:
    """Return the changes to a file before Drake reads it, besides those that settings make for all
    engines.
    """
    smooth, free = bool(spec.settings.get("smooth", False)), stepping != SAP
    if spec.path.suffix == SDF:
        bounds = [sdf_without_bounds, without_own] if smooth else []
        file = load_sdf(spec.path, spec.settings.get(MODEL, ""))
        kept = kept_mimics(file.mimics, followers_of(spec.settings, f"{spec.path}.toml"))
        return [*bounds, sdf_mimics_of(()) if free else own_mimics(kept)]
    bounds_change = without_bounds if smooth else without_crossed_bounds
    return [without_shapes, bounds_change, *([mimics_of(())] if free else [])]
