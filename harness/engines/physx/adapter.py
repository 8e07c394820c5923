"""PhysX, on USD, by ovphysx: reduced coordinates, 32-bit numbers, drives in substeps.

A step is n substeps of the temporal Gauss-Seidel solver, n being the articulation's position
iterations. PhysX's source states its law (BSD-3-Clause, github.com/NVIDIA-Omniverse/PhysX,
`physx/source/lowleveldynamics`). ovphysx 0.7.0 follows each line below to float rounding on a tree
of seven joints with branches, from rest and in motion, at 1/60 and 1/1000 s:

- Velocity terms and damping of links act once, at the start of the step; gravity and forces on
  joints act in every substep (`DyFeatherstoneArticulation.cpp`, `computeLinkStates` and
  `applyTgsSubstepForces`).
- Axes and unit responses are those of the start (`setupInternalConstraintsRecursive`).
- Drive, friction, position limit and speed limit act in this order, joint by joint, depth first
  (`solveInternalJointConstraintRecursive`).
- A drive is implicit in its own joint (`DyCpuGpuArticulation.h`, `computeDriveImpulse`). Its force
  with the joint's input is clamped in each substep (`clampDriveImpulse`).
- Damping of joints is the viscous part of friction: explicit, at most what stops the joint. The
  velocity iterations repeat it with the speed at the end (`computeFrictionImpulse`). Dry friction
  holds the joint up to the static effort, and beyond it is the dynamic one.
- A limit takes the speed that would pass it in the substep (`computeLimitImpulse`).
- Armature adds to the diagonal of the mass matrix, though not in ovphysx's tensor.
- A slide's displacement is that of its body, along the start's axis (`recordDeltaMotion`): its
  spring has no rule here.
- Links have angular damping of 0.05/s and turn by at most 100 rad/s, and a slow articulation sleeps
  (`ScArticulationSim.cpp`, `sleepCheck`); the adapter disables all three.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from types import MappingProxyType

import numpy as np

from physics_crosscheck.harness.documents.document import free_name
from physics_crosscheck.harness.documents.reading import USD_SUFFIXES
from physics_crosscheck.reference.mechanism.laws import Substeps
from physics_crosscheck.reference.mechanism.rotations import (
    SpatialInertia,
    angular_velocity,
    coordinate_rate,
    from_quaternion,
    minimal_coordinates,
    unit_quaternion,
)
from ..protocol import (
    Array,
    DefaultLeftOn,
    LoadedModel,
    ModelSpec,
    Sample,
    StepRule,
    UnsupportedError,
    clip_ranges,
    held_joints,
)
from ..remark import Remark
from ..runge_kutta import FREE
from ..source import open_stage, sample_stages, shortened, temporary_file
from ..tree_model import Stepper, TreeModel
from ..urdf_engine import UrdfEngine
from ..urdf_sidecar import ROBOTS
from .scene import FASTEST, PhysxScene, StageLayer

PHYSX_EFFECTS: Mapping[str, tuple[float | bool, str]] = MappingProxyType({
    "angular_damping": (0.05, "PhysX's angular damping of links"),
    "bounded_speeds": (True, "PhysX's bounds of speeds"),
})  # fmt: skip
"""PhysX's own value of each setting, and the cause that a diagnosis reports."""

FREED = "PhysX's free root: the articulation root is on the body of a fixed base"
"""The cause of the difference that `root_as_stated` removes."""

DEFAULTS: Mapping[str, float | bool | str] = MappingProxyType({
    **ROBOTS,
    # Angular damping of each link, 1/s, unless the file states it; PhysX's own is 0.05.
    "angular_damping": 0.0,
    # Whether links turn by at most 100 rad/s unless the file states it.
    "bounded_speeds": False,
    # Whether an articulation root on the body of a fixed base frees it, and a joint outside the
    # articulation holds it (PhysX's behaviour); otherwise the root moves to that joint.
    "root_as_stated": True,
})  # fmt: skip

UNLIMITED = 1e4
"""Positions, rad or m, beyond which no limit counts; PhysX stores 3e38 for a missing one."""


