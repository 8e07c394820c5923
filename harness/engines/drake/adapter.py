"""Drake, on URDF, SDFormat and MJCF: a `MultibodyPlant` that steps itself, or by RK4 here.

A plant has its step from the start, so that every step has a plant of its own. It is given no
geometry: nothing is seen, and nothing touches.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from physics_crosscheck.harness.engines.drake.mjcf import DrakeMjcf
from physics_crosscheck.harness.engines.drake.model import CONTINUOUS, SAP, TAMSI
from physics_crosscheck.harness.engines.drake.urdf import DrakeUrdf
from physics_crosscheck.harness.engines.mjcf_engine import ADDED, MJCF_IDLE, sample_mjcf
from physics_crosscheck.harness.engines.protocol import Model, ModelSpec, Sample
from physics_crosscheck.harness.engines.sdf import SDF_IDLE, sample_sdf
from physics_crosscheck.harness.engines.urdf import IDLE, sample_urdf
from physics_crosscheck.harness.engines.urdf_engine import UrdfEngine
from physics_crosscheck.harness.engines.urdf_sidecar import ROBOTS

DEFAULTS: Mapping[str, bool | str] = MappingProxyType({
    **ROBOTS,
    # How it steps: a discrete plant with either solver, or a continuous one, by RK4 here.
    "stepping": SAP,
    # Whether a URDF's joints are held to those that they follow where Drake itself lets them go.
    "hold_mimics": False,
    # Whether links of an SDFormat file with <gravity>false</gravity> have no weight, by a force
    # that carries it; Drake ignores the element.
    "weightless_links": False,
    **ADDED,
    # Whether armature of an MJCF is added to its joints; Drake reads that of driven joints alone.
    "armature": True,
    # Whether several joints of one body are written as a chain of bodies; Drake places all of them
    # but the last at the parent's origin.
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
    )
    unstated = "no step of its own and -9.81 m/s^2"
    ignores = frozenset({"dynamics@friction", "joint@frictionloss"})
    idle = MappingProxyType({**IDLE, **SDF_IDLE, **MJCF_IDLE})
    switches = frozenset({"smooth", "couplings", "held", "actuators", "controls"})

    def loaded(self, spec: ModelSpec) -> Model:
        """A file whose settings are in order."""
        if spec.path.suffix == ".xml":
            return DrakeMjcf(spec, DEFAULTS, self.compilers.get(".xml"))
        return DrakeUrdf(spec, DEFAULTS)

    def samples(self) -> tuple[Sample, ...]:
        """One of each format."""
        return sample_urdf(), sample_sdf(), sample_mjcf()
