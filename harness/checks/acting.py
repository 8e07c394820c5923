"""Quantities that the numbers of a file act as in an engine, without a motion."""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import TypeVar

import numpy as np
import sympy as sp
from msgspec.structs import replace

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.urdf import read_urdf
from physics_crosscheck.harness.engines.compiled import CompiledShape, CompiledTree
from physics_crosscheck.harness.engines.protocol import (
    LoadedModel,
    ModelSpec,
    PlanarWhole,
    WholeModel,
)
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.mjcf.read import NO_TURN, law_model
from physics_crosscheck.harness.modelfiles.readers import read_as_it_runs
from physics_crosscheck.harness.modelfiles.urdf.laws import ruled_model
from physics_crosscheck.harness.records.base import number
from physics_crosscheck.harness.records.comparison import ComparedActing
from physics_crosscheck.harness.records.survey import ActingQuantity
from physics_crosscheck.harness.results.status import listed
from physics_crosscheck.reference.laws.acting import SLOPE, Servo, pressed, recovery_time, rest_on
from physics_crosscheck.reference.laws.constraints import mix_surfaces
from physics_crosscheck.reference.laws.impulses import ImpulseModel
from physics_crosscheck.reference.laws.mechanics import Posture
from physics_crosscheck.reference.laws.near_rigid import NearRigidModel, mix_compliant
from physics_crosscheck.reference.laws.planar import LIMITS, SPRINGS, PlanarModel
from physics_crosscheck.reference.laws.step import LawModel
from physics_crosscheck.reference.mechanism.interactions import Drive
from physics_crosscheck.reference.mechanism.laws import (
    Actuator,
    ContactParameters,
    HardSurface,
    ImpulseRules,
    SoftLimit,
    SoftRules,
    Surface,
)
from physics_crosscheck.reference.mechanism.planar import PlanarJoint
from physics_crosscheck.reference.mechanism.rotations import Place, from_quaternion
from physics_crosscheck.reference.mechanism.system import System
from physics_crosscheck.reference.mechanism.tree import TreeError
from .law_comparison import LawComparison
from .law_states import KeptSteps

NAMED = 3
"""Largest number of subjects that a line names."""

LARGEST = "largest force"
"""Quantity whose rule states what is clamped, and where."""

FORCE_UNITS = {"hinge": "N m", "slide": "N"}

WHOLE = "the whole weight on one contact"

LEVEL = 0.02
"""Share of a drawn robot's height within which its lowest points stand on a level floor."""

DRAG = "default damping"
"""Damping of links that an engine adds by itself, relative to their inertia."""

DRIVE_CLAMPED = "the drive is clamped, before forces add up"

DIAGONAL = float(np.sqrt(0.5))
"""Friction of a pyramid between its edges, relative to that along them."""


def acting_quantities(
    compiled: CompiledTree, *, apart: bool = False, by_shape: bool = False
) -> tuple[ActingQuantity, ...]:
    """Return what the numbers of a compiled file act as; nothing for bodies without laws.

    Args:
        compiled: the file.
        apart: whether each joint and body has its rows.
        by_shape: whether each shape has its rows too, in place of each body.
    """
    try:
        model = law_model(compiled)
    except TreeError:
        model = None
    if model is None:
        return ()
    bodies = ("", *(body.name for body in compiled.bodies))
    shapes = tuple(one.name.partition(":")[2] for one in compiled.placed)
    named = shapes if by_shape or not apart else ()
    acting = Acting(model=model, bodies=bodies, shapes=named, apart=apart, placed=compiled.placed)
    return tuple(acting.quantities())


def urdf_quantities(
    spec: ModelSpec, engine: str, steps: KeptSteps | None = None
) -> tuple[ActingQuantity, ...]:
    """Return what the numbers of a URDF act as in an engine, by its settings and its law.

    Each joint and body has its rows. Engines without such a law have no rows. `steps` keeps the
    model for other checks.

    Raises:
        EngineError: if the file cannot be loaded.
    """
    model = (steps or KeptSteps()).model(engine, spec)
    if model is None or model.rules is None:
        return ()
    try:
        robot = read_as_it_runs(spec.path, {**spec.settings, "couplings": False})
        laws = ruled_model(robot, model.rules)
        if laws is None:
            return ()
        if isinstance(laws, NearRigidModel):
            return tuple(_of_near_rigid(laws))
        if isinstance(laws, LawModel):
            assert isinstance(model.rules, SoftRules)
            acting = Acting(model=laws, bodies=model.rules.bodies, apart=True)
            return tuple(acting.quantities())
        # A fixed root meets the floor of a setting only.
        floor = laws.laws.root is not None or bool(spec.settings.get("floor"))
        links = read_urdf(Document(robot.file)).links.items() if floor else ()
        grounded = frozenset(name for name, one in links if one.element.find("collision"))
        return tuple(_of_impulses(laws, model, grounded))
    except TreeError:
        return ()