class PhysxEngine(UrdfEngine):
    """Adapter of PhysX 5 (NVIDIA), by its package ovphysx."""

    name = extra = "physx"
    title = "PhysX"
    package = distribution = "ovphysx"
    formats = USD_SUFFIXES
    takes_springs = ()
    switches = frozenset({"smooth", "held"})
    unfollowed = frozenset({"articulation root"})
    non_physical: Mapping[str, str] = MappingProxyType({})
    defaults = DEFAULTS
    capabilities = (
        "joints: slide, hinge, floating root",
        "springs: drives of joints",
        "mimic: constraint between joints",
        "next state: with a fixed base, without springs of slides",
        "accelerations: yes, without mimic and acceleration drives",
        "linearization: from steps, 32 bits",
        "steps: substeps of semi-implicit Euler, order 1, 32 bits",
        "whole step: not judged",
    )
    usual_mistakes = tuple(
        DefaultLeftOn(name=f"{cause} left on", setting=key, value=value, cause=cause)
        for key, (value, cause) in PHYSX_EFFECTS.items()
    )

    def load(self, spec: ModelSpec) -> LoadedModel:
        """Load a file; the step of a scene that states none is 1/60 s."""
        settings = {"step": 1 / 60, **open_stage(spec).settings, **spec.settings}
        return super().load(replace(spec, settings=settings))

    def loaded(self, spec: ModelSpec) -> LoadedModel:
        """Load a file whose settings are valid."""
        return PhysxModel(spec)

    def settings_for(self, suffix: str) -> Mapping[str, object]:
        """Return none: the file states step and gravity."""
        return {}

    def samples(self) -> tuple[Sample, ...]:
        """Return an arm for each suffix of text layers."""
        return sample_stages()


