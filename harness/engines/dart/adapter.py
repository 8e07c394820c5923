"""DART, on URDF and SDFormat: `World.step`, semi-implicit Euler.

DART evaluates joint dampers at the end of the step. Shapes are left out: by default DART does not
collide bodies of one skeleton. It reads joint limits but enforces them only after
`setLimitEnforcement`.

A DART skeleton in a world, with the harness's coordinates.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.sdf.read import read_sdf
from physics_crosscheck.reference.mechanism.rotations import (
    exponential,
    from_quaternion,
    minimal_coordinates,
    quaternion_product,
    unit_quaternion,
)
from ..installed import STDERR, STDOUT, capture_output
from ..protocol import Array, EngineError, Force, LoadedModel, ModelSpec, Sample, StepRule
from ..remark import Remark
from ..runge_kutta import BALL, FREE, JointLayout, each_alone
from ..sdf import SDF_NON_PHYSICAL, sample_sdf
from ..sdf_sidecar import DeclaredSdf, sdf_without_bounds, sdf_without_friction
from ..source import load_failure, one_line, shortened
from ..tree_model import SpringForces, Stepper
from ..urdf import URDF_NON_PHYSICAL, UrdfReader, sample_urdf
from ..urdf_copy import (
    BARE,
    TRIMMED,
    Change,
    bare_cause,
    bare_links,
    dropped_cause,
    refuse_blanks,
    trim_numbers,
    without_friction,
    without_shapes,
    zero_missing_inertials,
)
from ..urdf_engine import SDF, UrdfEngine, UrdfModel
from ..urdf_sidecar import ROBOTS, Declarations
from .sdf import (
    as_older,
    automatic_cause,
    automatic_links,
    ball_dampers,
    misread_screws,
    momentless_cause,
    momentless_links,
    refuse_newer,
    screw_cause,
    sdf_skeleton,
    turned_cause,
    turned_links,
    undamped_cause,
    with_automatic,
    with_moments,
    with_pitches,
    with_turned,
    without_collisions,
)
from .whole import WHOLE_SETTINGS, DartWhole

TYPES = ("BallJoint", "FreeJoint", "UniversalJoint")
"""DART's types of joints with several degrees of freedom that are covered."""

INSTANT = 1e-200
"""Seconds."""


