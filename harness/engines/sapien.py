"""SAPIEN, on URDF: reduced coordinates in PhysX, semi-implicit Euler in 32-bit numbers.

SAPIEN adds friction to every joint and damping to every link, bounds their speeds, and ignores an
inertial with zero mass or moments. Settings control these effects. Shapes are left out, except
those that give a link its mass, without contacts. Visual shapes would require a display.

Drives follow PhysX's law (`harness.engines.physx.adapter`), to 7e-7 of a step on a tree of hinges:
"TGS" is its sweep in substeps, except that gravity and joint forces act once, before them. "PGS"
sweeps over impulses of the whole step (`computeImplicitDriveParams` with `isTGSSolver` false),
which converges to drives at the step's end: to 2e-6 with SAPIEN's 10 iterations, to 2e-3 with 4.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.reference.mechanism.rotations import (
    angular_velocity,
    coordinate_rate,
    from_quaternion,
    minimal_coordinates,
    unit_quaternion,
)
from .installed import import_quietly
from .protocol import Array, DefaultLeftOn, LoadedModel, ModelSpec, StepRule
from .remark import Remark
from .runge_kutta import FREE
from .tree_model import SpringForces, Stepper
from .urdf import UrdfReader, refuse_negative_masses
from .urdf_copy import Change, bare_cause, temporary_urdf, without_visuals
from .urdf_engine import UrdfEngine, UrdfModel
from .urdf_sidecar import ROBOTS

SAPIEN_EFFECTS: Mapping[str, tuple[float | bool, str]] = MappingProxyType({
    "link_damping": (0.05, "SAPIEN's damping of links"),
    "joint_friction": (0.05, "SAPIEN's friction of joints"),
    "bounded_speeds": (True, "SAPIEN's bounds of speeds"),
    "dropped_inertials": (True, "SAPIEN's own inertia"),
})  # fmt: skip
"""SAPIEN's own value of each setting, and the cause that a diagnosis reports."""

SHOWS: Mapping[str, tuple[str, ...]] = MappingProxyType({"dropped_inertials": ("inertia",)})
"""The compiled terms that each effect enters; damping for the others."""

SERVO = "<mimic> of {} is a spring of 1e5 N/m or N m/rad in SAPIEN, or nothing"

DEFAULTS: Mapping[str, float | bool | str] = MappingProxyType({
    **ROBOTS,
    # Damping of the linear and angular velocity of each link, 1/s; SAPIEN's default is 0.05.
    "link_damping": 0.0,
    # A friction coefficient of each joint; SAPIEN uses 0.05, whatever the file states.
    "joint_friction": 0.0,
    # Whether speeds are limited to 10 m/s and 50 rad/s for a link, and to 100 for a joint.
    "bounded_speeds": False,
    # Whether a link without mass or without moments has SAPIEN's: of its shapes, or 1e-6 kg, and at
    # least 1e-6 kg m^2.
    "dropped_inertials": True,
    # The PhysX solver; SAPIEN's default is "TGS", which divides a step into ten.
    "solver": "PGS",
})  # fmt: skip

READER = UrdfReader(
    name="sapien",
    no_inertial="the mass of its collision shapes at 1000 kg/m^3, or 1e-6 kg",
    no_friction="SAPIEN",
)

FASTEST = 1e6
"""A speed bound that no motion reaches."""

FAINT = 1e-9
"""In kg or kg m^2: too small to be visible in 32 bits, but enough to keep an inertial."""


class SapienEngine(UrdfEngine):
    """Adapter of SAPIEN (Xiang et al. 2020, CVPR), on PhysX 5."""

    name = package = distribution = extra = "sapien"
    title = "SAPIEN"
    defaults = DEFAULTS
    words = MappingProxyType({"solver": ("PGS", "TGS")})
    capabilities = (
        "joints: slide, hinge, floating root",
        "springs: torques at every step",
        "mimic: soft spring between neighbors",
        "next state: with a fixed base and PGS",
        "accelerations: no",
        "linearization: from steps, 32 bits",
        "steps: semi-implicit Euler, order 1, 32 bits",
        "whole step: not judged",
    )
    default_settings_note = "10 ms and -9.81 m/s^2"
    ignores = frozenset({"dynamics@friction"})
    usual_mistakes = tuple(
        DefaultLeftOn(name=f"{cause} left on", setting=key, value=value, cause=cause)
        for key, (value, cause) in SAPIEN_EFFECTS.items()
        if DEFAULTS[key] != value
    )

    def loaded(self, spec: ModelSpec) -> LoadedModel:
        """Load a file whose settings are valid."""
        return SapienModel(spec)


