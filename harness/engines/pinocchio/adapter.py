"""Pinocchio, on URDF and MJCF: accelerations by the articulated-body algorithm, stepped by the
adapter.

Pinocchio has no integrator. It reads joint dampers and friction, but its dynamics ignore them, and
ignore limits, contacts and `<mimic>`. In an MJCF it also ignores springs, tendons, actuators and
joint equalities.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType

import numpy as np

from physics_crosscheck.harness.engines.mjcf_engine import ADDED, MJCF_NON_PHYSICAL, sample_mjcf
from physics_crosscheck.harness.engines.pinocchio.mjcf import PinocchioMjcf
from physics_crosscheck.harness.engines.pinocchio.model import PinocchioModel
from physics_crosscheck.harness.engines.pinocchio.reading import build_urdf
from physics_crosscheck.harness.engines.protocol import Array, LoadedModel, ModelSpec, Sample
from physics_crosscheck.harness.engines.remark import Remark
from physics_crosscheck.harness.engines.stepped_here import ADDED_HERE, dampers_not_added
from physics_crosscheck.harness.engines.urdf import (
    URDF_NON_PHYSICAL,
    UrdfReader,
    refuse_negative_masses,
    sample_urdf,
)
from physics_crosscheck.harness.engines.urdf_copy import (
    TRIMMED,
    dropped_cause,
    refuse_blanks,
    temporary_urdf,
    trim_numbers,
    without_shapes,
)
from physics_crosscheck.harness.engines.urdf_engine import UrdfEngine, UrdfModel

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
            refuse_blanks(self.declared.file.document, "Pinocchio")
        self._dropped = "" if trimmed else dropped_cause(self.declared.file.document, "Pinocchio")
        with temporary_urdf(self.declared.robot, spec.path, self.declared.changes) as path:
            model = build_urdf(path, spec.path, self.root if self.floats else "")
        if any(
            one.mass < 0 for one in model.inertias
        ):  # it replaces such a mass by 1e-30 in a division
            refuse_negative_masses(self.declared.file, "Pinocchio", floats=self.floats)
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
    capabilities = (
        "joints: slide, hinge, floating root",
        "springs: added by the adapter",
        "mimic: held by the adapter",
        "next state: yes",
        "accelerations: yes",
        "linearization: from steps",
        "steps: RK4 by the adapter, order 4",
        "whole step: not judged",
    )
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
