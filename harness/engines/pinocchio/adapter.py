"""Pinocchio, on URDF and MJCF: accelerations by the articulated-body algorithm, stepped by the
adapter.

Pinocchio has no integrator. It reads joint dampers and friction, but its dynamics ignore them, and
ignore limits, contacts and `<mimic>`. In an MJCF it also ignores springs, tendons, actuators and
joint equalities.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from physics_crosscheck.harness.engines.mjcf_engine import ADDED, MJCF_NON_PHYSICAL, sample_mjcf
from physics_crosscheck.harness.engines.pinocchio.mjcf import PinocchioMjcf
from physics_crosscheck.harness.engines.pinocchio.urdf import PinocchioUrdf
from physics_crosscheck.harness.engines.protocol import Model, ModelSpec, Sample
from physics_crosscheck.harness.engines.stepped_here import ADDED_HERE, dampers_not_added
from physics_crosscheck.harness.engines.urdf import URDF_NON_PHYSICAL, sample_urdf
from physics_crosscheck.harness.engines.urdf_engine import UrdfEngine

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
    )
    default_settings_note = "no step, since it takes none, and -9.81 m/s^2"
    ignores = frozenset({"dynamics@friction", "joint@frictionloss"})
    non_physical = MappingProxyType({**URDF_NON_PHYSICAL, **MJCF_NON_PHYSICAL})
    switches = frozenset({"smooth", "couplings", "held", "actuators", "controls"})
    usual_mistakes = (dampers_not_added("Pinocchio"),)

    def loaded(self, spec: ModelSpec) -> Model:
        """Load a file whose settings are valid."""
        if spec.path.suffix == ".urdf":
            return PinocchioUrdf(spec, DEFAULTS)
        return PinocchioMjcf(spec, DEFAULTS, self.compilers.get(".xml"))

    def samples(self) -> tuple[Sample, ...]:
        """Return one sample of each format."""
        return sample_urdf(), sample_mjcf()