def planar_quantities(
    spec: ModelSpec, engine: str, model: LoadedModel | None = None
) -> tuple[ActingQuantity, ...]:
    """Return what the numbers of bodies in a plane act as; nothing in engines without their law.

    Args:
        spec: the file.
        engine: name of the engine.
        model: the file, if it is loaded.

    Raises:
        EngineError: if the file cannot be loaded.
    """
    whole = engines()[engine].load_planar(spec, model)
    if whole is None or not whole.acts:
        return ()
    return tuple(merged(dict.fromkeys(_of_plane(whole))))


def declared_quantities(system: System) -> Iterator[ActingQuantity]:
    """Yield friction and restitution of the contacts, limits and dry friction of a system."""
    fields = (("mu", "friction", ""), ("e", "restitution", ""), ("force", "friction", "N"))
    for part in system.interactions:
        for field, quantity, unit in () if isinstance(part, Drive) else fields:
            value = sp.sympify(getattr(part, field, None))
            if value is not None and (value := value.subs(system.values)).is_number:
                row = _quantity(part.name, quantity, float(value), unit, "declared, rigid")
                yield replace(row, declared=True)


@dataclass(frozen=True, kw_only=True, eq=False)
class Acting:
    """The laws of a file, in its drawn configuration at rest.

    Attributes:
        bodies, shapes: names by index; the ground is the first body.
        apart: whether each joint has its rows, and each shape, or each body without shapes.
        placed: the shapes, by index; empty if their places are unknown.
    """

    model: LawModel
    bodies: Sequence[str]
    shapes: Sequence[str] = ()
    apart: bool = False
    placed: Sequence[CompiledShape] = ()

    def quantities(self) -> Iterator[ActingQuantity]:
        """Yield all quantities: contacts with the ground, joint limits, drives."""
        yield from self._contacts()
        yield from self._limits()
        for drive in self.model.laws.drives:
            yield from self._drive(drive)

    @cached_property
    def _posture(self) -> Posture:
        home = self.model.home
        return next(self.model.tree.postures(home[None], np.zeros((1, len(home)))))

    @property
    def _weight(self) -> float:
        """The weight of all bodies that move, N."""
        tree = self.model.tree
        rows = zip(tree.masses, tree.bodies, strict=True)
        mass = sum(float(mass) for mass, (link, _) in rows if link >= 0)
        return mass * float(np.linalg.norm(tree.tree.gravity))

    @cached_property
    def _lowest(self) -> Counter[int]:
        """Count the lowest points of moving shapes as drawn, by index; nothing for meshes."""
        laws, heights = self.model.laws, list[tuple[int, float]]()
        up = -np.array(self.model.tree.tree.gravity)
        for j, (surface, shape) in enumerate(zip(laws.surfaces, self.placed, strict=False)):
            link, inner = self.model.tree.bodies[surface.body]
            if link < 0 or shape.visual:
                continue
            if shape.kind not in ("box", "sphere", "capsule"):
                return Counter()
            pose, site = self._posture.poses[link], shape.frame
            turn = from_quaternion(np.array(site.quaternion or NO_TURN))
            frame = Place(pose.rotation, pose.origin).compose(inner)
            frame = frame.compose(Place(turn, np.array(site.position)))
            radius, half = (0.0, shape.size) if shape.kind == "box" else (
                shape.size[0], (0.0, 0.0, sum(shape.size[1:2])))  # fmt: skip
            for corner in product(*((-x, x) if x else (0.0,) for x in half)):
                point = frame.transform(np.array(corner))
                heights.append((j, float(up @ point) - radius * float(np.linalg.norm(up))))
        low, high = (pick((h for _, h in heights), default=0.0) for pick in (min, max))
        return Counter(j for j, h in heights if h <= low + LEVEL * (high - low))

    def _contacts(self) -> Iterator[ActingQuantity]:
        """Yield quantities of contacts between shapes that stand still and others."""
        alike: dict[tuple[ContactParameters, str], list[tuple[int, int]]] = {}
        for pair, parameters, rule in self._pairs():
            alike.setdefault((parameters, rule), []).append(pair)  # the rule states both numbers
        if self.apart:
            for (parameters, rule), pairs in alike.items():
                bodies = dict.fromkeys(self.model.laws.surfaces[j].body for _, j in pairs)
                if self.shapes:
                    for i, j in pairs:
                        subject = f"{self.shapes[i]} with {self.shapes[j]}"
                        yield from self._contact(subject, parameters, rule, [(i, j)])
                    continue
                for body in bodies:
                    rest = [
                        pair for pair in pairs if self.model.laws.surfaces[pair[1]].body == body
                    ]
                    subject = f"ground with {self.bodies[body]}"
                    yield from self._contact(subject, parameters, rule, rest)
            return
        for (parameters, rule), pairs in alike.items():
            # Feet first: shapes of the last links.
            pairs.sort(key=lambda pair: self._carries(self.model.laws.surfaces[pair[1]]))
            touched = _listed(self.shapes[j] for _, j in pairs)
            subject = f"{self.shapes[pairs[0][0]]} with {touched}"
            yield from self._contact(subject, parameters, rule, pairs)

    def _pairs(self) -> Iterator[tuple[tuple[int, int], ContactParameters, str]]:
        """Yield a still and a moving surface, the numbers of their contact, and their rule."""
        laws = self.model.laws
        stated = {frozenset(pair): parameters for *pair, parameters in laws.pairs}
        surfaces = list(enumerate(laws.surfaces))
        for i, first in surfaces:
            for j, other in surfaces:
                if self._moves(first) or not self._moves(other):
                    continue
                if (parameters := stated.get(frozenset((i, j)))) is not None:
                    yield (i, j), parameters, "stated for the pair"
                elif first.touches(other):
                    yield (i, j), mix_surfaces(first, other), _rule(first, other)

    def _carries(self, surface: Surface) -> bool:
        link = self.model.tree.bodies[surface.body][0]
        return any(one.parent == link for one in self.model.tree.tree.links)

    def _is_loose(self, body: int) -> bool:
        """Return whether a body rests on the ground, since nothing but slides holds its root."""
        link, links = self.model.tree.bodies[body][0], self.model.tree.tree.links
        while links[link].parent >= 0:
            link = links[link].parent
        return links[link].kind in ("free", "slide")

    def _moves(self, surface: Surface) -> bool:
        return self.model.tree.bodies[surface.body][0] >= 0

    def _contact(
        self, subject: str, contact: ContactParameters, rule: str, pairs: list[tuple[int, int]]
    ) -> Iterator[ActingQuantity]:
        laws = self.model.laws
        if contact.dimension > 1:
            friction = contact.friction[0]
            parts = tuple(laws.surfaces[i].friction[0] for i in pairs[0])
            yield replace(_quantity(subject, "friction", friction, rule=rule), parts=parts)
            if not laws.elliptic:
                note = "between the edges of its pyramid"
                yield _quantity(subject, "friction at 45 degrees", friction * DIAGONAL, rule=note)
        motion = pressed(contact.softness, laws)
        yield _quantity(subject, "restitution", motion.rebound, rule="of solref, at full depth")
        bodies = [laws.surfaces[j].body for _, j in pairs]
        weight = float(max(self.model.weights.bodies[body, 0] for body in bodies))
        if not self._weight or not weight:
            return
        rests = any(j in self._lowest for _, j in pairs)
        count = self._lowest.total() if rests else 1
        depth, creep = rest_on(contact, laws, weight, self._weight / count)
        whole = f"the weight on {count} contacts" if count > 1 else WHOLE
        yield _quantity(subject, "rest depth", depth, "m", whole)
        sticks = contact.dimension > 1 and contact.friction[0] > np.tan(SLOPE)
        sticks &= rests or self.apart or not self._lowest
        if sticks and any(map(self._is_loose, bodies)):
            note = f"{whole}, on a slope of {np.degrees(SLOPE):g} degrees"
            yield _quantity(subject, "creep", creep, "m/s", note)

    def _limits(self) -> Iterator[ActingQuantity]:
        """Yield the rebound of joint limits, once for those with the same softness."""
        alike: dict[object, list[SoftLimit]] = {}
        for limit in self.model.laws.limits:
            if limit.joint >= 0:
                key = (limit.softness, limit.joint if self.apart else -1)
                alike.setdefault(key, []).append(limit)
        for limits in alike.values():
            names = _listed(self.model.tree.tree.links[one.joint].name for one in limits)
            motion, subject = pressed(limits[0].softness, self.model.laws), f"limits of {names}"
            rule = "of solreflimit, at full depth"
            yield _quantity(subject, "rebound", motion.rebound, rule=rule)
            if motion.rate * motion.damping:
                yield _quantity(subject, "time constant", 1 / (motion.rate * motion.damping), "s")
            yield _quantity(subject, "damping ratio", motion.damping)

    def _drive(self, drive: Actuator) -> Iterator[ActingQuantity]:
        """Yield the motion of a drive on one joint, with all other joints held."""
        joints = self.model.tree.paths[drive.path].joints
        if len(joints) != 1 or not drive.on:
            return
        (link, gear), tree = joints[0], self.model.tree.tree
        joint, there = tree.links[link], tree.velocities[link].start
        subject, load = f"drive of {joint.name}", float(self._posture.smooth[there])
        kind = "hinge" if joint.kind == "hinge" else "slide"
        largest, rule = self._largest_force(drive, link, gear)
        if np.isfinite(largest):
            yield _quantity(subject, LARGEST, largest, FORCE_UNITS[kind], rule)
        if drive.force_range is not None and load:
            limit = min(map(abs, drive.force_range)) * abs(gear)
            share = abs(load) / limit if limit else np.inf
            yield _quantity(subject, "share of force for weight", share, rule="as drawn")
        if drive.bias != "affine" or drive.biases[1] >= 0:
            return
        servo = self._servo(drive, link, gear, load)
        motion, unit = servo.motion, "rad" if kind == "hinge" else "m"
        yield _quantity(
            subject, "natural frequency", motion.rate / (2 * np.pi), "Hz", "others held"
        )
        active, stiffness = -drive.biases[2] * gear**2, -drive.biases[1] * gear**2
        own_ratio = active / (2 * np.sqrt(stiffness * servo.inertia))
        ratio = _quantity(subject, "damping ratio", motion.damping)
        yield replace(ratio, parts=(active, float(own_ratio)))
        if rubs := sum(one.force for one in self.model.laws.frictions if one.joint == link):
            rule = "by dry friction"
            yield _quantity(subject, "dead band", rubs / servo.stiffness, unit, rule)
        if load:
            yield _quantity(subject, "sag", servo.sag, unit, "as drawn, to first order")
        if self.model.laws.integrator:
            share = (
                servo.stiffness / servo.unstable_stiffness if servo.unstable_stiffness else np.inf
            )
            rule = f"the step of {servo.step:g} s grows above 1"
            yield _quantity(subject, "gain over unstable gain", share, rule=rule)

    def _largest_force(self, drive: Actuator, link: int, gear: float) -> tuple[float, str]:
        """Return the largest force of a drive on its joint, and what is clamped where."""
        limits = [(np.inf, "")]
        if drive.force_range is not None:
            limits.append((max(map(abs, drive.force_range)) * abs(gear), DRIVE_CLAMPED))
        if link in self.model.laws.joint_ranges:
            ends, _ = self.model.laws.joint_ranges[link]
            limits.append((max(map(abs, ends)), "the joint is clamped, after forces add up"))
        if drive.control_range is not None and (drive.gain, drive.bias) == ("fixed", "none"):
            largest = max(map(abs, drive.control_range)) * abs(drive.gains[0] * gear)
            limits.append((largest, "the control is clamped, before the gain"))
        return min(limits)

    def _servo(self, drive: Actuator, link: int, gear: float, load: float) -> Servo:
        laws, joint = self.model.laws, self.model.tree.tree.links[link]
        there = self.model.tree.tree.velocities[link].start
        active = -drive.biases[2] * gear**2
        passive = joint.damping + laws.dampers.get(link, (0.0,))[0]
        ends = laws.integrator != "euler"
        implicit = passive + active if ends else passive if laws.damps_implicitly else 0.0
        return Servo(
            inertia=float(self._posture.mass[there, there]),
            stiffness=-drive.biases[1] * gear**2 + joint.stiffness,
            damping=passive + active - implicit,
            implicit_damping=implicit,
            load=load,
            step=laws.step,
        )


