"""Pinocchio, on URDF and MJCF: its accelerations, by the articulated-body algorithm, stepped here.

Pinocchio has no stepper. Its dynamics take no account of the dampers and the friction of joints
that it reads, nor of limits, contacts, and `<mimic>`; of an MJCF nor of springs, tendons,
actuators and equalities of joints.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from physics_crosscheck.harness.engines.mjcf_engine import ADDED, MJCF_IDLE, sample_mjcf
from physics_crosscheck.harness.engines.pinocchio.mjcf import PinocchioMjcf
from physics_crosscheck.harness.engines.pinocchio.urdf import PinocchioUrdf
from physics_crosscheck.harness.engines.protocol import Model, ModelSpec, Sample
from physics_crosscheck.harness.engines.stepped_here import ADDED_HERE, dampers_not_added
from physics_crosscheck.harness.engines.urdf import IDLE, sample_urdf
from physics_crosscheck.harness.engines.urdf_engine import UrdfEngine

DEFAULTS: Mapping[str, bool] = MappingProxyType({
    **ADDED_HERE,
    **ADDED,
    # Whether numbers of a URDF that a blank follows are given to it without; Pinocchio drops the
    # <inertial> in which one stands.
    "trimmed_numbers": False,
    # Whether all root bodies of an MJCF are read; Pinocchio reads the first alone.
    "all_roots": True,
    # Whether an MJCF's geoms that touch nothing weigh something; Pinocchio takes them for looks.
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
    unstated = "no step, since it takes none, and -9.81 m/s^2"
    ignores = frozenset({"dynamics@friction", "joint@frictionloss"})
    idle = MappingProxyType({**IDLE, **MJCF_IDLE})
    switches = frozenset({"smooth", "couplings", "held", "actuators", "controls"})
    usual_mistakes = (dampers_not_added("Pinocchio"),)

    def loaded(self, spec: ModelSpec) -> Model:
        """A file whose settings are in order."""
        if spec.path.suffix == ".urdf":
            return PinocchioUrdf(spec, DEFAULTS)
        return PinocchioMjcf(spec, DEFAULTS, self.compilers.get(".xml"))

    def samples(self) -> tuple[Sample, ...]:
        """One of each format."""
        return sample_urdf(), sample_mjcf()
