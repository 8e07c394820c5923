"""PyBullet, on URDF, with one physics server per process: it holds one model, and each loads itself
again where another one has been loaded since.

PyBullet's own effects, the URDF elements that it ignores, and its loss of precision.

Some errors it explains only on the C library's stdout.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.documents.document import Mimic
from physics_crosscheck.harness.documents.urdf import UrdfFile
from physics_crosscheck.reference.mechanism.rotations import SpatialInertia
from ..installed import capture_output, version_of
from ..protocol import (
    Array,
    DefaultLeftOn,
    Engine,
    EngineError,
    Force,
    LoadedModel,
    ModelSpec,
    Sample,
    Spring,
    StepRule,
    WholeModel,
    clip_ranges,
    held_joints,
)
from ..remark import Remark
from ..source import engine_errors, load_failure, one_line, refused, shortened
from ..urdf import (
    SETTINGS,
    URDF_NON_PHYSICAL,
    UrdfReader,
    load_urdf,
    refuse_negative_masses,
    sample_urdf,
    urdf_remarks,
)
from ..urdf_copy import (
    BARE,
    Change,
    bare_cause,
    bare_links,
    followers_of,
    temporary_urdf,
    without_shapes,
    without_visuals,
)
from ..urdf_sidecar import check_settings, joint_springs, kept_mimics
from .base import Ball, Base
from .inertias import (
    EXACT,
    axes_cause,
    axes_remarks,
    check_inertias,
    held_inertias,
    lost_inertias,
    refuse_fixed_root,
)
from .settings import (
    DEFAULTS,
    DISABLED_EFFECTS,
    SIX_DIGITS,
    UNIT,
    UNSCALED,
    changes_of,
    length_cause,
    long_axes,
    scale_cause,
    scaled_inertias,
)
from .shapes import LinkShape, link_shapes, refuse_large_shapes, simple_shapes
from .stepper import BodyStepper, add_floor, forget_contacts, link_places
from .whole import WHOLE_SETTINGS, PybulletWhole

_PLACE = re.compile(r"b3(Warning|Error|Printf)\[[^\]]*\]:\s*")


@contextmanager
def collect_printed_errors() -> Iterator[list[str]]:
    """Yield a list that holds the printed errors as sentences after the block ends.

    The output is printed again afterwards.
    """
    messages: list[str] = []
    texts: list[str] = []
    try:
        with capture_output() as texts:
            yield messages
    finally:
        messages += _errors("".join(texts))


def _errors(text: str) -> list[str]:
    """Join the errors at the end into one sentence; each part follows b3Error.

    Their places in PyBullet's sources are left out, since they do not help the user.
    """
    parts = [" ".join(part.split()) for part in _PLACE.split(text)[2::2] if part.strip()]
    kinds = _PLACE.findall(text)
    errors = [part for kind, part in zip(kinds, parts, strict=False) if kind == "Error"]
    return ["; ".join(errors).replace(":; ", ": ")] if errors else []


CAUSES = {
    "link_damping": "PyBullet's own damping of links",
    "motors": "PyBullet's own motors",
    "inertia_from_file": "PyBullet's own inertias of collision shapes",
}
"""The cause of each effect that a setting leaves on."""

_PARTS = {
    "link_damping": "link damping (0.04)",
    "motors": "joint motors",
    "speed": "speed limit",
    "inertia_from_file": "inertia from collision shapes",
    "gravity": "gravity",
}
"""Effects that the adapter disables: two of them always, the others by their settings."""

_LEFT_ON: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "link_damping": (
        "it brakes every link by its speed and the square of it",
        ("damping", "friction", "acceleration"),
    ),
    "motors": ("it holds every joint at rest with its motor", ()),
    "inertia_from_file": ("it ignores the file's inertias", ("inertia",)),
}
"""The effect of each if it is left on, and the compiled terms that it may explain."""

_URDF = UrdfReader(
    name="pybullet",
    no_inertial="a mass of 1 kg",
    equal_bounds=True,
    no_friction="PyBullet",
    long_axes="PyBullet",
)


def model_remarks(
    file: UrdfFile, joints: Sequence[str], on: Mapping[str, float | bool], z: Array, w: Array
) -> Iterator[Remark]:
    """Yield ignored parts of the URDF, and effects that are disabled, or left on by these
    settings.
    """
    yield from urdf_remarks(_URDF, file, joints, z, w)
    *parts, last = [part for key, part in _PARTS.items() if key not in on]
    yield Remark(
        message=f"PyBullet's own {', '.join(parts)} and {last} are switched off by the adapter"
    )
    for key, value in on.items():
        does, shows_in = _LEFT_ON[key]
        yield Remark(
            kind="setting",
            message=f"{CAUSES[key]}, left on by the setting {key}: {does}",
            fault=not shows_in,
            address=f"sidecar:settings.{key}",
            value=float(value),
            shows_in=shows_in,
        )


def products_caveat(path: Path) -> tuple[str, ...]:
    """Return a note on products of inertia if a URDF has them."""
    try:
        links = load_urdf(path).links.values()
    except EngineError:
        return ()  # loading it reports the error
    if not any(any(link.body.inertia[3:]) for link in links):
        return ()
    return (
        f"{path.name} has products of inertia; PyBullet finds their principal axes "
        "only to about 1e-9, so a discrepancy of that size may be PyBullet's",
    )


MAX_LINKS = 127
"""Links of a body beside its root whose state PyBullet returns (`MAX_DEGREE_OF_FREEDOM`)."""

_client: int | None = None
_loaded: object = None


class PybulletEngine(Engine):
    """Adapter of PyBullet (Coumans and Bai)."""

    name = "pybullet"
    title = "PyBullet"
    banner = "pybullet build time"
    formats = (".urdf",)
    capabilities = (
        "joints: slide, hinge, ball, floating root",
        "springs: torques at every step",
        "mimic: JOINT_GEAR by the adapter",
        "next state: yes",
        "accelerations: no",
        "linearization: from steps",
        "steps: semi-implicit Euler, order 1",
        "whole step: limits, motors, contacts; not balls, SDF, MJCF (own inertias)",
    )
    preferred = (".urdf",)
    places = (".urdf",)
    default_settings_note = "1/240 s and no gravity"
    massless_link_default = "1 kg"
    takes_springs = (".urdf",)
    switches = frozenset({"smooth", "couplings", "held"})
    non_physical = URDF_NON_PHYSICAL
    ignores = frozenset({"dynamics@friction"})
    usual_mistakes = (
        DefaultLeftOn(
            name="PyBullet's damping left on",
            setting="link_damping",
            value=0.04,
            cause=CAUSES["link_damping"],
        ),
        DefaultLeftOn(
            name="PyBullet's motors left on", setting="motors", value=True, cause=CAUSES["motors"]
        ),
        DefaultLeftOn(
            name="PyBullet's inertia flag forgotten",
            setting="inertia_from_file",
            value=False,
            cause=CAUSES["inertia_from_file"],
        ),
    )

    def version(self) -> str | None:
        """Return the version of the installed package, or None."""
        return version_of("pybullet", "pybullet")

    def load(self, spec: ModelSpec) -> PybulletModel:
        """Load a URDF into this process's physics server."""
        file = load_urdf(spec.path)
        check_settings(spec, self.title, self.default_settings_note, DEFAULTS)
        # PyBullet accepts them, but moves with other masses.
        refuse_negative_masses(file, self.title, floats=bool(spec.settings.get("floating")))
        springs = [*joint_springs(file, held_joints(spec)), *spec.springs]
        with engine_errors(spec.path, self.title):
            return PybulletModel(spec, file, springs)

    def load_whole(self, spec: ModelSpec) -> WholeModel | None:
        """Load a URDF with limits, shapes and motors."""
        if spec.path.suffix not in self.formats:
            return None
        whole = replace(spec, settings={**spec.settings, **WHOLE_SETTINGS})
        with engine_errors(spec.path, self.title):
            file = load_urdf(spec.path)
            model = PybulletModel(whole, file, [], (without_visuals,))
            body, is_free = model.loaded_stepper().body, bool(spec.settings.get("floating"))
            refuse_large_shapes(body, file.document.root, floating=is_free)
            return PybulletWhole(model, model.loaded_stepper)

    def settings_for(self, suffix: str) -> Mapping[str, object]:
        """Return step and gravity."""
        return SETTINGS

    def caveats(self, path: Path) -> tuple[str, ...]:
        """Return a note on products of inertia."""
        return products_caveat(path)

    def samples(self) -> tuple[Sample, ...]:
        """Return a URDF."""
        return (sample_urdf(),)


