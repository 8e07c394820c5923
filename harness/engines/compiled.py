"""A model file as the numbers that an engine compiles it to: a tree of bodies with joints.

This shows how an engine reads defaults, frames, units and shapes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

from physics_crosscheck.reference.mechanism.bodies import (
    ZERO,
    BodyModel,
    ForceElement,
    RigidBody,
    Site,
)
from physics_crosscheck.reference.mechanism.laws import Laws

Numbers = tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class CompiledShape:
    """A shape or a site.

    Attributes:
        name: its place, as in `Model.shapes`.
        frame: its frame, as the file states it.
        size: the numbers that give its extent, m; empty for a mesh.
        kind: its form.
        visual: whether it touches nothing.
        mesh: path of the mesh's file as the engine resolves it; empty without one.
        scale: factors of the mesh's coordinates.
    """

    name: str
    frame: Site
    size: Numbers
    kind: str
    visual: bool = False
    mesh: str = ""
    scale: Numbers = (1.0, 1.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class CompiledActuator:
    """An actuator.

    Attributes:
        name: as in the file; empty if it has no name.
        on: name of the joint or other element that it acts on.
        kind: kind of that element, dependence of its force, law and dynamics.
        numbers: named numbers that its force depends on: gear, gain, bias, constants of its
            dynamics, and its own damper and armature.
        ranges: ranges of its control, state and force, and further features such as a delay.
        covered: whether its force has a formula, so that it acts in smooth motions.
        control: index of its first input.
        states: indices of its own states.
    """

    name: str
    on: str
    kind: tuple[str, ...]
    numbers: tuple[tuple[str, Numbers], ...]
    ranges: tuple[tuple[str, Numbers], ...]
    covered: bool
    control: int
    states: tuple[int, ...]


@dataclass(frozen=True, kw_only=True)
class CompiledTree(BodyModel):
    """All bodies except the ground, parents first, in the order of the file.

    Bodies and joints without a name have one by their index. `inertia` is along principal axes. A
    body with a free joint is where the file draws it.

    Attributes:
        controls: number of actuator inputs.
        name: of the model; empty if it has no name.
        besides: elements that the settings `smooth` and `couplings` leave out, each with its count.
        uncovered: other effects on the bodies that have no formula.
        actuators: in the order of the file.
        states: number of actuator states.
        shapes: file names, as in the model, of meshes that the inertias depend on.
        engine_variants: where the engine's force law differs from the file: a cause, and the forces
            that the engine computes.
        laws: numbers of limits, friction, equalities, contacts and drives; None if unknown.
        paths: force elements without coefficients, along which these act.
        placed: shapes and sites.
        options: settings of the whole file, in words, by attribute.
        excluded: pairs of bodies whose shapes do not touch, by index.
        others: effects in no other field: subject, attribute and value, in words.
    """

    controls: int = 0
    name: str = ""
    besides: tuple[tuple[str, int], ...] = ()
    uncovered: tuple[str, ...] = ()
    actuators: tuple[CompiledActuator, ...] = ()
    states: int = 0
    shapes: tuple[str, ...] = ()
    engine_variants: tuple[tuple[str, tuple[ForceElement, ...]], ...] = ()
    laws: Laws | None = None
    paths: tuple[ForceElement, ...] = ()
    placed: tuple[CompiledShape, ...] = ()
    options: tuple[tuple[str, str], ...] = ()
    excluded: tuple[tuple[int, int], ...] = ()
    others: tuple[tuple[str, str, str], ...] = ()

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, in the bodies' order."""
        return tuple(joint.name for body in self.bodies for joint in body.joints)

    @property
    def passive(self) -> tuple[ForceElement, ...]:
        """Forces without an input."""
        return tuple(pull for pull in self.pulls if pull.input < 0)

    def held(self, controls: Sequence[float]) -> BodyModel:
        """Return bodies and forces with these inputs; free bodies count from the world."""
        pulls = (_held(one, controls[one.input] if one.input >= 0 else 0.0) for one in self.pulls)
        return BodyModel(
            bodies=tuple(map(_from_world, self.bodies)),
            gravity=self.gravity,
            pulls=tuple(pulls),
            couplings=self.couplings,
            fluid=self.fluid,
        )


# A file is compiled once for each of its numbers, with mostly equal bodies and forces.
@lru_cache(maxsize=1024)
def _held(force: ForceElement, control: float) -> ForceElement:
    return replace(force, control=control, input=-1, range=None)


@lru_cache(maxsize=1024)
def _from_world(body: RigidBody) -> RigidBody:
    """Return a body, at the world's origin if it has a free joint; equal ones are one object."""
    if any(joint.kind == "free" for joint in body.joints):
        return replace(body, position=ZERO, quaternion=None)
    return body