def _rule(first: Surface, other: Surface) -> str:
    values = f"{first.friction[0]:g} and {other.friction[0]:g}"
    if first.priority != other.priority:
        return f"of the higher priority, of {values}"
    return f"the larger of {values}"


def _listed(names: Iterable[str]) -> str:
    return listed(list(dict.fromkeys(names)), NAMED)


def _of_near_rigid(model: NearRigidModel) -> Iterator[ActingQuantity]:
    """Yield the quantities of compliant contacts with the ground, and of near-rigid limits."""
    rules, tree = model.rules, model.tree.tree
    weight = sum(link.mass for link in tree.links) * float(np.linalg.norm(tree.gravity))
    count = Counter(link for link, _ in rules.shapes)
    ground, *surfaces = model.laws.compliant
    grounded = tree.links[0].kind == "free"  # a fixed root meets no floor
    for (link, index), surface in zip(rules.shapes, surfaces, strict=True) if grounded else ():
        subject = f"ground with {link}" if count[link] == 1 else f"ground with {link}#{index + 1}"
        parts = ground.friction, surface.friction
        pair = mix_compliant(ground, surface, model.laws.mixing)
        rule = f"harmonic mean of {parts[0]:g} and {parts[1]:g}"
        yield replace(_quantity(subject, "friction", pair.friction, rule=rule), parts=parts)
        if pair.stiffness:
            rule = WHOLE
            yield _quantity(subject, "rest depth", weight / pair.stiffness, "m", rule)
        if pair.friction > (slope := math.tan(SLOPE)):
            creep = rules.slowest * slope / math.sqrt(pair.friction**2 - slope**2)
            rule = f"at least, on a slope of {math.degrees(SLOPE):g} degrees"
            yield _quantity(subject, "creep", creep, "m/s", rule)
    share = rules.step / (rules.step + rules.dissipation)
    for limit in model.laws.limits:
        subject = f"limits of {tree.links[limit.joint].name}"
        yield _recovery(subject, share, rules.step, "a violation")


