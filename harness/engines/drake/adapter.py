"""Drake, on URDF, SDFormat and MJCF: a discrete `MultibodyPlant`, or RK4 by the adapter.

A plant fixes its step when it is built, so the adapter builds one plant per step. Plants have no
geometry: no visuals, no contacts.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from physics_crosscheck.harness.engines.drake.mjcf import DrakeMjcf
from physics_crosscheck.harness.engines.drake.model import CONTINUOUS, SAP, TAMSI
from physics_crosscheck.harness.engines.drake.urdf import DrakeUrdf
from physics_crosscheck.harness.engines.mjcf_engine import ADDED, MJCF_NON_PHYSICAL, sample_mjcf
from physics_crosscheck.harness.engines.protocol import LoadedModel, ModelSpec, Sample
from physics_crosscheck.harness.engines.sdf import SDF_NON_PHYSICAL, sample_sdf
from physics_crosscheck.harness.engines.urdf import URDF_NON_PHYSICAL, sample_urdf
from physics_crosscheck.harness.engines.urdf_engine import UrdfEngine
from physics_crosscheck.harness.engines.urdf_sidecar import ROBOTS

DEFAULTS: Mapping[str, bool | str] = MappingProxyType({
    **ROBOTS,
    # Stepping: a discrete plant with either solver, or a continuous one with RK4 by the adapter.
    "stepping": SAP,
    # Whether mimic joints of a URDF are constrained where Drake itself ignores them.
    "hold_mimics": False,
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
        "joints: slide, hinge, floating root",
        "springs: added by the adapter; SDFormat springs by Drake",
        "mimic: soft in SAP, ignored in TAMSI",
        "next state: fixed base; continuous plants always",
        "accelerations: yes, without couplers",
        "linearization: from steps",
        "steps: SAP, TAMSI: order 1; continuous: RK4 by the adapter",
        "whole step: not judged",
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

    def samples(self) -> tuple[Sample, ...]:
        """Return one sample of each format."""
        return sample_urdf(), sample_sdf(), sample_mjcf()
