"""DART, on URDF: `World.step`, semi-implicit Euler with joints' dampers at the step's end.

Shapes are left out: bodies of one skeleton don't touch unless that is asked for. Limits are read,
and hold nothing unless `setLimitEnforcement` is called.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from harness.engines.bare import BARE, bare_cause, bare_links, weightless
from harness.engines.captured import STDERR, STDOUT, captured
from harness.engines.dart.steps import WorldSteps
from harness.engines.protocol import Array, EngineError, Force, Model, ModelSpec
from harness.engines.remark import Remark
from harness.engines.runge_kutta import each_alone
from harness.engines.source import folded
from harness.engines.step_rule import StepRule
from harness.engines.urdf import UrdfReader
from harness.engines.urdf_copy import changed, without_friction, without_shapes
from harness.engines.urdf_engine import UrdfEngine, UrdfModel
from harness.engines.urdf_sidecar import ROBOTS

SERVO = "<mimic> of {} is a servo, of which its leader feels nothing"

DEFAULTS: Mapping[str, bool] = MappingProxyType({
    **ROBOTS,
    # Whether a link without an inertial has 1 kg and 1 kg m^2, as DART has it, or nothing.
    "bare_links": True,
    # Whether <mimic> is a constraint on both joints (CouplerConstraint), or DART's own servo.
    "couplers": False,
})  # fmt: skip

READER = UrdfReader(name="dart", no_inertial="a mass of 1 kg", no_stops="DART")

_COLOUR = re.compile(r"\x1b\[[\d;]*m")


class DartEngine(UrdfEngine):
    """Adapter of DART (Lee et al. 2018)."""

    name = "dart"
    title = "DART"
    package, distribution, extra = "dartpy", "dartpy", "dart"
    defaults = DEFAULTS
    capabilities = (
        "URDF", "slides and hinges, roots that float", "joint dampers and friction",
        "springs on joint combinations as forces at every step", "URDF mimic as a servo",
    )  # fmt: skip
    unstated = "1 ms and -9.81 m/s^2"
    bare_link = "1 kg"

    def loaded(self, spec: ModelSpec) -> Model:
        """A URDF whose settings are in order."""
        return DartModel(spec)


class DartModel(UrdfModel):
    """A tree of slides and hinges, fixed or not, stepped by its world."""

    integrator = "semi-implicit euler"

    def __init__(self, spec: ModelSpec) -> None:
        import dartpy as dart

        further = [without_shapes]
        further += [without_friction] if spec.settings.get("smooth", False) else []
        further += [] if spec.settings.get("bare_links", True) else [weightless]
        super().__init__(spec, "DART", READER, DEFAULTS, further)
        self._bare = bare_links(self.declared.robot) if self.settings["bare_links"] else []
        self._body = self._skeleton()
        self._world = dart.simulation.World()
        self._world.setGravity(list(self.gravity))
        self._world.addSkeleton(self._body)
        moving = [self._body.getJoint(i) for i in range(self._body.getNumJoints())]
        joints = [joint for joint in moving if joint.getNumDofs()][1 if self.floats else 0 :]
        for joint in joints:
            if joint.getNumDofs() != 1:
                raise EngineError(f"{spec.path}: joint {joint.getName()!r} is no slide or hinge")
            mimic = joint.getActuatorType() == dart.dynamics.ActuatorType.MIMIC
            if mimic and self.settings["couplers"]:
                joint.setUseCouplerConstraint(True)
        springs = self.name([joint.getName() for joint in joints])
        self._damping = np.diag([joint.getDampingCoefficient(0) for joint in joints])
        self.stepper = self._steps = WorldSteps(self._world, self._body, self.floats, springs)
        slides = any(joint.getCoulombFriction(0) for joint in joints)
        if not (self.declared.mimics or slides):
            self.forward = each_alone(self._steps.accelerations)

    def _skeleton(self) -> Any:
        import dartpy as dart

        robot = changed(self.declared.robot, self.declared.changes)
        roots = dart.utils.DartLoaderRootJointType
        options, loader = dart.utils.DartLoaderOptions(), dart.utils.DartLoader()
        options.mDefaultRootJointType = roots.FLOATING if self.floats else roots.FIXED
        loader.setOptions(options)
        with captured((STDOUT, STDERR), again=False) as said:
            place = dart.common.Uri(self.path.resolve().as_uri())
            found = loader.parseSkeletonString(ET.tostring(robot, encoding="unicode"), place)
        told = _COLOUR.sub("", folded(" ".join(said)))
        if found is None:
            raise EngineError(f"{self.path}: DART can't load it: {told}")
        self._said = (told,) if told else ()
        return found

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """Order 1 throughout."""
        return 1, 1

    @property
    def step_rule(self) -> StepRule | None:
        """Dampers at the step's end; a root that floats is turned by an exponential of its own."""
        if self.floats:
            return None
        held = "couplings, which a servo or a constraint holds" if self.declared.mimics else ""
        late = self._damping if self._damping.any() else None
        return StepRule(scheme="semi-implicit Euler", damping=late, besides=held)

    @property
    def remedies(self) -> dict[str, Mapping[str, object]]:
        """What DART does on its own and the settings let stand, with what undoes it."""
        return {bare_cause(self._bare, "DART"): BARE} if self._bare else {}

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """What the URDF says in vain, and what joints that follow others are."""
        yield from super().remarks(z, w)
        for one in () if self.settings["couplers"] else self.declared.mimics:
            told, address = SERVO.format(one.joint), f"robot/joint[{one.joint}]"
            yield Remark(message=told, fault=True, address=address)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What DART has printed as it loaded the file."""
        return self._said

    @property
    def places(self) -> tuple[str, ...]:
        """Links and their centres of mass."""
        names = [self._body.getBodyNode(i).getName() for i in range(self._body.getNumBodyNodes())]
        return tuple(f"{kind}:{name}" for kind in ("link", "centre") for name in names)

    def poses(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """By its forward kinematics."""
        origins, turns = np.empty((len(z), len(places), 3)), np.empty((len(z), len(places), 3, 3))
        for k, row in enumerate(z):
            self._steps.reset(row, 0 * row)
            for f, place in enumerate(places):
                kind, _, name = place.partition(":")
                body = self._body.getBodyNode(name)
                pose = body.getTransform()
                inward = np.zeros(3) if kind == "link" else body.getLocalCOM()
                turns[k, f] = pose.rotation()
                origins[k, f] = pose.translation() + turns[k, f] @ inward
        return origins, turns

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """Step by step; what DART says of a motion that blows up is not printed."""
        self._world.setTimeStep(h)
        with captured((STDOUT, STDERR), again=False):
            return super().rollout(q, v, h, n, force, every)