def _of_impulses(
    model: ImpulseModel, whole: WholeModel, grounded: frozenset[str]
) -> Iterator[ActingQuantity]:
    """Yield quantities of contacts with the ground, joint limits and drives, as drawn, at rest."""
    laws, tree = model.laws, model.tree.tree
    rules, (floor, *surfaces) = laws.rules, laws.surfaces
    for name, surface in zip(rules.bodies[1:], surfaces, strict=True):
        if name in grounded:
            yield from _hard_contact(f"ground with {name}", floor, surface, rules)
    rule = "unless linearDamping and angularDamping are set to 0, as here"
    yield _quantity("all links", DRAG, rules.drag, "1/s", rule)
    posture: Posture | None = None
    if any(joint.effort for joint in laws.joints):
        start = next(iter(whole.starts))
        posture = next(LawComparison(model, whole).postures([start._replace(m=0 * start.m)]))
    for joint in laws.joints:
        link = tree.links[joint.joint]
        if joint.lower <= joint.upper:
            share, subject = rules.limit_recovery, f"limits of {link.name}"
            yield _quantity(subject, "rebound", share, rule="at most, by the phase of the step")
            yield _recovery(subject, share, rules.step, "a violation")
        if posture is not None and joint.effort:
            subject, unit = f"drive of {link.name}", FORCE_UNITS[link.kind]
            yield _quantity(subject, LARGEST, joint.effort, unit, DRIVE_CLAMPED)
            if load := float(posture.smooth[tree.velocities[joint.joint].start]):
                share = abs(load) / joint.effort
                yield _quantity(subject, "share of force for weight", share, rule="as drawn")
            yield _recovery(subject, rules.gain, rules.step, "an error")