class WorldSteps(Stepper):
    """A skeleton in a world.

    DART's coordinates of a free root are its rotation vector and its position. Velocities are
    angular and linear, along the world's axes, and so are forces. A ball joint has the rotation
    vector of its frame on the child in that on the parent, and angular velocities along the
    axes of the former.

    Args:
        world, body: DART's own objects.
        layout: of the joints.
        springs: along slides and hinges.
        exact: whether the adapter rotates joints to full precision; DART drops the cubic term of
            rotations below 1e-3 rad per step.
    """

    def __init__(
        self, world: Any, body: Any, layout: JointLayout, springs: SpringForces, exact: bool = False
    ) -> None:
        self._world, self._body, self.layout, self._springs = world, body, layout, springs
        self._turned = exact and bool(layout.turns)
        self._near = np.array([[1.0, 0.0, 0.0, 0.0]] * len(layout.turns))
        moving = [body.getJoint(i) for i in range(body.getNumJoints())]
        turning = [joint for joint in moving if joint.getNumDofs() >= BALL]
        self._inward = [
            np.eye(3)
            if joint.getNumDofs() == FREE
            else joint.getTransformFromChildBodyNode().rotation()
            for joint in turning
        ]
        self._vectors = [slice(one.start, one.start + 3) for one, _ in layout.origins]

    def reset(self, q: Array, v: Array) -> None:
        """Set a state, and discard constraint impulses of earlier motions."""
        x, m = self.layout.to_state(q, v)
        for k, (_, there) in enumerate(self.layout.turns):
            self._near[k] = x[there]
        self._set_dart_state(self._positions(x), self._along(m, x, back=False))

    def _positions(self, x: Array) -> Array:
        """Return DART's positions."""
        q = np.empty(len(x) - len(self.layout.turns))
        q[self.layout.singles] = x[self.layout.singles_x]
        rows = zip(self.layout.turns, self.layout.origins, self._inward, self._vectors, strict=True)
        for (_, there), (place, place_x), inward, vector in rows:
            q[vector] = inward.T @ _rotation_vector(x[there])
            q[vector.stop :][: place.stop - place.start] = x[place_x]
        return q

    def _set_dart_state(self, q: Array, v: Array) -> None:
        self._body.resetCommands()
        self._body.clearConstraintImpulses()
        self._body.resetAccelerations()
        self._body.setPositions(q)
        self._body.setVelocities(v)

    def position(self) -> Array:
        """Return the position, with rotation coordinates nearer to the last ones."""
        q: Array = self._body.getPositions()
        if not self.layout.turns:
            return q
        z = q.copy()
        rows = zip(self.layout.turns, self.layout.origins, self._inward, self._vectors, strict=True)
        for k, ((here, _), (place, _), inward, vector) in enumerate(rows):
            z[place] = q[vector.stop :][: place.stop - place.start]
            z[here] = minimal_coordinates(exponential(inward @ q[vector]), self._near[k])
            self._near[k] = unit_quaternion(z[here])
        return z

    def state(self) -> tuple[Array, Array]:
        """Return positions and velocities."""
        z = self.position()
        return z, self.layout.rates(z, self.velocities(z))

    def velocities(self, z: Array) -> Array:
        """Return velocities in `RungeKutta`'s convention, at coordinates z."""
        return self._along(self._body.getVelocities(), self.layout.to_state(z, z)[0], back=True)

    def _along(self, values: Array, x: Array, *, back: bool) -> Array:
        """Return velocities or forces along DART's axes, or back in `RungeKutta`'s convention."""
        out = values.copy() if self.layout.turns else values
        rows = zip(self.layout.turns, self.layout.origins, self._inward, self._vectors, strict=True)
        for (here, there), (place, _), inward, vector in rows:
            free = place.stop > place.start
            axes = from_quaternion(x[there]) if free else inward.T
            linear = slice(vector.stop, vector.stop + place.stop - place.start)
            if back:
                out[place], out[here] = values[linear], axes.T @ values[vector]
            else:
                out[vector], out[linear] = axes @ values[here], values[place]
        return out

    def step(self, h: float, force: Array | None) -> None:
        """Step the world, whose step is h."""
        if force is not None or not self._springs.empty:
            self._body.setForces(self._pushes(force))
        before = self._body.getPositions() if self._turned else np.zeros(0)
        self._world.step()
        if self._turned:
            q, v = self._body.getPositions(), self._body.getVelocities()
            for vector, (place, _) in zip(self._vectors, self.layout.origins, strict=True):
                pair = exponential(h * v[vector]), exponential(before[vector])
                # A free root turns about the world's axes, a ball about its own.
                after = quaternion_product(*(pair if place.stop > place.start else pair[::-1]))
                q[vector] = _rotation_vector(after if after[0] >= 0 else -after)
            self._body.setPositions(q)

    def coast(self, h: float, n: int) -> None:
        """Step the world alone if no spring acts."""
        if self._turned or not self._springs.empty:
            super().coast(h, n)
            return
        step = self._world.step
        for _ in range(n):
            step()

    def accelerations(self, x: Array, m: Array, f: Array) -> Array:
        """Return accelerations of positions, velocities and forces in `RungeKutta`'s convention."""
        self._set_dart_state(self._positions(x), self._along(m, x, back=False))
        self._body.setForces(self._pushes(f))
        # DART evaluates dampers at the end of a step, so the step is made negligibly short.
        step = self._body.getTimeStep()
        self._body.setTimeStep(INSTANT)
        self._body.computeForwardDynamics()
        self._body.setTimeStep(step)
        return self._along(self._body.getAccelerations(), x, back=True)

    def _pushes(self, force: Array | None) -> Array:
        q, v, rows = self._body.getPositions(), self._body.getVelocities(), self.layout.singles
        pushes = np.zeros(len(v))
        if force is not None:
            x = self.layout.to_state(self.position(), v)[0] if self.layout.turns else q
            pushes = self._along(force, x, back=False).copy()
        if not self._springs.empty:
            pushes[rows] += self._springs.forces(q[rows], v[rows])
        return pushes


def _rotation_vector(turn: Array) -> Array:
    size = np.linalg.norm(turn[1:])
    angle = 2 * np.arctan2(size, turn[0])
    return turn[1:] * (angle / size if size else 2.0)


TURNS = "DART's dropping of the cubic term of free turns below 1e-3 rad per step"

