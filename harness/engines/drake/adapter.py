"""Drake, on URDF and SDFormat: a `MultibodyPlant` that is stepped by itself, or by RK4 here.

A plant has its step from the start, so that every step has a plant of its own. It is given no
geometry: nothing is seen, and nothing touches.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property, lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np

from harness.engines.drake.plant import DiscreteSteps, Plant, moving_joints
from harness.engines.drake.reading import logged, refuse_balls
from harness.engines.drake.sdf import own_mimics, without_own
from harness.engines.following import held_accelerations, leading
from harness.engines.protocol import Array, EngineError, Force, Model, ModelSpec
from harness.engines.remark import Remark
from harness.engines.runge_kutta import RungeKutta, each_alone, to_state
from harness.engines.sdf_copy import sdf_mimics_of, sdf_without_bounds
from harness.engines.source import folded
from harness.engines.step_rule import StepRule
from harness.engines.urdf import UrdfReader
from harness.engines.urdf_copy import (
    Change,
    mimics_of,
    without_bounds,
    without_crossed_bounds,
    without_shapes,
)
from harness.engines.urdf_engine import SDF, UrdfEngine, UrdfModel
from harness.engines.urdf_sidecar import ROBOTS

MIMICS = "Drake's leaving out of <mimic>"

SAP, TAMSI, CONTINUOUS = "sap", "tamsi", "continuous"

DEFAULTS: Mapping[str, bool | str] = MappingProxyType({
    **ROBOTS,
    # How it steps: a discrete plant with either solver, or a continuous one, by RK4 here.
    "stepping": SAP,
    # Whether joints are held to those that they follow where Drake itself lets them go.
    "hold_mimics": False,
})  # fmt: skip


class DrakeEngine(UrdfEngine):
    """Adapter of Drake (Tedrake et al.)."""

    name = "drake"
    title = "Drake"
    package, distribution, extra = "pydrake", "drake", "drake"
    formats = takes_springs = (".urdf", ".sdf")
    defaults = DEFAULTS
    words = MappingProxyType({"stepping": (SAP, TAMSI, CONTINUOUS)})
    capabilities = (
        "URDF", "SDFormat", "slides and hinges, roots that float", "joint dampers",
        "mimic (sap)",
        "discrete plants (sap, tamsi), continuous ones by RK4 here",
        "springs on joint combinations as forces at every step",
    )  # fmt: skip
    unstated = "no step of its own and -9.81 m/s^2"
    ignores = frozenset({"dynamics@friction"})

    def loaded(self, spec: ModelSpec) -> Model:
        """A file whose settings are in order."""
        return DrakeModel(spec)


class DrakeModel(UrdfModel):
    """A tree of slides and hinges, fixed or not."""

    def __init__(self, spec: ModelSpec) -> None:
        stepping = str(spec.settings.get("stepping", SAP))
        reader = UrdfReader(
            name="drake",
            no_inertial="no mass and no moments",
            equal_bounds=True,
            no_friction="Drake",
            no_stops="Drake" if stepping == CONTINUOUS else "",
        )
        super().__init__(spec, "Drake", reader, DEFAULTS, _changes(spec, stepping))
        self._stepping, self._continuous = stepping, stepping == CONTINUOUS
        self.integrator = "Runge-Kutta 4" if self._continuous else "semi-implicit euler"
        self._text, self._said = self.declared.text, list[str]()
        plant = self._plant = self._built(0.0 if self._continuous else self.step)
        joints = moving_joints(plant)[1 if self.floats else 0 :]
        for joint in joints:
            if joint.num_velocities() != 1:
                raise EngineError(f"{spec.path}: joint {joint.name()!r} is no slide or hinge")
        refuse_balls(plant, self.declared.moments, spec.path)
        self._springs = self.name([joint.name() for joint in joints])
        self._damping = np.diag([j.default_damping_vector()[0] for j in joints])
        mimics = self.declared.mimics
        hold = mimics if self.settings["hold_mimics"] and self._continuous else ()
        self._along = leading(hold, self.coordinates, spec.path) if hold else None
        self._lost = bool(mimics) and stepping != SAP and self._along is None
        self._discrete = lru_cache(maxsize=32)(self._discrete_of)
        forward = each_alone(self._accelerations)
        if self._continuous:
            self.stepper = RungeKutta(forward, self.floats)
        self.forward = None if stepping == SAP and mimics else forward

    def _built(self, h: float) -> Any:
        """A plant of this step; 0: a continuous one."""
        from pydrake.multibody.parsing import Parser
        from pydrake.multibody.plant import DiscreteContactApproximation, MultibodyPlant

        plant = MultibodyPlant(h)
        if h and self._stepping == TAMSI:
            plant.set_discrete_contact_approximation(DiscreteContactApproximation.kTamsi)
        if h:
            plant.SetUseSampledOutputPorts(False)
        try:
            with logged(self._said):
                Parser(plant).AddModelsFromString(self._text, self.path.suffix[1:])
                root = self.declared.root
                # A link of the name `world` is the world itself.
                if not self.floats and root != plant.world_frame().name():
                    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(root))
                plant.mutable_gravity_field().set_gravity_vector(self.gravity)
                plant.Finalize()
        except RuntimeError as error:
            told = folded(error).replace(f"<literal-string>{self.path.suffix}", self.path.name)
            raise EngineError(f"{self.path}: Drake can't load it: {told}") from None
        return plant

    @cached_property
    def _one(self) -> Plant:
        """A continuous plant: one that is stepped tells no accelerations."""
        return self._put(self._plant if self._continuous else self._built(0.0))

    def _put(self, plant: Any) -> Plant:
        return Plant(plant, self.floats, self._springs)

    def _discrete_of(self, h: float) -> DiscreteSteps:
        plant = self._plant if h == self.step else self._built(h)
        return DiscreteSteps(self._put(plant), self.floats, not self._springs.empty)

    def _accelerations(self, x: Array, m: Array, f: Array) -> Array:
        """Of one state's positions, velocities and forces, as `RungeKutta` has them."""
        a = self._one.accelerations(x, m, f)
        if self._along is None:
            return a
        mass = self._one.mass(x)
        return held_accelerations(mass, mass @ a, self._along)

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """Step by step, in the plant of that step."""
        if not self._continuous:
            self.stepper = self._discrete(h)
        return super().rollout(q, v, h, n, force, every)

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """Order 1 of discrete plants; of RK4 4, until an input is held over the step."""
        return (4 if self._continuous and not varying_input else 1), 1

    @property
    def step_rule(self) -> StepRule | None:
        """SAP has dampers at the step's end; no rule tells how a plant turns a root that floats."""
        if self._continuous:
            return StepRule(scheme="Runge-Kutta 4")
        if self.floats:
            return None
        late = self._damping if self._stepping == SAP and self._damping.any() else None
        soft = "couplings, which are soft" if self.declared.mimics and not self._lost else ""
        return StepRule(scheme="semi-implicit Euler", damping=late, besides=soft)

    @property
    def integrators(self) -> Mapping[str, Mapping[str, object]]:
        """RK4, where nothing is to be held by constraints."""
        alone = not self._continuous and not self.declared.mimics
        return {"Runge-Kutta 4": {"stepping": CONTINUOUS}} if alone else {}

    @property
    def limits(self) -> Array:
        """Of joints that discrete plants hold, (nz, 2)."""
        stopped = not (self._continuous or self.settings["smooth"])
        return self.stated_limits if stopped else super().limits

    @property
    def remedies(self) -> Mapping[str, Mapping[str, object]]:
        """What Drake leaves out as it is stepped here."""
        return {MIMICS: {"stepping": SAP}} if self._lost else {}

    @property
    def warnings(self) -> tuple[str, ...]:
        """What Drake's parser has warned of."""
        return tuple(dict.fromkeys(self._said))

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """What the file says in vain, and what Drake says of it."""
        yield from super().remarks(z, w)
        yield from (Remark(message=f"Drake: {word}", address="") for word in self.warnings)

    @property
    def places(self) -> tuple[str, ...]:
        """Links and their centres of mass."""
        names = self.declared.links
        return tuple(f"{kind}:{name}" for kind in ("link", "centre") for name in names)

    def poses(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """By its forward kinematics."""
        one = self._put(self._plant)
        origins, turns = np.empty((len(z), len(places), 3)), np.empty((len(z), len(places), 3, 3))
        for k, row in enumerate(z):
            x, m = to_state(row, 0 * row) if self.floats else (row, 0 * row)
            one.put(x, m)
            for f, place in enumerate(places):
                kind, _, name = place.partition(":")
                body = self._plant.GetBodyByName(name)
                pose = body.EvalPoseInWorld(one.context)
                inward = np.zeros(3) if kind == "link" else body.default_com()
                origins[k, f] = pose.multiply(inward)
                turns[k, f] = pose.rotation().matrix()
        return origins, turns


def _changes(spec: ModelSpec, stepping: str) -> list[Change]:
    """What is changed in a file before Drake sees it, besides what settings say to every engine."""
    smooth, free = bool(spec.settings.get("smooth", False)), stepping != SAP
    if spec.path.suffix == SDF:
        bounds = [sdf_without_bounds, without_own] if smooth else []
        return [*bounds, sdf_mimics_of(()) if free else own_mimics]
    own = without_bounds if smooth else without_crossed_bounds
    return [without_shapes, own, *([mimics_of(())] if free else [])]
