"""A URDF in Pinocchio."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from physics_crosscheck.harness.engines.pinocchio.model import PinocchioModel
from physics_crosscheck.harness.engines.pinocchio.reading import build_urdf
from physics_crosscheck.harness.engines.protocol import Array, ModelSpec
from physics_crosscheck.harness.engines.remark import Remark
from physics_crosscheck.harness.engines.urdf import UrdfReader, refuse_negative_masses
from physics_crosscheck.harness.engines.urdf_copy import (
    TRIMMED,
    dropped_cause,
    refuse_blanks,
    temporary_urdf,
    trim_numbers,
    without_shapes,
)
from physics_crosscheck.harness.engines.urdf_engine import UrdfModel

MIMICS = "Pinocchio's leaving out of <mimic>"

READER = UrdfReader(
    name="pinocchio",
    no_inertial="no mass and no moments",
    no_friction="Pinocchio",
    no_stops="Pinocchio",
)


class PinocchioUrdf(PinocchioModel, UrdfModel):
    """A URDF."""

    def __init__(self, spec: ModelSpec, defaults: Mapping[str, bool]) -> None:
        trimmed = bool(spec.settings.get("trimmed_numbers", False))
        changes = (without_shapes, *([trim_numbers] if trimmed else []))
        UrdfModel.__init__(self, spec, "Pinocchio", READER, defaults, changes)
        if not trimmed:
            refuse_blanks(self.declared.source, "Pinocchio")
        self._dropped = "" if trimmed else dropped_cause(self.declared.source, "Pinocchio")
        with temporary_urdf(self.declared.robot, spec.path, self.declared.changes) as path:
            model = build_urdf(path, spec.path, self.root if self.floats else "")
        if any(
            one.mass < 0 for one in model.inertias
        ):  # it replaces such a mass by 1e-30 in a division
            refuse_negative_masses(self.declared.source, "Pinocchio", floats=self.floats)
        moving = list(model.names)[1:]
        names = [[] if self.floats and i == 0 else [name] for i, name in enumerate(moving)]
        self._held = self.mimics if self.settings["hold_mimics"] else ()
        count = sum(map(len, names))
        self.take(model, names, np.zeros(count), self._held)

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