SERVO = "<mimic> of {} is a servo in DART, of which its leader feels nothing"

OPENED = "DART leaves out joint {}, which closes a loop"

REACTION = "DART's servo for <mimic> without a reaction on the leader"

DEFAULTS: Mapping[str, bool] = MappingProxyType({
    **ROBOTS,
    # Whether a link without an inertial has 1 kg and 1 kg m^2 (DART's default), or no mass.
    "bare_links": True,
    # Whether blanks after numbers of a URDF are removed; DART drops an <inertial> that contains
    # one.
    "trimmed_numbers": False,
    # Whether <mimic> is a constraint on both joints (CouplerConstraint), or DART's own servo.
    "couplers": False,
    # Whether the adapter rotates a floating root and ball joints; DART itself drops the cubic term
    # of small rotations.
    "exact_turns": False,
    # Whether a rotated SDFormat inertial is rewritten along the link's axes; DART itself ignores
    # the rotation of its moments.
    "turned_inertials": False,
    # Whether an SDFormat inertial with auto="true" is computed for DART from the link's shapes;
    # DART itself uses the stated mass and moments, or 1 kg and 1 kg m^2.
    "automatic_inertials": False,
    # Whether an SDFormat link with a mass and no <inertia> has the format's 1 kg m^2; DART itself
    # uses its mass times 1 m^2.
    "default_moments": False,
    # Whether the damping of an SDFormat ball joint acts; DART itself ignores it.
    "ball_damping": False,
    # Whether the pitch of an SDFormat screw is written as DART reads it; DART itself takes
    # <thread_pitch> as m per turn, or 0.1.
    "screw_pitches": False,
})  # fmt: skip

READER = UrdfReader(name="dart", no_inertial="a mass of 1 kg", no_stops="DART")
SDF_READER = UrdfReader(name="dart", no_inertial="a mass of 1 kg")

_COLOUR = re.compile(r"\x1b\[[\d;]*m")


class DartEngine(UrdfEngine):
    """Adapter of DART (Lee et al. 2018)."""

    name = "dart"
    title = "DART"
    package, distribution, extra = "dartpy", "dartpy", "dart"
    formats = takes_springs = (".urdf", ".sdf")
    non_physical = MappingProxyType({**URDF_NON_PHYSICAL, **SDF_NON_PHYSICAL})
    defaults = DEFAULTS
    capabilities = (
        "joints: slide, hinge, ball (SDFormat), floating root",
        "springs: added by the adapter; SDFormat springs by DART",
        "mimic: one-way servo",
        "next state: with a fixed base",
        "accelerations: yes, without mimic and friction",
        "linearization: from steps",
        "steps: semi-implicit Euler, order 1",
        "whole step: dry friction of URDF, by its law",
    )
    default_settings_note = "1 ms and -9.81 m/s^2"
    massless_link_default = "1 kg"

    def loaded(self, spec: ModelSpec) -> LoadedModel:
        """Load a file whose settings are valid."""
        return DartModel(spec)

    def file_remarks(self, path: Path) -> Iterator[Remark]:
        """Yield joints of SDFormat that close loops: DART keeps the first joint of each link."""
        file = read_sdf(Document(path)) if path.suffix == SDF else None
        for joint in () if file is None else file.closing:
            message, address = OPENED.format(joint.name), f"sdf/model/joint[{joint.name}]"
            yield Remark(kind="ignored", message=message, fault=True, address=address)

    def samples(self) -> tuple[Sample, ...]:
        """Return one sample of each format."""
        return sample_urdf(), sample_sdf()

    def load_whole(self, spec: ModelSpec) -> DartWhole | None:
        """Load a URDF with the dry friction of its joints; None without any."""
        if spec.path.suffix != ".urdf":
            return None
        model = self.load(replace(spec, settings={**spec.settings, **WHOLE_SETTINGS}))
        assert isinstance(model, DartModel)
        robot = model.declared.robot
        if not any(joint.friction for joint in model.declared.file.joints.values()):
            return None
        return DartWhole(model, model.stepper, tuple(_without_law(robot)))


def _without_law(robot: XmlElement) -> Iterator[str]:
    if robot.findall("link/collision"):
        yield "contacts"
    if robot.findall("joint/mimic"):
        yield "couplings"