class SapienModel(UrdfModel):
    """An articulation of slides and hinges, fixed or floating."""

    epsilon = float(np.finfo(np.float32).eps)

    def __init__(self, spec: ModelSpec) -> None:
        super().__init__(spec, "SAPIEN", READER, DEFAULTS, _changes(spec))
        refuse_negative_masses(self.declared.file, "SAPIEN", floats=self.floats)
        self.integrator = f"semi-implicit euler ({self.settings['solver']})"
        sapien = import_quietly("sapien")
        physx = sapien.physx
        uses_tgs = self.settings["solver"] == "TGS"
        physx.set_scene_config(gravity=list(self.gravity), enable_tgs=uses_tgs)
        self._scene = sapien.Scene([physx.PhysxCpuSystem()])  # owns its content
        loader = self._scene.create_urdf_loader()
        loader.fix_root_link = not self.floats
        with temporary_urdf(self.declared.robot, spec.path, self.declared.changes) as path:
            self._body = loader.load(str(path))
        self._dropped = _lost(self.declared.robot, self.floats)
        self._links = {link.name: link for link in self._body.links}
        self._disable_effects()
        joints = self._body.active_joints
        self._damping = np.array([float(joint.damping) for joint in joints])
        springs = self.name([joint.name for joint in joints])
        self.stepper = self._steps = _Steps(self._scene, self._body, self.floats, springs)

    def _disable_effects(self) -> None:
        """Disable SAPIEN's own effects, unless the settings keep them."""
        drag, friction = (self.settings[key] for key in ("link_damping", "joint_friction"))
        bounded = self.settings["bounded_speeds"]
        self._body.sleep_threshold = 0.0
        for link in self._links.values():
            link.linear_damping = link.angular_damping = drag
            for shape in link.collision_shapes:
                shape.set_collision_groups([0, 0, 0, 0])  # no contacts
            if not bounded:
                link.max_linear_velocity = link.max_angular_velocity = FASTEST
        for joint in self._body.active_joints:
            joint.friction = friction
            if not bounded:
                joint.max_velocity = FASTEST

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """Return order 1 for every input."""
        return 1, 1

    @property
    def step_rule(self) -> StepRule | None:
        """The rule: drives, which are dampers, at the step's end; TGS has no rule."""
        if self.floats or self.settings["solver"] != "PGS":
            return None
        damping = np.diag(self._damping) if self._damping.any() else None
        held = "couplings, which are springs" if self.declared.mimics else ""
        return StepRule(scheme="semi-implicit Euler", damping=damping, besides=held)

    @property
    def limits(self) -> Array:
        """Joint limits, (nz, 2)."""
        return super().limits if self.settings["smooth"] else self.stated_limits

    @property
    def _acts(self) -> dict[str, str]:
        """SAPIEN's own effects that the settings leave active: setting -> cause."""
        on = {key: cause for key, (_, cause) in SAPIEN_EFFECTS.items() if self.settings[key]}
        cause = on.pop("dropped_inertials", "")
        if cause and self._dropped:
            on["dropped_inertials"] = bare_cause(self._dropped, cause, "without mass or moments")
        return on

    @property
    def corrective_settings(self) -> Mapping[str, Mapping[str, object]]:
        """These effects, with the settings that disable them."""
        return {cause: {key: type(SAPIEN_EFFECTS[key][0])(0)} for key, cause in self._acts.items()}

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """Yield ignored parts of the file, active effects, and mimic joints that are springs."""
        yield from super().remarks(z, w)
        for key, cause in self._acts.items():
            yield Remark(
                kind="setting",
                message=cause,
                address=f"sidecar:settings.{key}",
                shows_in=SHOWS.get(key, ("damping",)),
            )
        for mimic in self.declared.mimics:
            message, address = SERVO.format(mimic.joint), f"robot/joint[{mimic.joint}]"
            yield Remark(kind="constraint", message=message, fault=True, address=address)

    @property
    def places(self) -> tuple[str, ...]:
        """Links and their centres of mass."""
        return tuple(f"{kind}:{name}" for kind in ("link", "centre") for name in self._links)

    def poses(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """Return poses by SAPIEN's forward kinematics."""
        origins, turns = np.empty((len(z), len(places), 3)), np.empty((len(z), len(places), 3, 3))
        for k, row in enumerate(z):
            self._steps.reset(row, 0 * row)
            for f, (kind, _, name) in enumerate(place.partition(":") for place in places):
                pose, centre = self._links[name].entity_pose, self._links[name].cmass_local_pose.p
                turns[k, f] = from_quaternion(np.array(pose.q, dtype=float))
                origins[k, f] = pose.p + (turns[k, f] @ centre if kind == "centre" else 0.0)
        return origins, turns


class _Steps(Stepper):
    """An articulation in its scene; a free root's velocities are those of its centre of mass."""

    def __init__(self, scene: Any, body: Any, floats: bool, springs: SpringForces) -> None:
        self._system, self._body, self._springs = scene.physx_system, body, springs
        self._root: Any = body.root
        self._first = FREE if floats else 0
        self._near = np.array([1.0, 0.0, 0.0, 0.0])
        self._pose = type(body.root_pose)

    def reset(self, q: Array, v: Array) -> None:
        """Set a state."""
        body, first = self._body, self._first
        if first:
            self._near = unit_quaternion(q[3:FREE])
            turn = from_quaternion(self._near)
            spin = turn @ angular_velocity(q[3:FREE], v[3:FREE])
            body.root_pose = self._pose(q[:3], self._near)
            body.root_linear_velocity = v[:3] + np.cross(spin, turn @ self._centre)
            body.root_angular_velocity = spin
        body.qpos, body.qvel, body.qf = q[first:], v[first:], np.zeros(len(q) - first)

    def position(self) -> Array:
        """Return the position, with rotation coordinates near to the last ones."""
        q: Array = self._body.qpos.astype(float)
        if not self._first:
            return q
        pose = self._body.root_pose
        turned = minimal_coordinates(np.array(pose.q, dtype=float), self._near)
        self._near = unit_quaternion(turned)
        return np.concatenate([pose.p, turned, q])

    def state(self) -> tuple[Array, Array]:
        """Return positions and velocities."""
        z, v = self.position(), self._body.qvel.astype(float)
        if not self._first:
            return z, v
        spin, turn = self._body.root_angular_velocity.astype(float), from_quaternion(self._near)
        moved = self._body.root_linear_velocity - np.cross(spin, turn @ self._centre)
        return z, np.concatenate([moved, coordinate_rate(z[3:FREE], turn.T @ spin), v])

    @property
    def _centre(self) -> Array:
        centre: Array = self._root.cmass_local_pose.p.astype(float)
        return centre

    def step(self, h: float, force: Array | None) -> None:
        """Step the system, under inputs and springs."""
        applied = np.zeros(self._first + self._body.dof) if force is None else force
        if self._first:
            placed = self._root.entity_pose
            turn = from_quaternion(np.array(placed.q, dtype=float))
            self._root.add_force_at_point(applied[:3], placed.p)
            self._root.add_force_torque(np.zeros(3), turn @ applied[3:FREE])
        applied = applied[self._first :]
        if not self._springs.empty:
            applied = applied + self._springs.forces(self._body.qpos.astype(float), self._body.qvel)
        self._body.qf = applied
        self._system.timestep = h
        self._system.step()

    def coast(self, h: float, n: int) -> None:
        """Step the system alone if no spring acts."""
        if not self._springs.empty:
            super().coast(h, n)
            return
        self._system.timestep = h
        for _ in range(n):
            self._system.step()


def _changes(spec: ModelSpec) -> tuple[Change, ...]:
    """Return the changes to the file before SAPIEN reads it."""
    free = bool(spec.settings.get("smooth"))
    keeps = not spec.settings.get("dropped_inertials", DEFAULTS["dropped_inertials"])
    floats = bool(spec.settings.get("floating"))
    with_inertials = (partial(_with_inertials, floats=floats),) if keeps else ()
    return (partial(_complete, free=free), *with_inertials, _without_idle_shapes)


def _complete(robot: XmlElement, free: bool) -> None:
    """Add the limits and dampers that SAPIEN requires; make continuous joints unbounded revolute
    joints.

    Also remove sensors, which require a display, and transmissions, whose text SAPIEN can't parse.
    """
    for tag in ("gazebo", "sensor", "transmission"):
        for element in robot.findall(tag):
            robot.remove(element)
    for dynamics in robot.findall("joint/dynamics"):
        dynamics.set("damping", dynamics.get("damping", "0"))
    for joint in robot.findall("joint"):
        limit = joint.find("limit")
        limit = joint.add("limit") if limit is None else limit
        lower, upper = (float(limit.get(key, "nan")) for key in ("lower", "upper"))
        turns = joint.get("type") == "continuous"
        if turns:
            joint.set("type", "revolute")
        if turns or free or not lower <= upper:
            limit.attributes.update(lower="-inf", upper="inf")
        limit.attributes.update(effort="0", velocity="0")


def _has_mass_and_moments(link: XmlElement) -> tuple[bool, bool]:
    """Return whether a link's inertial has a mass, and any moment of inertia."""
    numbers = (link.findall("inertial/mass"), link.findall("inertial/inertia"))
    mass, moments = (any(float(v) for e in one for v in e.attributes.values()) for one in numbers)
    return mass, moments


def _lost(robot: XmlElement, floats: bool) -> list[XmlElement]:
    """Return the moving links without mass or moments: SAPIEN ignores their inertials."""
    carried = {child.get("link") for child in robot.findall("joint/child")}
    return [
        link
        for link in robot.findall("link")
        if (floats or link.get("name") in carried) and not all(_has_mass_and_moments(link))
    ]


def _with_inertials(robot: XmlElement, floats: bool) -> None:
    """Add what these links lack, below the visible precision."""
    for link in _lost(robot, floats):
        inertial = link.find("inertial")
        inertial = link.add("inertial") if inertial is None else inertial
        for tag, keys in (("mass", ("value",)), ("inertia", ("ixx", "iyy", "izz"))):
            for element in inertial.findall(tag) or [inertial.add(tag)]:
                products = {} if tag == "mass" else dict.fromkeys(("ixy", "ixz", "iyz"), "0")
                least = {key: str(max(float(element.get(key, "0")), FAINT)) for key in keys}
                element.attributes.update({**products, **element.attributes, **least})


def _without_idle_shapes(robot: XmlElement) -> None:
    """Remove shapes, except those from which SAPIEN computes a mass."""
    without_visuals(robot)
    for link in robot.findall("link"):
        for shape in link.findall("collision") if all(_has_mass_and_moments(link)) else ():
            link.remove(shape)
