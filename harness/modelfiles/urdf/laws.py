"""Limits, motors and contacts of a URDF whose laws have settings of an engine."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.elements import Number, XmlElement
from physics_crosscheck.harness.documents.urdf import ENDLESS, UrdfFile, read_urdf
from physics_crosscheck.reference.laws.impulses import ImpulseModel
from physics_crosscheck.reference.laws.mechanics import LawTree
from physics_crosscheck.reference.laws.near_rigid import NearRigidModel, near_rigid_softness
from physics_crosscheck.reference.laws.step import LawModel
from physics_crosscheck.reference.mechanism.laws import (
    CompliantSurface,
    HardJoint,
    HardSurface,
    ImpulseLaws,
    ImpulseRules,
    Laws,
    NearRigidRules,
    Rules,
    SoftFriction,
    SoftLimit,
    Softness,
    SoftRules,
)
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import IDENTITY
from physics_crosscheck.reference.mechanism.tree import WORLD, Tree, TreeError
from ..robot import Robot
from .read import UrdfNumbers


def ruled_model(robot: Robot, rules: Rules) -> ImpulseModel | LawModel | None:
    """Return the laws of a URDF on its bodies, with settings of an engine; None without joints.

    Args:
        robot: the file, with joints that follow others set free.
        rules: of the engine.

    Raises:
        TreeError: if the file has no tree, or a joint has too many degrees of freedom.
    """
    if robot.tree is None:
        raise TreeError("joints without a tree")
    file = read_urdf(Document(robot.file))
    if isinstance(rules, ImpulseRules):
        return _model(file, robot.tree, rules, floats=robot.floats)
    return _convex(file, robot.tree, rules)


def _convex(file: UrdfFile, tree: Tree, rules: NearRigidRules | SoftRules) -> LawModel | None:
    """Return the limits, dry friction and contacts of a file on its tree; None without joints."""
    if not tree.links:
        return None
    floats = tree.links[0].kind == "free"
    if any(link.kind not in ("hinge", "slide") for link in tree.links[floats:]):
        raise TreeError("a joint with several degrees of freedom")
    if isinstance(rules, SoftRules):
        return _soft(file, tree, rules)
    return _near_rigid(file, tree, rules)


def _soft(file: UrdfFile, tree: Tree, rules: SoftRules) -> LawModel:
    """Return the laws of a file on its tree, by the softness and surfaces of an engine."""
    if rules.laws.uncovered:
        raise TreeError(", ".join(rules.laws.uncovered))
    tree = _without_springs(tree)
    frames = [tree.frames[name] for name in rules.bodies[1:]]
    masses, centers = _fused(file, tree, rules.bodies)
    return LawModel(
        laws=replace(
            rules.laws,
            # Equal bounds are ignored, with a warning.
            limits=tuple(
                limit
                for limit in _limits(file, tree, rules.softness, continuous=False)
                if limit.lower < limit.upper
            ),
            frictions=tuple(_frictions(file, tree, rules.softness)),
        ),
        tree=LawTree(
            tree=tree, paths=(), bodies=((WORLD, IDENTITY), *frames),
            masses=masses, centers=centers,
        ),
        home=np.zeros(tree.nv),
    )  # fmt: skip


def _fused(file: UrdfFile, tree: Tree, bodies: Sequence[str]) -> tuple[Array, Array]:
    """Return mass and centre of bodies, each a link with the links that are fused with it."""
    above = {joint.child: joint.parent for joint in file.joints.values()}
    masses, moments = np.zeros(len(bodies)), np.zeros((len(bodies), 3))
    for name, link in file.links.items():
        root = name
        while root not in bodies and root in above:
            root = above[root]
        if root in bodies:
            inertia, i = link.body.spatial_inertia, bodies.index(root)
            (_, body), (_, place) = tree.frames[root], tree.frames[name]
            center = place.origin + place.rotation @ inertia.center
            masses[i] += inertia.mass
            moments[i] += inertia.mass * (body.rotation.T @ (center - body.origin))
    return masses, moments / np.where(masses > 0, masses, 1.0)[:, None]


def _limits(
    file: UrdfFile, tree: Tree, softness: Softness, *, continuous: bool
) -> Iterator[SoftLimit]:
    """Yield the ranges of joints, and of continuous ones that state one if these act."""
    bounds = file.stated_bounds if continuous else lambda name: file.joints[name].bounds
    for i, link in enumerate(tree.links):
        if link.kind != "free":
            lower, upper = bounds(link.name)
            if lower <= upper and np.isfinite([lower, upper]).all():
                yield SoftLimit(joint=i, lower=lower, upper=upper, margin=0.0, softness=softness)


def _frictions(file: UrdfFile, tree: Tree, softness: Softness) -> Iterator[SoftFriction]:
    """Yield the dry friction of joints."""
    for i, link in enumerate(tree.links):
        if link.kind != "free" and (force := file.joints[link.name].friction) > 0:
            yield SoftFriction(joint=i, force=force, softness=softness)


def _near_rigid(file: UrdfFile, tree: Tree, rules: NearRigidRules) -> NearRigidModel:
    """Return the laws of a file on its tree, by the near-rigid rows of an engine."""
    softness, floats = near_rigid_softness(rules), tree.links[0].kind == "free"
    limits = tuple(_limits(file, tree, softness, continuous=True)) if rules.has_limits else ()
    dry = tuple(_frictions(file, tree, softness)) if rules.dry_friction_share else ()
    tree, shapes = _without_springs(tree), rules.shapes
    return NearRigidModel(
        # Dampers are part of the convex problem. A free root's rotation has no rule.
        laws=Laws(
            step=rules.step, integrator="" if floats else "euler", damps_implicitly=False,
            limits=limits, frictions=dry, mixing="harmonic",
            compliant=(rules.default, *(_compliant(file, *shape, rules) for shape in shapes)),
        ),
        tree=LawTree(
            tree=tree, paths=(),
            bodies=((WORLD, IDENTITY), *(tree.frames[link] for link, _ in shapes)),
            masses=np.zeros(1 + len(shapes)), centers=np.zeros((1 + len(shapes), 3)),
        ),
        home=np.zeros(tree.nv),
        rules=rules,
    )  # fmt: skip


def _compliant(file: UrdfFile, link: str, index: int, rules: NearRigidRules) -> CompliantSurface:
    """Return the surface of a collision element, whose numbers are an extension of the format."""
    shape = file.links[link].element.findall("collision")[index]
    parent, static, friction, stiffness, dissipation = rules.surface_tags
    elements = shape.findall(f"{parent}/*")
    numbers = {element.tag: _value(file.document, element) for element in elements}
    usual = rules.default
    return CompliantSurface(
        friction=numbers.get(friction, numbers.get(static, usual.friction)),
        stiffness=numbers.get(stiffness, usual.stiffness),
        dissipation=numbers.get(dissipation, usual.dissipation),
    )


def _model(file: UrdfFile, tree: Tree, rules: ImpulseRules, *, floats: bool) -> ImpulseModel | None:
    """Return the laws of a file on its tree; None without joints."""
    if not tree.links:
        return None
    tree = _without_springs(tree)
    return ImpulseModel(
        laws=ImpulseLaws(
            rules=rules,
            joints=tuple(_joints(file, tree, rules)),
            surfaces=(rules.floor, *(_surface(file, name, rules) for name in rules.bodies[1:])),
            root=file.links[file.root].body.center if floats else None,
        ),
        tree=LawTree(
            tree=tree,
            paths=(),
            bodies=((WORLD, IDENTITY), *(tree.frames[name] for name in rules.bodies[1:])),
            masses=np.array([0.0, *(file.links[name].body.mass for name in rules.bodies[1:])]),
            centers=np.zeros((len(rules.bodies), 3)),
        ),
    )


_NUMBERS = re.compile(
    r"robot/(joint/(limit@(lower|upper|effort)|dynamics@friction)|link/contact/\w+@value"
    r"|link/collision/\w+:\w+/\w+:\w+@value)"
)
"""Numbers that the laws depend on, besides those of the bodies."""


L = TypeVar("L", ImpulseModel, LawModel)
"""The laws of a URDF, with settings of an engine."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RuledNumbers(Generic[L]):
    """The numbers of a URDF whose laws have settings of an engine.

    Attributes:
        numbers: of the file.
        build: returns the laws of the file on its tree, or None.
    """

    numbers: UrdfNumbers
    build: Callable[[UrdfFile, Tree], L | None]

    @property
    def numerals(self) -> tuple[Number, ...]:
        """All numbers, in order."""
        return self.numbers.numerals

    @cached_property
    def law_numbers(self) -> tuple[int, ...]:
        """Indices of the numbers that may affect the laws."""
        numerals = enumerate(self.numerals)
        return tuple(i for i, one in numerals if _NUMBERS.fullmatch(one.path))

    @property
    def law_choices(self) -> Mapping[int, tuple[int, ...]]:
        """Nothing: the format has no number that selects a law."""
        return {}

    def laws(self, values: Mapping[int, float]) -> L | None:
        """Return the laws with other values of some numbers, by index, or None."""
        nominal = self._nominal
        if not values or nominal is None or not set(values) <= set(self.law_numbers):
            return self._built(values) if values else nominal
        laws = self._built(values, nominal.tree.tree)  # these numbers leave the bodies as they are
        # Laws on the same tree are solved again only where their rows differ.
        return None if laws is None else nominal.under(laws.laws)

    @cached_property
    def _nominal(self) -> L | None:
        """The laws of the file as it is."""
        return self._built({})

    def _built(self, values: Mapping[int, float], tree: Tree | None = None) -> L | None:
        with self.numbers.changed(values, coupled=False, tree=tree) as changed:
            return None if changed is None else self.build(*changed)

    def texts(self, values: Mapping[int, float]) -> Mapping[Path, bytes]:
        """Return the file with other values of some numbers."""
        return self.numbers.texts(values)