def _hard_contact(
    subject: str, floor: HardSurface, surface: HardSurface, rules: ImpulseRules
) -> Iterator[ActingQuantity]:
    parts = floor.friction, surface.friction
    rule = f"product of {parts[0]:g} and {parts[1]:g}"
    friction = _quantity(subject, "friction", parts[0] * parts[1], rule=rule)
    yield replace(friction, parts=parts)
    bounce = floor.restitution * surface.restitution
    rule = f"product of {floor.restitution:g} and {surface.restitution:g}"
    rule = f"{rule}, above {rules.bounce:g} m/s; less with a smaller step"
    yield _quantity(subject, "restitution", bounce, rule=rule)
    if surface.spring is None:
        yield _quantity(subject, "rest depth", rules.slop, "m", "slop of the solver")
        yield _quantity(subject, "creep", 0.0, "m/s", "friction is an impulse")


def _recovery(subject: str, share: float, step: float, what: str) -> ActingQuantity:
    """Return the time constant of a share that each step removes."""
    rule = f"each step of {step:.3g} s removes {share:g} of {what}"
    return _quantity(subject, "time constant", recovery_time(share, step), "s", rule)


def _of_plane(whole: PlanarWhole) -> Iterator[ActingQuantity]:
    """Yield quantities of bodies in a plane as built: contacts, joints, damping of all bodies."""
    laws = whole.laws

    def subject_of(bodies: tuple[int, int], word: str) -> str:
        """Return the names of two bodies, the one that stands still first."""
        first, other = (laws.bodies[i] for i in bodies)
        names = (first.name, other.name) if other.weighed else (other.name, first.name)
        return f" {word} ".join(names)

    def recovery(subject: str, remains: float, what: str) -> ActingQuantity:
        """Return the time constant of which a share remains after a second."""
        time = recovery_time(1 - remains**laws.step, laws.step)
        rule = f"{what}: {remains:.3g} remains after a second"
        return _quantity(subject, "time constant", time, "s", rule)

    for pair in whole.pairs:
        first, other = (laws.shapes[i] for i in pair)
        subject = subject_of((first.body, other.body), "with")
        parts, bounces = (first.friction, other.friction), (first.elasticity, other.elasticity)
        rule = "product of {:g} and {:g}".format(*parts)
        friction = _quantity(subject, "friction", parts[0] * parts[1], rule=rule)
        yield replace(friction, parts=parts)
        rule = "product of {:g} and {:g}, of the speed before gravity acts".format(*bounces)
        yield _quantity(subject, "restitution", bounces[0] * bounces[1], rule=rule)
        yield _quantity(subject, "rest depth", laws.slop, "m", "at most: the slop of the solver")
        yield recovery(subject, laws.error_bias, "of a deeper overlap")
        yield _quantity(subject, "creep", 0.0, "m/s", "friction is an impulse")
    for joint in laws.joints:
        subject = f"{joint.kind} of {subject_of(joint.bodies, 'and')}"
        if joint.kind in SPRINGS:
            yield from _spring(subject, joint, whole)
        elif joint.kind != "motor":
            if joint.kind in LIMITS:
                share, rule = 1 - joint.error_bias**laws.step, "at most, by the phase of the step"
                yield _quantity(subject, "rebound", share, rule=rule)
            yield recovery(subject, joint.error_bias, "of an error")
    if laws.damping < 1:
        yield recovery("damping of all bodies", laws.damping, "of each velocity")