class DartModel(UrdfModel):
    """A tree of slides, hinges and balls, fixed or floating, stepped by its DART world."""

    integrator = "semi-implicit euler"

    def __init__(self, spec: ModelSpec) -> None:
        import dartpy as dart

        reader = SDF_READER if spec.path.suffix == SDF else READER
        super().__init__(spec, "DART", reader, DEFAULTS, _changes(spec))
        self._sdf = spec.path.suffix == SDF
        if isinstance(self.declared, DeclaredSdf):
            refuse_newer(self.declared.file)
        elif not self.settings["trimmed_numbers"]:
            refuse_blanks(self.declared.file.document, "DART")
        self._corrective_settings = _corrective_settings(self.declared, self.settings)
        self._body = self._skeleton()
        self._world = dart.simulation.World()
        self._world.setTimeStep(self.step)
        self._world.setGravity(list(self.gravity))
        self._world.addSkeleton(self._body)
        moving = [self._body.getJoint(i) for i in range(self._body.getNumJoints())]
        joints = [joint for joint in moving if joint.getNumDofs()]
        for joint in joints:
            if joint.getNumDofs() != 1 and joint.getType() not in TYPES:
                raise EngineError(
                    f"{spec.path}: joint {joint.getName()!r} is neither a slide nor a hinge"
                )
            mimic = joint.getActuatorType() == dart.dynamics.ActuatorType.MIMIC
            if mimic and self.settings["couplers"]:
                joint.setUseCouplerConstraint(True)
        sizes = [joint.getNumDofs() for joint in joints]
        named = [joint.getName() for joint in joints]
        if self.floats:
            named[0] = self.root
        springs = self.name(named, sizes=sizes)
        each = [(joint, i) for joint in joints for i in range(joint.getNumDofs())]
        self._stiffness = np.diag([joint.getSpringStiffness(i) for joint, i in each])
        self._damping = np.diag([joint.getDampingCoefficient(i) for joint, i in each])
        exact = bool(self.settings["exact_turns"])
        self._steps = WorldSteps(self._world, self._body, self.layout, springs, exact)
        self.stepper = self._steps
        if self.layout.turns and not exact:
            self.lost_turn = 1e-3
            self._corrective_settings[TURNS] = {"exact_turns": True}
        if self.declared.mimics and not self.settings["couplers"]:
            names = shortened([one.joint for one in self.declared.mimics])
            self._corrective_settings[f"{REACTION} ({names})"] = {"couplers": True}
        slides = any(joint.getCoulombFriction(0) for joint in joints)
        if not (self.declared.mimics or slides):
            self.forward = each_alone(self._steps.accelerations)

    def _skeleton(self) -> Any:
        load = sdf_skeleton if self._sdf else _urdf_skeleton
        with capture_output((STDOUT, STDERR), again=False) as printed:
            skeleton = load(self.declared.text, self.path, self.floats)
        message = _COLOUR.sub("", one_line(" ".join(printed)))
        if skeleton is None:
            raise load_failure("DART", self.path, message)
        self._printed = (message,) if message else ()
        balls = ball_dampers(self.declared.robot) if self.settings["ball_damping"] else {}
        for name, damping in balls.items():
            for i in range(BALL):
                skeleton.getJoint(name).setDampingCoefficient(i, damping)
        return skeleton

    def turning_rates(self, z: Array, w: Array) -> Array:
        """Return the fastest rates of free rotation, (K,), rad/s."""
        m = self.layout.to_state(z, w)[1]
        spins = [np.linalg.norm(m[:, here], axis=1) for here, _ in self.layout.turns]
        rates: Array = np.max([np.zeros(len(z)), *spins], axis=0)
        return rates

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """Return order 1 for every input."""
        return 1, 1

    @property
    def step_rule(self) -> StepRule | None:
        """DART's rule: springs and dampers at the step's end (GenericJoint.hpp,
        updateTotalForceDynamic).

        There is no rule for a free rotation, for which DART uses an exponential.
        """
        if self.layout.turns:
            return None
        held = "couplings, which a servo or a constraint holds" if self.declared.mimics else ""
        damping, stiffness = (m if m.any() else None for m in (self._damping, self._stiffness))
        return StepRule(
            scheme="semi-implicit Euler", damping=damping, stiffness=stiffness, besides=held
        )

    @property
    def limits(self) -> Array:
        """Limits of joints that DART enforces, (nz, 2): its SDFormat parser enables them."""
        stopped = self._sdf and not self.settings["smooth"]
        return self.stated_limits if stopped else super().limits

    @property
    def corrective_settings(self) -> dict[str, Mapping[str, object]]:
        """DART's own assumptions that the settings leave active, with the settings that correct
        them.
        """
        return self._corrective_settings

    @property
    def precision_limits(self) -> dict[str, Mapping[str, object]]:
        """The dropped term of free turns."""
        lost = "the cubic term of free turns below 1e-3 rad per step"
        return {lost: {"exact_turns": True}} if self.lost_turn else {}

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """Yield ignored parts of the file, and mimic joints that are servos."""
        yield from super().remarks(z, w)
        for mimic in () if self.settings["couplers"] else self.declared.mimics:
            message, address = SERVO.format(mimic.joint), f"robot/joint[{mimic.joint}]"
            yield Remark(kind="constraint", message=message, fault=True, address=address)

    @property
    def warnings(self) -> tuple[str, ...]:
        """The text that DART printed while it loaded the file."""
        return self._printed

    @property
    def places(self) -> tuple[str, ...]:
        """Links and their centres of mass."""
        names = [self._body.getBodyNode(i).getName() for i in range(self._body.getNumBodyNodes())]
        return tuple(f"{kind}:{name}" for kind in ("link", "centre") for name in names)

    def poses(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """Return poses by DART's forward kinematics."""
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
        """Step through a rollout, without the text that DART prints about diverging motions."""
        self._world.setTimeStep(h)
        with capture_output((STDOUT, STDERR), again=False):
            return super().rollout(q, v, h, n, force, every)


def _changes(spec: ModelSpec) -> list[Change]:
    """Return the changes to a file before DART reads it, besides those that settings make for all
    engines.
    """
    smooth = bool(spec.settings.get("smooth", False))
    if spec.path.suffix == SDF:
        changes: list[Change] = [as_older]
        changes += [sdf_without_friction, sdf_without_bounds] if smooth else []
        wanted = (how for key, how in _REWRITTEN.items() if spec.settings.get(key, False))
        return [*changes, *wanted, without_collisions]
    further: list[Change] = [without_shapes]
    further += [without_friction] if smooth else []
    further += [trim_numbers] if spec.settings.get("trimmed_numbers", False) else []
    return further + ([] if spec.settings.get("bare_links", True) else [zero_missing_inertials])


_REWRITTEN: Mapping[str, Change] = MappingProxyType({
    "automatic_inertials": with_automatic,
    "default_moments": with_moments,
    "turned_inertials": with_turned,
    "screw_pitches": with_pitches,
})  # fmt: skip
"""Settings that rewrite numbers of an SDFormat file for DART as the format defines them."""


def _corrective_settings(
    declared: Declarations, settings: Mapping[str, object]
) -> dict[str, Mapping[str, object]]:
    """Return DART's own assumptions about a file, with the settings that correct them."""
    if isinstance(declared, DeclaredSdf):
        checks = {
            "turned_inertials": (turned_links, turned_cause),
            "automatic_inertials": (automatic_links, automatic_cause),
            "default_moments": (momentless_links, momentless_cause),
            "ball_damping": (lambda model: list(ball_dampers(model)), undamped_cause),
            "screw_pitches": (
                lambda model: [one.get("name") for one in misread_screws(model)],
                screw_cause,
            ),
        }
        return {
            cause(names): {key: True}
            for key, (links, cause) in checks.items()
            if not settings[key] and (names := links(declared.robot))
        }
    floats = bool(settings["floating"])
    bare = bare_links(declared.robot, floats=floats) if settings["bare_links"] else []
    lost = "" if settings["trimmed_numbers"] else dropped_cause(declared.file.document, "DART")
    causes = {bare_cause(bare, "DART's own 1 kg and 1 kg m^2"): BARE} if bare else {}
    return {**causes, **({lost: TRIMMED} if lost else {})}


def _urdf_skeleton(text: str, path: Path, floats: bool) -> Any:
    import dartpy as dart

    roots = dart.utils.DartLoaderRootJointType
    options, loader = dart.utils.DartLoaderOptions(), dart.utils.DartLoader()
    options.mDefaultRootJointType = roots.FLOATING if floats else roots.FIXED
    loader.setOptions(options)
    return loader.parseSkeletonString(text, dart.common.Uri(path.resolve().as_uri()))