def impulse_numbers(numbers: UrdfNumbers, rules: ImpulseRules) -> RuledNumbers[ImpulseModel]:
    """Return the numbers of a URDF whose limits, motors and contacts act by impulses."""
    build = partial(_model, rules=rules, floats=numbers.floats)
    return RuledNumbers(numbers=numbers, build=build)


def convex_numbers(
    numbers: UrdfNumbers, rules: NearRigidRules | SoftRules
) -> RuledNumbers[LawModel]:
    """Return the numbers of a URDF whose laws are a convex problem."""
    return RuledNumbers(numbers=numbers, build=partial(_convex, rules=rules))


def _without_springs(tree: Tree) -> Tree:
    """Return a tree without springs, which are extensions of the format for other programs."""
    return replace(tree, links=tuple(replace(link, stiffness=0.0) for link in tree.links))


def _joints(file: UrdfFile, tree: Tree, rules: ImpulseRules) -> Iterator[HardJoint]:
    """Yield ranges and motors of hinges and slides."""
    for i, link in enumerate(tree.links):
        if link.kind not in ("hinge", "slide"):
            continue
        joint = file.joints[link.name]
        lower, upper = joint.bounds
        if not np.isfinite([lower, upper]).all():
            lower, upper = 1.0, 0.0
        document = file.document
        limit = document.child(joint.element, "limit")
        # The targets of endless joints are restricted too.
        low, high, effort = (
            document.number(limit, key, default, "<limit>")
            for key, default in (("lower", 0.0), ("upper", -1.0), ("effort", 0.0))
        )
        yield HardJoint(
            joint=i,
            control=rules.controls.index(link.name),
            lower=lower,
            upper=upper,
            targets=(low, high) if joint.bounds == ENDLESS else joint.bounds,
            effort=max(0.0, effort),
        )


def _surface(file: UrdfFile, name: str, rules: ImpulseRules) -> HardSurface:
    """Return the surface of a link: `<contact>` is an extension of the format."""
    contact = file.links[name].element.find("contact")
    if contact is None:
        return rules.default
    stated = {child.tag: child for child in contact.children}

    def number(tag: str, default: float) -> float:
        return _value(file.document, stated[tag]) if tag in stated else default

    spring = number("stiffness", 0.0), number("damping", 0.0)
    return HardSurface(
        friction=number("lateral_friction", rules.default.friction),
        restitution=number("restitution", rules.default.restitution),
        spring=spring if "stiffness" in stated or "damping" in stated else None,
        anchored="friction_anchor" in stated,
    )


def _value(document: Document, element: XmlElement) -> float:
    return document.number(element, "value", 0.0, f"<{element.tag}>")