def _spring(subject: str, joint: PlanarJoint, whole: PlanarWhole) -> Iterator[ActingQuantity]:
    """Yield the motion of two bodies on a spring, without other forces."""
    model = PlanarModel(laws=whole.laws)
    inverse = model.spring_mobility(joint, model.at_rest(whole.home, whole.speeds))
    if rate := (joint.numbers["stiffness"] * inverse) ** 0.5:
        rule = "as built, without other joints"
        yield _quantity(subject, "natural frequency", rate / (2 * math.pi), "Hz", rule)
        yield _quantity(subject, "damping ratio", joint.numbers["damping"] * inverse / (2 * rate))


def _quantity(
    subject: str, quantity: str, value: float, unit: str = "", rule: str = ""
) -> ActingQuantity:
    return ActingQuantity(
        subject=subject, quantity=quantity, value=number(value), unit=unit, rule=rule
    )


R = TypeVar("R", ActingQuantity, ComparedActing)
"""A quantity of one file, or of two."""


def merged(rows: Iterable[R]) -> Iterator[R]:
    """Merge rows that differ only in the last word of the subject, such as a joint."""
    alike: dict[tuple[str, R], list[str]] = {}
    for row in rows:
        kind, _, name = row.subject.rpartition(" ")
        alike.setdefault((kind, replace(row, subject="")), []).append(name)
    for (kind, row), names in alike.items():
        yield replace(row, subject=f"{kind} {listed(names, NAMED)}")