class PhysxModel(TreeModel):
    """An articulation of slides and hinges, fixed or floating."""

    integrator = "temporal Gauss-Seidel"
    epsilon = float(np.finfo(np.float32).eps)

    def __init__(self, spec: ModelSpec) -> None:
        super().__init__(spec, "PhysX", {**DEFAULTS, **spec.settings})
        stage = open_stage(spec)
        self._layer = layer = StageLayer(stage, self.settings, held_joints(spec))
        with temporary_file(layer.text.encode(), spec.path.with_suffix(".usda")) as path:
            self._scene = scene = PhysxScene(path, layer)
        weakref.finalize(self, scene.close).atexit = False
        for name in scene.joints:
            if name not in layer.joints:
                problem = f"joint {name!r} is neither a slide nor a hinge"
                raise UnsupportedError(problem, file=spec.path)
        names = [layer.joints[name][2] for name in scene.joints]
        self.floats = not layer.base
        self.root = free_name(scene.links[0], names) if self.floats else ""
        self.name(names)
        if self.settings["smooth"]:
            self._without_friction()
        self.stepper = self._steps = _ArticulationSteps(scene, layer, self.floats)

    def _without_friction(self) -> None:
        scene = self._scene
        friction = scene.read("DOF_FRICTION_PROPERTIES")
        friction[:, :2] = 0.0
        scene.write("DOF_FRICTION_PROPERTIES", friction)
        for name in ("DOF_MAX_VELOCITY", "DOF_MAX_FORCE"):
            scene.write(name, np.full(len(scene.joints), FASTEST))

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """Return order 1 for every input."""
        return 1, 1

    @property
    def step_rule(self) -> StepRule | None:
        """The rule: substeps, with a fixed base and without springs of slides."""
        law = self._steps.law
        if self.floats or not self._is_plain or np.any(law.stiffness[self._scene.slides]):
            return None
        return StepRule(scheme="semi-implicit Euler", substeps=law)

    @property
    def _is_plain(self) -> bool:
        """True if no joint follows another one, and no drive's gains are accelerations."""
        by_acceleration = self._scene.read("DOF_DRIVE_TYPE") == 2
        return not (self._layer.has_followers or by_acceleration.any())

    @property
    def home(self) -> Array:
        """Positions of the drawn configuration."""
        return self._steps.home

    @cached_property
    def limits(self) -> Array:
        """Joint limits, (nz, 2)."""
        result = np.tile([-np.inf, np.inf], (len(self.coordinates), 1))
        bounds = self._scene.read("DOF_LIMIT")
        result[self.layout.singles] = np.where(
            abs(bounds) > UNLIMITED, np.copysign(np.inf, bounds), bounds
        )
        return result

    @property
    def sampling_range(self) -> Array:
        """Sampling range within the file's limits, whether or not they are enforced."""
        limits = np.tile([-np.inf, np.inf], (len(self.coordinates), 1))
        limits[self.layout.singles] = [self._layer.limits[name] for name in self._scene.joints]
        return clip_ranges(super().sampling_range + self.home[:, None], limits)

    def accelerations(self, z: Array, w: Array, force: Array) -> Array | None:
        """Return M^-1 (f - C - G) of PhysX's tensors, with drives and dampers.

        None where PhysX does not hold the base itself, joints follow others, or gains of drives
        are accelerations.
        """
        if not (self._is_plain and (self.floats or self._scene.fixed)):
            return None
        result = np.full_like(z, np.nan)
        between = (self.limits[:, 0] <= z) & (z <= self.limits[:, 1])
        finite = np.isfinite(z + w + force) & between
        for row in np.flatnonzero(finite.all(axis=1)):
            result[row] = self._steps.acceleration(z[row], w[row], force[row])
        return result

    @property
    def corrective_settings(self) -> Mapping[str, Mapping[str, object]]:
        """PhysX's own effects that the settings leave active."""
        effects: dict[str, Mapping[str, object]] = {
            cause: {key: type(value)(0)}
            for key, (value, cause) in PHYSX_EFFECTS.items()
            if self.settings[key]
        }
        if not (self.floats or self._scene.fixed):
            effects[FREED] = {"root_as_stated": False}
        return effects

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """Yield active effects of the engine, and masses that it assumes."""
        for cause, settings in self.corrective_settings.items():
            (key,) = settings
            is_own = key in PHYSX_EFFECTS
            address = f"sidecar:settings.{key}" if is_own else self._layer.stated_root
            shows = ("damping",) if is_own else ("inertia",)
            yield Remark(
                kind="setting", message=cause, address=address, shows_in=shows, fault=not is_own
            )
        if names := self._layer.momentless:
            message = f"PhysX replaces the moments of {shortened(names)}: the file states none"
            yield Remark(kind="inertial", message=message, shows_in=("inertia",))
        masses = self._scene.read("BODY_MASS")
        for name, mass in zip(self._scene.links, masses, strict=True):
            if name in self._layer.massless and mass == self._layer.mass_unit:
                message = f"PhysX gives {name} {mass:g} kg, since it has no mass"
                yield Remark(kind="inertial", message=message, shows_in=("inertia",))

    @property
    def inertias(self) -> Mapping[str, SpatialInertia]:
        """Mass and inertia of each link in its frame."""
        read, result = self._scene.read, dict[str, SpatialInertia]()
        tensors = read("BODY_INERTIA").reshape(-1, 3, 3)
        rows = zip(read("BODY_MASS"), read("BODY_COM_POSE"), tensors, strict=True)
        for name, (mass, pose, tensor) in zip(self._scene.links, rows, strict=True):
            turn = from_quaternion(np.roll(pose[3:], 1))
            result[name] = SpatialInertia(float(mass), pose[:3], turn @ tensor @ turn.T)
        return result

    @property
    def places(self) -> tuple[str, ...]:
        """Links."""
        return tuple(f"link:{name}" for name in self._scene.links)

    def poses(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """Return poses by PhysX's forward kinematics."""
        rows = [self._scene.links.index(place.partition(":")[2]) for place in places]
        origins, turns = np.empty((len(z), len(rows), 3)), np.empty((len(z), len(rows), 3, 3))
        for k, q in enumerate(z):
            self._steps.reset(q, 0 * q)
            for i, pose in enumerate(self._scene.read("LINK_POSE")[rows]):
                origins[k, i], turns[k, i] = pose[:3], from_quaternion(np.roll(pose[3:], 1))
        return origins, turns


class _ArticulationSteps(Stepper):
    """An articulation in its scene; a free root's velocities are those of its centre of mass."""

    def __init__(self, scene: PhysxScene, layer: StageLayer, floats: bool) -> None:
        self._scene, self._first = scene, FREE if floats else 0
        self._near = np.array([1.0, 0.0, 0.0, 0.0])
        self._held_root = scene.read("ROOT_POSE")
        self._push = np.zeros((len(scene.links), 9))
        self._centre = scene.read("BODY_COM_POSE")[0, :3]
        driven = scene.read("DOF_DRIVE_TYPE") != 0
        count, repeats = layer.iterations
        self.law = Substeps(
            count=count,
            repeats=repeats,
            order=_depth_first(scene, layer.ends),
            stiffness=scene.read("DOF_STIFFNESS"),
            damping=scene.read("DOF_DAMPING"),
            target=scene.read("DOF_POSITION_TARGET"),
            speed=scene.read("DOF_VELOCITY_TARGET"),
            effort=np.where(driven, scene.read("DOF_MAX_FORCE"), np.inf),
            passive=scene.read("DOF_FRICTION_PROPERTIES")[:, 2],
        )
        self.home: Array = self.position()
        self.home[abs(self.home) < 1e-9] = 0.0  # PhysX moves joints by 1e-18 when it warms up

    def reset(self, q: Array, v: Array) -> None:
        """Set a state."""
        scene, first = self._scene, self._first
        pose, spin, moved = self._held_root, np.zeros(3), np.zeros(3)
        if first:
            self._near = unit_quaternion(q[3:FREE])
            turn = from_quaternion(self._near)
            spin = turn @ angular_velocity(q[3:FREE], v[3:FREE])
            moved = v[:3] + np.cross(spin, turn @ self._centre)
            pose = np.concatenate([q[:3], np.roll(self._near, -1)])
        if not scene.fixed:
            scene.write("ROOT_POSE", pose)
            scene.write("ROOT_VELOCITY", np.concatenate([moved, spin]))
        scene.write("DOF_POSITION", q[first:])
        scene.write("DOF_VELOCITY", v[first:])

    def position(self) -> Array:
        """Return the position, with rotation coordinates near to the last ones."""
        q = self._scene.read("DOF_POSITION")
        if not self._first:
            return q
        pose = self._scene.read("ROOT_POSE")
        turned = minimal_coordinates(np.roll(pose[3:], 1), self._near)
        self._near = unit_quaternion(turned)
        return np.concatenate([pose[:3], turned, q])

    def state(self) -> tuple[Array, Array]:
        """Return positions and velocities."""
        z, v = self.position(), self._scene.read("DOF_VELOCITY")
        if not self._first:
            return z, v
        moved, spin = np.split(self._scene.read("ROOT_VELOCITY"), 2)
        turn = from_quaternion(self._near)
        moved = moved - np.cross(spin, turn @ self._centre)
        return z, np.concatenate([moved, coordinate_rate(z[3:FREE], turn.T @ spin), v])

    def step(self, h: float, force: Array | None) -> None:
        """Step the scene, under inputs."""
        scene, first = self._scene, self._first
        if force is not None:
            if first:
                pose = scene.read("ROOT_POSE")
                moment = from_quaternion(np.roll(pose[3:], 1)) @ force[3:FREE]
                self._push[0] = *force[:3], *moment, *pose[:3]
                scene.write("LINK_WRENCH", self._push)
            scene.write("DOF_ACTUATION_FORCE", force[first:])
        scene.step(h)
        if force is not None:
            scene.write("DOF_ACTUATION_FORCE", 0 * force[first:])

    def acceleration(self, q: Array, v: Array, force: Array) -> Array:
        """Return accelerations at a state; those of a free root are of its centre in PhysX."""
        scene, law, first = self._scene, self.law, self._first
        self.reset(q, v)
        x, m, applied = q[first:], v[first:], force.copy()
        servo = law.stiffness * (law.target - x) + law.damping * (law.speed - m)
        limited = np.clip(servo + force[first:], -law.effort, law.effort)
        applied[first:] = limited - law.passive * m
        mass = scene.read("MASS_MATRIX")
        mass[first:, first:] += np.diag(scene.read("DOF_ARMATURE"))
        turn = from_quaternion(self._near)
        arm = turn @ self._centre
        if first:
            applied[3:FREE] = turn @ force[3:FREE] - np.cross(arm, force[:3])
        weight = scene.read("GRAVITY_FORCE") + scene.read("CORIOLIS_AND_CENTRIFUGAL_FORCE")
        result = np.asarray(np.linalg.solve(mass, applied - weight), dtype=np.float64)
        if first:
            spin = turn @ angular_velocity(q[3:FREE], v[3:FREE])
            result[:3] -= np.cross(result[3:FREE], arm) + np.cross(spin, np.cross(spin, arm))
            result[3:FREE] = turn.T @ result[3:FREE]
        return result


def _depth_first(scene: PhysxScene, ends: Sequence[tuple[str, str, str]]) -> tuple[int, ...]:
    """Return indices of the joints, from the root outward, siblings in PhysX's order."""
    between = {frozenset(bodies): joint for joint, *bodies in ends}
    order, passed = list[str](), {scene.links[0]}

    def visit(link: str) -> None:
        for child in scene.links:
            joint = between.get(frozenset((link, child)))
            if joint is not None and child not in passed:
                passed.add(child)
                order.append(joint)
                visit(child)

    visit(scene.links[0])
    return tuple(scene.joints.index(joint) for joint in order if joint in scene.joints)
