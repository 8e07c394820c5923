"""Quantities that the numbers of a URDF or of bodies in a plane act as in an engine."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from msgspec.structs import replace

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.urdf import read_urdf
from physics_crosscheck.harness.engines.protocol import LoadedModel, ModelSpec, PlanarWhole
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.readers import read_as_it_runs
from physics_crosscheck.harness.modelfiles.urdf.laws import ruled_model
from physics_crosscheck.harness.records.base import number
from physics_crosscheck.harness.records.comparison import ComparedActing
from physics_crosscheck.harness.records.survey import ActingQuantity
from physics_crosscheck.harness.results.status import listed
from physics_crosscheck.reference.laws.acting import SLOPE, recovery_time
from physics_crosscheck.reference.laws.mechanics import Posture
from physics_crosscheck.reference.laws.near_rigid import NearRigidModel, mix_compliant
from physics_crosscheck.reference.laws.planar import LIMITS, SPRINGS, PlanarModel
from physics_crosscheck.reference.laws.step import LawModel
from physics_crosscheck.reference.mechanism.laws import (
    HardJoint,
    HardSurface,
    ImpulseLaws,
    SoftRules,
)
from physics_crosscheck.reference.mechanism.planar import PlanarJoint, PlanarLaws
from physics_crosscheck.reference.mechanism.tree import TreeError
from .acting import DRIVE_CLAMPED, FORCE_UNITS, LARGEST, NAMED, Acting
from .law_comparison import ImpulseComparison

DRAG = "default damping"
"""Damping of links that an engine adds by itself, relative to their inertia."""


def urdf_quantities(spec: ModelSpec, engine: str) -> tuple[ActingQuantity, ...]:
    """Return what the numbers of a URDF act as in an engine, by its settings and its law.

    Each joint and body has its rows. Engines without such a law have no rows.

    Raises:
        EngineError: if the file cannot be loaded.
    """
    model = engines()[engine].load_whole(spec)
    if model is None or model.rules is None:
        return ()
    try:
        robot = read_as_it_runs(spec.path, {**spec.settings, "couplings": False})
        laws = ruled_model(robot, model.rules)
        if laws is None:
            return ()
        if isinstance(laws, NearRigidModel):
            return tuple(near_rigid_quantities(laws))
        if isinstance(laws, LawModel):
            assert isinstance(model.rules, SoftRules)
            acting = Acting(model=laws, bodies=model.rules.bodies, apart=True)
            return tuple(acting.quantities())
        # A fixed root meets the floor of a setting only.
        floor = laws.laws.root is not None or bool(spec.settings.get("floor"))
        links = read_urdf(Document(robot.file)).links.items() if floor else ()
        grounded = frozenset(name for name, one in links if one.element.find("collision"))
        return tuple(ActingImpulses(ImpulseComparison(laws, model), grounded).quantities())
    except TreeError:
        return ()


def near_rigid_quantities(model: NearRigidModel) -> Iterator[ActingQuantity]:
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
            rule = "the whole weight on one contact"
            yield _quantity(subject, "rest depth", weight / pair.stiffness, "m", rule)
        if pair.friction > (slope := math.tan(SLOPE)):
            creep = rules.slowest * slope / math.sqrt(pair.friction**2 - slope**2)
            rule = f"at least, on a slope of {math.degrees(SLOPE):g} degrees"
            yield _quantity(subject, "creep", creep, "m/s", rule)
    for limit in model.laws.limits:
        share = rules.step / (rules.step + rules.dissipation)
        yield _quantity(
            f"limits of {tree.links[limit.joint].name}", "time constant",
            recovery_time(share, rules.step), "s",
            f"each step of {rules.step:.3g} s removes {share:g} of a violation",
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class ActingImpulses:
    """The impulses of a file, in its drawn configuration at rest; one row for each subject.

    Attributes:
        comparison: the file in the engine, and by its laws.
        grounded: links whose shapes meet the floor.
    """

    comparison: ImpulseComparison
    grounded: frozenset[str]

    def quantities(self) -> Iterator[ActingQuantity]:
        """Yield all quantities: contacts with the ground, joint limits, drives."""
        laws = self._laws
        floor, *surfaces = laws.surfaces
        for name, surface in zip(laws.rules.bodies[1:], surfaces, strict=True):
            if name in self.grounded:
                yield from self._contact(f"ground with {name}", floor, surface)
        rule = "unless linearDamping and angularDamping are set to 0, as here"
        yield _quantity("all links", DRAG, laws.rules.drag, "1/s", rule)
        for joint in laws.joints:
            if joint.lower <= joint.upper:
                yield from self._limit(joint)
            if joint.effort:
                yield from self._motor(joint)

    @property
    def _laws(self) -> ImpulseLaws:
        return self.comparison.laws.laws

    @cached_property
    def _posture(self) -> Posture:
        comparison = self.comparison
        start = next(iter(comparison.model.starts))
        return next(comparison.postures([start._replace(m=0 * start.m)]))

    def _contact(
        self, subject: str, floor: HardSurface, surface: HardSurface
    ) -> Iterator[ActingQuantity]:
        rules, parts = self._laws.rules, (floor.friction, surface.friction)
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

    def _limit(self, joint: HardJoint) -> Iterator[ActingQuantity]:
        rules, subject = self._laws.rules, f"limits of {self._name(joint)}"
        share = rules.limit_recovery
        yield _quantity(subject, "rebound", share, rule="at most, by the phase of the step")
        yield _quantity(
            subject, "time constant", recovery_time(share, rules.step), "s",
            f"each step of {rules.step:.3g} s removes {share:g} of a violation",
        )  # fmt: skip

    def _motor(self, joint: HardJoint) -> Iterator[ActingQuantity]:
        rules, subject = self._laws.rules, f"drive of {self._name(joint)}"
        there = self.comparison.laws.tree.tree.velocities[joint.joint].start
        load = float(self._posture.smooth[there])
        unit = FORCE_UNITS[self.comparison.laws.tree.tree.links[joint.joint].kind]
        yield _quantity(subject, LARGEST, joint.effort, unit, DRIVE_CLAMPED)
        if load:
            share = abs(load) / joint.effort
            yield _quantity(subject, "share of force for weight", share, rule="as drawn")
        yield _quantity(
            subject, "time constant", recovery_time(rules.gain, rules.step), "s",
            f"each step of {rules.step:.3g} s removes {rules.gain:g} of an error",
        )  # fmt: skip

    def _name(self, joint: HardJoint) -> str:
        return self.comparison.laws.tree.tree.links[joint.joint].name


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
    return tuple(merged(dict.fromkeys(ActingPlane(whole).quantities())))


@dataclass(frozen=True, eq=False)
class ActingPlane:
    """Bodies in a plane as they are built; one row for each pair of bodies and each joint."""

    whole: PlanarWhole

    def quantities(self) -> Iterator[ActingQuantity]:
        """Yield all quantities: contacts, joints, and the damping of all bodies."""
        for pair in self.whole.pairs:
            yield from self._contact(pair)
        for joint in self._laws.joints:
            if joint.kind in SPRINGS:
                yield from self._spring(joint)
            elif joint.kind != "motor":
                yield from self._joint(joint)
        if self._laws.damping < 1:
            yield self._recovery("damping of all bodies", self._laws.damping, "of each velocity")

    @property
    def _laws(self) -> PlanarLaws:
        return self.whole.laws

    def _subject(self, bodies: tuple[int, int], word: str) -> str:
        """Return the names of two bodies, the one that stands still first."""
        first, other = (self._laws.bodies[i] for i in bodies)
        names = (first.name, other.name) if other.weighed else (other.name, first.name)
        return f" {word} ".join(names)

    def _contact(self, pair: tuple[int, int]) -> Iterator[ActingQuantity]:
        laws, (first, other) = self._laws, (self._laws.shapes[i] for i in pair)
        subject = self._subject((first.body, other.body), "with")
        parts, bounces = (first.friction, other.friction), (first.elasticity, other.elasticity)
        rule = "product of {:g} and {:g}".format(*parts)
        friction = _quantity(subject, "friction", parts[0] * parts[1], rule=rule)
        yield replace(friction, parts=parts)
        rule = "product of {:g} and {:g}, of the speed before gravity acts".format(*bounces)
        yield _quantity(subject, "restitution", bounces[0] * bounces[1], rule=rule)
        yield _quantity(subject, "rest depth", laws.slop, "m", "at most: the slop of the solver")
        yield self._recovery(subject, laws.error_bias, "of a deeper overlap")
        yield _quantity(subject, "creep", 0.0, "m/s", "friction is an impulse")

    def _joint(self, joint: PlanarJoint) -> Iterator[ActingQuantity]:
        subject = f"{joint.kind} of {self._subject(joint.bodies, 'and')}"
        if joint.kind in LIMITS:
            share = 1 - joint.error_bias**self._laws.step
            yield _quantity(subject, "rebound", share, rule="at most, by the phase of the step")
        yield self._recovery(subject, joint.error_bias, "of an error")

    def _spring(self, joint: PlanarJoint) -> Iterator[ActingQuantity]:
        """Yield the motion of two bodies on a spring, without other forces."""
        model = PlanarModel(laws=self._laws)
        inverse = model.spring_mobility(joint, model.at_rest(self.whole.home, self.whole.speeds))
        rate = (joint.numbers["stiffness"] * inverse) ** 0.5
        if not rate:
            return
        subject = f"{joint.kind} of {self._subject(joint.bodies, 'and')}"
        rule = "as built, without other joints"
        yield _quantity(subject, "natural frequency", rate / (2 * math.pi), "Hz", rule)
        ratio = joint.numbers["damping"] * inverse / (2 * rate)
        yield _quantity(subject, "damping ratio", ratio)

    def _recovery(self, subject: str, remains: float, what: str) -> ActingQuantity:
        """Return the time constant of which a share remains after a second."""
        step = self._laws.step
        time = recovery_time(1 - remains**step, step)
        rule = f"{what}: {remains:.3g} remains after a second"
        return _quantity(subject, "time constant", time, "s", rule)


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
