"""A URDF in Drake."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from typing import Any

from harness.engines.drake.model import CONTINUOUS, SAP, DrakeModel
from harness.engines.drake.reading import refuse_balls
from harness.engines.protocol import Array, ModelSpec
from harness.engines.remark import Remark
from harness.engines.urdf import UrdfReader, root_link
from harness.engines.urdf_copy import (
    changed,
    mimics_of,
    without_bounds,
    without_crossed_bounds,
    without_shapes,
)
from harness.engines.urdf_engine import UrdfModel

MIMICS = "Drake's leaving out of <mimic>"


class DrakeUrdf(DrakeModel, UrdfModel):
    """A URDF."""

    def __init__(self, spec: ModelSpec, defaults: Mapping[str, bool | str]) -> None:
        own = without_bounds if spec.settings.get("smooth", False) else without_crossed_bounds
        self.stepping = str(spec.settings.get("stepping", SAP))
        free = [mimics_of(())] if self.stepping != SAP else []
        reader = UrdfReader(
            name="drake",
            no_inertial="no mass and no moments",
            equal_bounds=True,
            no_friction="Drake",
            no_stops="Drake" if self.stepping == CONTINUOUS else "",
        )
        UrdfModel.__init__(self, spec, "Drake", reader, defaults, (without_shapes, own, *free))
        robot = changed(self.declared.robot, self.declared.changes)
        held = self.settings["hold_mimics"] and self.stepping == CONTINUOUS
        self.take(ET.tostring(robot, encoding="unicode"), "urdf", self.mimics if held else ())
        refuse_balls(self._plant, self.declared.robot, spec.path)

    def complete(self, plant: Any) -> None:
        """Weld its root to the world, unless it floats, or is the world by its name."""
        root = plant.GetFrameByName(root_link(self.declared.robot))
        if not self.floats and root.name() != plant.world_frame().name():
            plant.WeldFrames(plant.world_frame(), root)

    @property
    def remedies(self) -> Mapping[str, Mapping[str, object]]:
        """What Drake leaves out as it is stepped here."""
        return {MIMICS: {"stepping": SAP}} if self.let_go else {}

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """What the URDF says in vain, and what Drake says of it."""
        yield from UrdfModel.remarks(self, z, w)
        yield from self.said_remarks()

    @property
    def places(self) -> tuple[str, ...]:
        """Links and their centres of mass."""
        names = [link.get("name", "") for link in self.declared.robot.findall("link")]
        return tuple(f"{kind}:{name}" for kind in ("link", "centre") for name in names)