class PybulletModel(LoadedModel):
    """A multibody of slides, hinges and balls, fixed or floating, stepped by semi-implicit
    Euler.
    """

    integrator = "semi-implicit euler"

    def __init__(
        self,
        spec: ModelSpec,
        file: UrdfFile,
        springs: list[Spring],
        changes: tuple[Change, ...] = (),
    ) -> None:
        self.path = str(spec.path)
        self.step = float(spec.settings["step"])  # type: ignore[arg-type]  # checked by the sidecar
        if (count := len(file.links) - 1) > MAX_LINKS:
            raise EngineError(
                f"{self.path}: PyBullet moves at most {MAX_LINKS} links and the root, and it has"
                f" {count} and the root; merge links behind fixed joints, or leave PyBullet out"
            )
        for joint in file.joints.values():
            if joint.element.get("type") == "floating":
                raise refused(joint.element, f"PyBullet welds the floating joint {joint.name!r}")
        self._declared = spec, file, springs
        self._texts: dict[tuple[Change, ...], bytes] = {}
        self._changes = (*changes_of(spec), *changes)
        self._load()

    def _load(self) -> None:
        import pybullet as p

        global _client, _loaded
        if _client is None:
            _client = p.connect(p.DIRECT)
        _loaded = self
        spec, file, springs = self._declared
        robot = file.document.root
        p.resetSimulation()
        # PyBullet caches files by name even across a reset, so a rewritten file would not be read
        # again. The default residual threshold would stop the solver early, at 1e-7; at 1e-30, the
        # square of a speed, further iterations change rounding only. 28 gears take 400.
        p.setPhysicsEngineParameter(
            enableFileCaching=0, numSubSteps=0, numSolverIterations=400,
            solverResidualThreshold=1e-30,
        )  # fmt: skip
        self.gravity = tuple(spec.settings["gravity"])  # type: ignore[arg-type]  # checked
        p.setGravity(*spec.settings["gravity"])  # type: ignore[misc]  # checked by the sidecar
        self._body = self._load_file(self._changes)
        # Inertias of collision shapes are unrelated to the file's.
        uses_file_inertias = self._setting("inertia_from_file")
        floats = bool(self._setting("floating"))
        loaded = held_inertias(self._body, base=floats) if uses_file_inertias else {}
        self._lost = lost_inertias(robot, loaded)
        self._long = {} if self._setting("unit_axes") else long_axes(robot)
        self._scales = scaled_inertias(robot) if self._setting("scaled_inertias") else []
        self._joints, self._joint_names, balls = self._moving_joints()
        self._bare = bare_links(robot, floats=floats) if self._setting("bare_links") else []
        if floats:
            refuse_fixed_root(file, self._body)
        base = [Base(self._body, file.base)] if floats else []
        self._turning: list[Base | Ball] = [*base, *balls]
        turned = (name for one in self._turning for name in one.names)
        self.coordinates = (*turned, *self._joint_names)
        check_inertias(self.path, self._body, robot if uses_file_inertias else None)
        self._disable_effects()
        pulls = [self._resolve(spring) for spring in springs]
        self.stepper = BodyStepper(self._body, self._joints, self._turning, pulls)
        self._floor = add_floor() if self._setting("floor") else None
        held = followers_of(spec.settings, self.path)
        self._gears = [self._gear(mimic) for mimic in kept_mimics(file.mimics, held)]

    def _load_file(self, changes: Sequence[Change], flags: int = 0) -> int:
        import pybullet as p

        spec, file, _ = self._declared
        # Without the flag PyBullet computes inertias from the collision shapes.
        flags |= p.URDF_USE_INERTIA_FROM_FILE if self._setting("inertia_from_file") else 0
        # Visual shapes do not affect the motion and take 95 % of the loading time.
        flags |= p.URDF_IGNORE_VISUAL_SHAPES
        try:
            with (
                temporary_urdf(file.document.root, spec.path, changes, self._texts) as path,
                collect_printed_errors() as messages,
            ):
                fixed = int(not self._setting("floating"))
                return int(p.loadURDF(str(path), useFixedBase=fixed, flags=flags))
        except p.error as error:
            reason = messages[-1] if messages else one_line(error)
            raise load_failure("PyBullet", spec.path, reason) from None

    def _setting(self, key: str) -> float | bool:
        value = self._declared[0].settings.get(key, DEFAULTS[key])
        assert isinstance(value, (int, float))  # checked on loading
        return value

    @property
    def corrective_settings(self) -> dict[str, Mapping[str, object]]:
        """PyBullet's own effects that the settings leave active, with corrections."""
        settings: dict[str, Mapping[str, object]] = {
            CAUSES[key]: {key: DISABLED_EFFECTS[key]} for key in self._left_on()
        }
        if self._scales:
            settings[scale_cause(self._scales)] = UNSCALED
        if self._bare:
            settings[bare_cause(self._bare, "PyBullet's own 1 kg and 1 kg m^2")] = BARE
        if self._long:
            settings[length_cause(self._long)] = UNIT
        return {**settings, axes_cause(self._lost): EXACT} if self._lost else settings

    @property
    def precision_limits(self) -> Mapping[str, Mapping[str, object]]:
        """Principal axes that PyBullet's sweeps leave off, and lengths of axes of six digits."""
        lost = {"principal axes": (self._lost, EXACT)}
        if max(map(abs, self._long.values()), default=0.0) <= SIX_DIGITS:
            lost["length of the axes"] = self._long, UNIT
        return {f"{key} of {shortened(tuple(of), 3)}": by for key, (of, by) in lost.items() if of}

    def _left_on(self) -> list[str]:
        return [key for key, default in DISABLED_EFFECTS.items() if self._setting(key) != default]

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """Yield ignored parts of the URDF, and effects that are switched off or left on."""
        yield from model_remarks(
            self._declared[1],
            self.coordinates,
            {k: self._setting(k) for k in self._left_on()},
            z,
            w,
        )
        yield from axes_remarks(self._lost)

    @property
    def inertias(self) -> Mapping[str, SpatialInertia]:
        """Mass and inertia of each link."""
        self._ensure_loaded()
        return held_inertias(self._body, base=True)

    @property
    def places(self) -> tuple[str, ...]:
        """Links and their centres of mass."""
        self._ensure_loaded()
        return tuple(link_places(self._body))

    @cached_property
    def _shapes(self) -> Mapping[str, LinkShape]:
        """Collision shapes of a second body, which is removed; none if PyBullet can't load it."""
        import pybullet as p

        self._ensure_loaded()
        kept = (one for one in self._changes if one is not without_shapes)
        changes = (*kept, without_visuals, simple_shapes)
        try:
            body = self._load_file(changes, p.URDF_USE_IMPLICIT_CYLINDER)
        except EngineError:
            return {}  # whole steps name the reason
        shapes = link_shapes(body, self._declared[1].document.root)
        p.removeBody(body)
        return shapes

    @property
    def shapes(self) -> Mapping[str, tuple[float, ...]]:
        """Collision shapes with their half sizes."""
        return {name: shape.size for name, shape in self._shapes.items()}

    def poses(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """Return poses by PyBullet's forward kinematics, without a step."""
        shapes = [self._shapes[one] if one.startswith("collision:") else None for one in places]
        links = [one.link if one else place for one, place in zip(shapes, places, strict=True)]
        self._ensure_loaded()
        origins, turns = self.stepper.poses(links, z)
        for i, shape in enumerate(shapes):
            if shape is not None:
                origins[:, i] += turns[:, i] @ shape.frame.origin
                turns[:, i] = turns[:, i] @ shape.frame.rotation
        return origins, turns

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """Return order 1 for every input."""
        return 1, 1

    @property
    def step_rule(self) -> StepRule | None:
        """The rule: all forces at the step's start, including dampers.

        A floating base steps about its centre of mass, and a ball joint's quaternion by an
        exponential: neither has a rule.
        """
        return None if self._turning else StepRule(scheme="semi-implicit Euler")

    @property
    def home(self) -> Array:
        """Positions of the drawn configuration, (nz,)."""
        return np.zeros(len(self.coordinates))

    @property
    def sampling_range(self) -> Array:
        """Sampling range of positions, (nz, 2): limits, one turn of a hinge, 1 m of a slide."""
        import pybullet as p

        info = [p.getJointInfo(self._body, joint) for joint in self._joints]
        half = np.array(
            [1.0] * self._free + [np.pi if one[2] == p.JOINT_REVOLUTE else 1.0 for one in info]
        )
        return clip_ranges(np.stack([-half, half], axis=1), self.limits)

    @property
    def limits(self) -> Array:
        """Joint limits, (nz, 2); for joints without them PyBullet's lower is above its upper."""
        import pybullet as p

        info = [p.getJointInfo(self._body, joint) for joint in self._joints]
        free = [(-np.inf, np.inf)] * self._free
        bounds = [one[8:10] if one[8] < one[9] else (-np.inf, np.inf) for one in info]
        return np.array([*free, *bounds])

    def _moving_joints(self) -> tuple[list[int], list[str], list[Ball]]:
        import pybullet as p

        joints, names, balls = [], [], []
        for index in range(p.getNumJoints(self._body)):
            info = p.getJointInfo(self._body, index)
            name = info[1].decode()
            if info[2] == p.JOINT_FIXED:
                continue
            if info[2] == p.JOINT_SPHERICAL:
                balls.append(Ball(self._body, index, name))
                continue
            if info[2] not in (p.JOINT_REVOLUTE, p.JOINT_PRISMATIC):
                raise EngineError(
                    f"{self.path}: joint {name!r} is not a slide, hinge or ball; "
                    "only these are supported"
                )
            joints.append(index)
            names.append(name)
        if not joints and not balls and not self._setting("floating"):
            raise EngineError(f"{self.path}: it has no moving joint")
        return joints, names, balls

    @property
    def _free(self) -> int:
        return len(self.coordinates) - len(self._joints)

    def _disable_effects(self) -> None:
        """Disable PyBullet's damping, motors and speed limit, unless the settings keep them."""
        import pybullet as p

        for link in range(-1, p.getNumJoints(self._body)):
            # By default each link has 0.04 of linear and of angular damping, linear and quadratic
            # in speed.
            damping = self._setting("link_damping")
            p.changeDynamics(self._body, link, linearDamping=damping, angularDamping=damping)
            if self._setting("smooth"):
                p.setCollisionFilterGroupMask(self._body, link, 0, 0)
        for joint in range(p.getNumJoints(self._body)):
            p.changeDynamics(self._body, joint, maxJointVelocity=1e300)  # 100 by default
        if self._setting("motors"):
            return
        for part in self._turning:
            if isinstance(part, Ball):
                part.disable_motor()
        if not self._joints:
            return
        # TORQUE_CONTROL with zero torque does not disable the default motors.
        p.setJointMotorControlArray(
            self._body, self._joints, p.VELOCITY_CONTROL, forces=[0.0] * len(self._joints)
        )

    def _resolve(self, spring: Spring) -> tuple[list[tuple[int, float]], float, float, float]:
        for joint in spring.joints:
            if joint not in self._joint_names:
                raise EngineError(
                    f"{self.path}: a spring names {joint!r}, which is not a moving joint"
                )
        coefficients = [(self._joint_names.index(j), float(c)) for j, c in spring.joints.items()]
        return coefficients, spring.stiffness, spring.damping, spring.rest

    def _gear(self, mimic: Mimic) -> int:
        import pybullet as p

        for joint in (mimic.leader, mimic.joint):
            if joint not in self._joint_names:
                raise EngineError(
                    f"{self.path}: <mimic> names {joint!r}, which is not a moving joint"
                )
        if not mimic.multiplier:
            raise EngineError(
                f"{self.path}: <mimic> of {mimic.joint!r} has the multiplier 0, "
                "which JOINT_GEAR does not support; make the joint fixed"
            )
        if mimic.offset:
            raise EngineError(f"{self.path}: <mimic> with an offset is not supported by JOINT_GEAR")
        leader, follower = (
            self._joints[self._joint_names.index(j)] for j in (mimic.leader, mimic.joint)
        )
        gear = p.createConstraint(
            self._body,
            leader,
            self._body,
            follower,
            p.JOINT_GEAR,
            [0, 1, 0],
            [0, 0, 0],
            [0, 0, 0],
        )
        # The gear enforces v(leader) + gearRatio * v(follower) = 0, in the order (leader,
        # follower).
        p.changeConstraint(gear, gearRatio=-1.0 / mimic.multiplier, maxForce=1e10, erp=0.0)
        return int(gear)

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """Step through a rollout; springs and inputs are torques, set from the state before each
        step.
        """
        self._ensure_loaded()
        with engine_errors(self.path, "PyBullet"):
            return self._rollout(q, v, h, n, force, every)

    def _rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        import pybullet as p

        p.setPhysicsEngineParameter(fixedTimeStep=h)
        out_q = np.empty((len(q), n // every, q.shape[1]))
        out_v = np.empty_like(out_q)
        for b in range(len(q)):
            if self._floor is not None:
                forget_contacts(self._floor, speed=self._setting("floor_speed"))
            self.stepper.reset(q[b], v[b])
            self.stepper.run(b, n, force, every, out_q[b], out_v[b])
            if not np.isfinite(out_q[b, -1]).all():
                # A NaN stays in a gear through every reset of the joints.
                self._load()
                p.setPhysicsEngineParameter(fixedTimeStep=h)
        return out_q, out_v

    def loaded_stepper(self, *, reload: bool = False) -> BodyStepper:
        """Return the body, loaded again if another model has been loaded since, or to `reload`."""
        if reload:
            self._load()
        self._ensure_loaded()
        return self.stepper

    def _ensure_loaded(self) -> None:
        if _loaded is not self:
            self._load()
