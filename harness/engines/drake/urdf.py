"""A URDF, or an SDFormat file, in Drake."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from physics_crosscheck.harness.engines.drake.model import CONTINUOUS, SAP, DrakeModel
from physics_crosscheck.harness.engines.drake.plant import weight_of
from physics_crosscheck.harness.engines.drake.reading import refuse_balls
from physics_crosscheck.harness.engines.drake.sdf import (
    own_mimics,
    weight_cause,
    weightless,
    without_own,
)
from physics_crosscheck.harness.engines.protocol import Array, ModelSpec
from physics_crosscheck.harness.engines.remark import Remark
from physics_crosscheck.harness.engines.sdf_copy import sdf_mimics_of, sdf_without_bounds
from physics_crosscheck.harness.engines.urdf import UrdfReader
from physics_crosscheck.harness.engines.urdf_copy import (
    Change,
    mimics_of,
    without_bounds,
    without_crossed_bounds,
    without_shapes,
)
from physics_crosscheck.harness.engines.urdf_engine import SDF, UrdfModel

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
        self._weightless = weightless(self.declared.robot) if spec.path.suffix == SDF else ()
        held = self.settings["hold_mimics"] and self.stepping == CONTINUOUS
        self.take(self.declared.text, spec.path.suffix[1:], self.mimics if held else ())
        if self.settings["weightless_links"]:
            bodies = map(self._plant.GetBodyByName, self._weightless)
            self.lifts = tuple(map(weight_of, bodies))
        refuse_balls(self._plant, self.declared.moments, spec.path)

    def complete(self, plant: Any) -> None:
        """Weld its root to the world, unless it floats, or is the world by its name."""
        root = self.declared.root
        if not self.floats and root != plant.world_frame().name():
            plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(root))

    @property
    def remedies(self) -> Mapping[str, Mapping[str, object]]:
        """What Drake leaves out, of joints as it is stepped here, with what undoes it."""
        found: dict[str, Mapping[str, object]] = {MIMICS: {"stepping": SAP}} if self.let_go else {}
        if self._weightless and not self.lifts:
            found[weight_cause(self._weightless)] = {"weightless_links": True}
        return found

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """What the file says in vain, and what Drake says of it."""
        yield from UrdfModel.remarks(self, z, w)
        yield from self.said_remarks()

    @property
    def places(self) -> tuple[str, ...]:
        """Links and their centres of mass."""
        names = self.declared.links
        return tuple(f"{kind}:{name}" for kind in ("link", "centre") for name in names)


def _changes(spec: ModelSpec, stepping: str) -> list[Change]:
    """What is changed in a file before Drake sees it, besides what settings say to every engine."""
    smooth, free = bool(spec.settings.get("smooth", False)), stepping != SAP
    if spec.path.suffix == SDF:
        bounds = [sdf_without_bounds, without_own] if smooth else []
        return [*bounds, sdf_mimics_of(()) if free else own_mimics]
    own = without_bounds if smooth else without_crossed_bounds
    return [without_shapes, own, *([mimics_of(())] if free else [])]
