"""Accelerations and the next state of a tree by its laws."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.reference.mechanism.laws import ContactPoint, SoftEquality, SoftLimit
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.tree import WORLD, Tree
from .constraints import Constraints
from .drives import Driven, clamps, drive, unsaturated
from .mechanics import LawTree, Posture
from .soft import WITHIN, Kind, Part, Problem, varies

STEPPED = ("euler", "implicitfast", "implicit", "implicit dampers")
"""Integrators with a rule for the next velocity."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LawStep:
    """Forces and constraints that the laws give at one state.

    Attributes:
        model: the laws.
        posture: the state.
        problem: the convex problem of the constraints.
        driven: the drives.
        parts: of the laws, which the rows belong to.
    """

    model: LawModel
    posture: Posture
    problem: Problem
    driven: Driven
    parts: tuple[Part, ...]

    def uncertainty(self, a: Array, unbalanced: Array) -> Array:
        """Return the uncertainty of accelerations, (nv,), by rounding and by both solvers.

        Args:
            a: accelerations.
            unbalanced: force that an engine's solver left, (nv,).
        """
        posture = self.posture
        rounded = self.problem.rounding(a, posture.mass_terms, posture.loads)
        unsure = DIGITS * np.finfo(float).eps * rounded
        for residual in (unbalanced, self.problem.residual(a)):
            unsure = unsure + _solver_bound(posture.inverse, residual)
        return unsure

    def acted(self, a: Array) -> Iterator[tuple[str, int]]:
        """Yield how often forces of each kind acted."""
        active = self.problem.forces(a)[0] != 0
        for kind, name in _NAMES.items():
            yield name, int(np.sum(active & (self.problem.kinds == kind.value)))
        acting = {part for part, acts in zip(self.parts, active, strict=True) if acts}
        for word in ("contact", "limit"):
            yield f"{word}s", sum(part.kind == word for part in acting)
        yield "drives at a limit", len(self.driven.clipped)
        yield "drives", int(np.count_nonzero(self.driven.forces))

    def next_state(self, a: Array, after: Array, h: float) -> tuple[Array, Array]:
        """Return velocities and positions after a step, (nv,) each; laws without a rule have none.

        Args:
            a: accelerations, (nv,).
            after: velocities by which the positions advance, (nv,).
            h: the time by which they advance, s.
        """
        velocity, tree = self.model.advance(self, a), self.model.tree
        assert velocity is not None
        return velocity, tree.advance(self.posture.y[None], after[None], h)[0]

    def velocity_uncertainty(self, a: Array, unsure: Array) -> Array:
        """Return the uncertainty of the next velocities, (nv,), from that of accelerations."""
        return self.model.velocity_uncertainty(self, a, unsure)

    @property
    def drive_states(self) -> Array:
        """States of the drives after the step."""
        return self.driven.states

    @property
    def efforts(self) -> Iterator[tuple[int, float, float]]:
        """Joints with the force of a drive and its limit in that direction."""
        for i, actuator in enumerate(self.model.laws.drives):
            joints = self.model.tree.paths[actuator.path].joints
            if len(joints) == 1 and actuator.on:
                (joint, gear), force = joints[0], float(self.driven.forces[i])
                low, high = actuator.force_range or (-np.inf, np.inf)
                largest = abs(high if force > 0 else low)
                if i in self.driven.clipped:  # by a limit of its tendon
                    largest = abs(force)
                yield joint, gear * force, abs(gear) * largest


DIGITS = 16
"""Last digits by which each term of an acceleration may be rounded."""

SLOWEST = 1e-3
"""Smallest velocity by which derivatives of forces are scaled, rad/s or m/s."""

_NAMES = {Kind.EQUALITY: "equalities", Kind.FRICTION: "dry friction"}


def _solver_bound(inverse: Array, unbalanced: Array) -> Array:
    """Return the bound of a solver's error, (nv,), from the force that it left.

    The cost is convex in M, so |a - a*|_M <= |grad|_(M^-1).
    """
    size = np.sqrt(max(0.0, float(unbalanced @ inverse @ unbalanced)))
    result: Array = np.sqrt(np.diagonal(inverse)) * size
    return result


@dataclass(frozen=True, kw_only=True, eq=False)
class LawSolution:
    """The laws at one state, with their solution.

    Attributes:
        law: rows and drives.
        acceleration: the solution, (nv,).
        contacts: at the state.
        controls, states: inputs and states of the drives.
    """

    law: LawStep
    acceleration: Array
    contacts: tuple[ContactPoint, ...]
    controls: Array
    states: Array

    converged: ClassVar[bool] = True
    """A convex problem has one solution."""

    @property
    def posture(self) -> Posture:
        """The tree at the state."""
        return self.law.posture

    @property
    def acting_elements(self) -> Iterator[tuple[str, str | int]]:
        """The elements that act, as in `LawModel.elements`; both shapes of a contact do."""
        model = self.law.model
        for part in model.acting(self):
            if part.kind == "contact":
                yield from (("contact", i) for i in self.contacts[part.place].surfaces)
            else:
                yield model.element(part)
        yield from (("drive", int(i)) for i in np.flatnonzero(self.law.driven.forces))

    @cached_property
    def _compliance(self) -> Array:
        """Change of the accelerations per unit force, (nv, nv)."""
        problem = self.law.problem
        slope = problem.forces(self.acceleration)[1]
        hessian = problem.mass + problem.jacobian.T @ slope @ problem.jacobian
        return np.asarray(np.linalg.inv(hessian), dtype=np.float64)

    def effect(self, force: Array) -> Array:
        """Return the change of the accelerations by a small force, (nv,)."""
        result: Array = self._compliance @ force
        return result


@dataclass(frozen=True, kw_only=True, eq=False)
class LawModel(Constraints):
    """A tree with its laws: constraints, drives and an integrator."""

    @cached_property
    def _branches(self) -> NDArray[np.bool_]:
        return same_branch(self.tree.tree)

    def evaluate(
        self,
        posture: Posture,
        controls: Array,
        states: Array,
        contacts: Sequence[ContactPoint],
    ) -> LawStep:
        """Evaluate the laws at a state.

        Args:
            posture: the state.
            controls, states: inputs and states of the drives.
            contacts: as a collision detector reports them.
        """
        driven = drive(self.laws, posture, self.weights.path_accelerations, controls, states)
        force = posture.smooth + driven.joint_forces
        free = np.asarray(np.linalg.solve(posture.mass, force), dtype=np.float64)
        rows = self.rows(posture, contacts)
        return LawStep(
            model=self,
            posture=posture,
            problem=rows.problem(posture.mass, free),
            driven=driven,
            parts=tuple(rows.parts),
        )

    def solve(
        self,
        posture: Posture,
        controls: Array,
        states: Array,
        contacts: Sequence[ContactPoint],
        start: Array,
        residual: Array | None = None,
    ) -> LawSolution:
        """Solve the laws at a state.

        Args:
            posture, controls, states, contacts: as in `evaluate`.
            start: a first guess, such as an engine's answer, (nv,).
            residual: force that the engine's solver left there, (nv,); None if unknown.
        """
        law = self.evaluate(posture, controls, states, contacts)
        if residual is not None:
            momentum = posture.mass @ posture.m / self.laws.step
            law = replace(law, problem=law.problem.with_residual(start, residual, momentum))
        return LawSolution(
            law=law,
            acceleration=law.problem.solve(start),
            contacts=tuple(contacts),
            controls=controls,
            states=states,
        )

    def parts(self) -> Iterator[Part]:
        """Yield the parts of the laws that may act at some state."""
        laws = self.laws
        for i, limit in enumerate(laws.limits):
            ball = limit.joint >= 0 and self.tree.tree.links[limit.joint].kind == "ball"
            yield from (Part("limit", i, way) for way in ((1,) if ball else (-1, 1)))
        soft: dict[str, Sequence[SoftLimit | SoftEquality]]
        soft = {"limit": laws.limits, "equality": laws.equalities}
        for kind, rows in soft.items():
            softness = (row.softness for row in rows)
            yield from (Part(kind, i, WITHIN) for i, one in enumerate(softness) if varies(one))
        for i in range(len(laws.frictions)):
            yield from (Part("dry friction", i, way) for way in (0, 1))
        for i, actuator in enumerate(laws.drives):
            ranges = {"control": actuator.control_range, "force": actuator.force_range}
            ranges["state"] = actuator.state_range if actuator.state >= 0 else None
            for kind, limits in ranges.items() if actuator.on else ():
                if limits is not None:
                    yield from (Part(kind, i, way) for way in (-1, 1))
        for joint in laws.joint_ranges:
            yield from (Part("joint force", joint, way) for way in (-1, 1))
        for i in range(len(laws.sums)):
            yield from (Part("tendon force", i, way) for way in (-1, 1))

    def missing_parts(self, solutions: Iterable[LawSolution]) -> set[Part]:
        """Return the parts of the laws that act at none of these states, of those that may."""
        return set(self.parts()) - {part for one in solutions for part in self.acting(one)}

    def elements(self) -> Iterator[tuple[str, str | int]]:
        """Yield the kind and the name of all that may act: limits, drives, clamps, equalities.

        Drives, their clamps, and the surfaces of moving bodies have an index for a name.
        """
        laws = self.laws
        yield from map(self.element, self.parts())
        yield from (("equality", str(i + 1)) for i in range(len(laws.equalities)))
        yield from (("drive", i) for i, actuator in enumerate(laws.drives) if actuator.on)
        paired = {i for first, other, _ in laws.pairs for i in (first, other)}
        for i, surface in enumerate(laws.surfaces):
            if surface.body and (any(surface.masks) or i in paired):
                yield "contact", i
        yield from (("contact", i) for i in range(1, len(laws.compliant)))

    def element(self, part: Part) -> tuple[str, str | int]:
        """Return the element that a part belongs to, as in `elements`."""
        laws, links = self.laws, self.tree.tree.links
        match part.kind:
            case "limit" | "dry friction":
                row = (laws.limits if part.kind == "limit" else laws.frictions)[part.place]
                name = links[row.joint].name if row.joint >= 0 else f"tendon {row.path + 1}"
                return part.kind, name
            case "control" | "state" | "force":
                return "clamp", part.place
            case "joint force":
                return "clamp", links[part.place].name
            case "tendon force":
                return "clamp", f"tendon force {part.place + 1}"
        return part.kind, str(part.place + 1)

    @property
    def limits(self) -> Iterator[tuple[int, float, float]]:
        """Joints with their lower and upper limits, infinite without one."""
        for limit in self.laws.limits:
            if limit.joint >= 0:
                yield limit.joint, limit.lower, limit.upper

    @property
    def has_next_state(self) -> bool:
        """True if the next state has a rule."""
        return self.laws.integrator in STEPPED

    @property
    def drive_count(self) -> int:
        """Number of drives."""
        return len(self.laws.drives)

    def drive_ranges(self, controls: int, states: int) -> tuple[Array, Array]:
        """Return ranges of so many controls and states of drives, infinite without one, (., 2)."""
        of_controls, of_states = (np.tile([-np.inf, np.inf], (n, 1)) for n in (controls, states))
        for actuator in self.laws.drives:
            if actuator.control_range is not None:
                of_controls[actuator.control] = actuator.control_range
            if actuator.state >= 0 and actuator.state_range is not None:
                of_states[actuator.state] = actuator.state_range
        return of_controls, of_states

    def unsaturated(self, posture: Posture, shares: Array) -> tuple[Array, Array]:
        """Return controls and states at which drives exert shares of their limits."""
        return unsaturated(self.laws, posture, self.weights.path_accelerations, shares)

    def acting(self, solution: LawSolution) -> Iterator[Part]:
        """Yield the parts that act at a state."""
        law = solution.law
        forces = np.abs(law.problem.forces(solution.acceleration)[0])
        for part, force, bound in zip(law.parts, forces, law.problem.bounds, strict=True):
            if force:
                match part.kind:
                    case "dry friction":
                        yield part._replace(way=int(force >= bound))
                    case "limit" if abs(part.way) == WITHIN:
                        yield part._replace(way=WITHIN)
                        yield part._replace(way=part.way // WITHIN)
                    case _:
                        yield part
        yield from clamps(self.laws, law.posture, law.driven, solution.controls)

    def advance(self, law: LawStep, a: Array) -> Array | None:
        """Return the velocities after a step, (nv,), from accelerations; None without a rule."""
        damping = self._implicit_damping(law)
        if damping is None:
            return None
        h, mass = self.laws.step, law.posture.mass
        if not damping.any():
            return law.posture.m + h * a
        result: Array = law.posture.m + h * np.linalg.solve(mass + h * damping, mass @ a)
        return result

    def velocity_uncertainty(self, law: LawStep, a: Array, unsure: Array) -> Array:
        """Return the uncertainty of the velocities after a step, (nv,), from accelerations'.

        Args:
            law: the forces.
            a, unsure: accelerations and their uncertainty, (nv,).
        """
        damping, h = self._implicit_damping(law), self.laws.step
        if damping is None or not damping.any():
            return h * unsure
        mass, loose = law.posture.mass, np.zeros_like(a)
        if self.laws.integrator != "euler":  # derivatives of forces that cancel
            fastest = max(float(np.max(np.abs(law.posture.m))), SLOWEST)
            largest = float(np.max(np.abs(a)))
            loose = h * largest / fastest * law.posture.loads
            # Engines take the arms in M from differences of positions.
            far = max(float(np.linalg.norm(pose.origin)) for pose in law.posture.poses)
            loose = DIGITS * np.finfo(float).eps * (loose + far * largest * np.diagonal(mass))
        inverse = np.linalg.inv(mass + h * damping)
        result: Array = h * (np.abs(inverse @ mass) @ unsure + np.abs(inverse) @ loose)
        return result

    def _implicit_damping(self, law: LawStep) -> Array | None:
        """Return the damping that the integrator evaluates at the step's end, (nv, nv)."""
        match self.laws.integrator:
            case "euler":
                joints = self._joint_damping + self._dampers_of_joints(law.posture.m)
                acts = self.laws.damps_implicitly and bool(np.any(joints > 0))
                return np.diag(joints if acts else 0 * joints)
            case "implicitfast":
                damping = self._dampers(law) + law.posture.fluid_damping()
                return damping * self._branches + self._gyroscopic(law.posture)
            case "implicit dampers":
                return self._dampers(law)
            case "implicit":
                smooth = _by_velocity(self._quadratic, law.posture)
                curved = self._tendon_damping(law.posture) + law.posture.fluid_damping()
                return (smooth + curved + law.driven.damping) * self._branches
        return None

    def _dampers(self, law: LawStep) -> Array:
        """Return the damping of joints, paths and drives, (nv, nv)."""
        passive = np.diag(self._joint_damping) + self._tendon_damping(law.posture)
        return passive + law.driven.damping

    @cached_property
    def _joint_damping(self) -> Array:
        tree = self.tree.tree
        return np.concatenate(
            [
                np.full(there.stop - there.start, link.damping)
                for link, there in zip(tree.links, tree.velocities, strict=True)
            ]
        )

    def _dampers_of_joints(self, m: Array) -> Array:
        slopes = np.zeros_like(m)
        for joint, powers in self.laws.dampers.items():
            there = self.tree.tree.velocities[joint]
            slopes[there] += _slope(powers, np.abs(m[there]))
        return slopes

    def _tendon_damping(self, posture: Posture) -> Array:
        damping = np.zeros_like(posture.mass)
        for row, element in zip(posture.pull_rows, self.tree.tree.pulls, strict=True):
            damping += _slope(element.damping, np.abs(row @ posture.m)) * np.outer(row, row)
        return damping

    def _gyroscopic(self, posture: Posture) -> Array:
        """Return minus the derivative of the inertial forces of lone free bodies, (nv, nv)."""
        result = np.zeros_like(posture.mass)
        if self._lone:
            whole = _by_velocity(self._without_springs, posture)
            for there in self._lone:
                result[there, there] = whole[there, there] - np.diag(self._joint_damping[there])
        return result

    @cached_property
    def _quadratic(self) -> LawTree:
        """The bodies with forces that are quadratic in the velocities."""
        return replace(self.tree, tree=replace(self.tree.tree, pulls=(), fluid=None))

    @cached_property
    def _without_springs(self) -> LawTree:
        return replace(self.tree, tree=replace(self._quadratic.tree, bushings=()))

    @cached_property
    def _lone(self) -> list[slice]:
        """Velocities of free bodies that carry nothing."""
        links, slices = self.tree.tree.links, self.tree.tree.velocities
        carriers = {link.parent for link in links}
        rows = enumerate(zip(links, slices, strict=True))
        return [
            there
            for i, (link, there) in rows
            if link.kind == "free" and link.parent == WORLD and i not in carriers
        ]


def _slope(powers: Sequence[float], speed: Array) -> Array:
    """Return the derivative of a damper's force by the speed."""
    slope: Array = sum((i * d * speed ** (i - 1) for i, d in enumerate(powers, 1)), 0.0 * speed)
    return slope


def _by_velocity(tree: LawTree, posture: Posture) -> Array:
    """Return minus the derivative of the smooth forces by the velocities, (nv, nv).

    Central differences are exact for forces that are quadratic in the velocities.
    """
    n = len(posture.m)
    size = max(float(np.max(np.abs(posture.m))), SLOWEST)
    moved = size * np.eye(n)
    y, nothing = np.tile(posture.y, (n, 1)), np.zeros((n, n))
    forward, backward = (tree.force(y, posture.m + by, nothing) for by in (moved, -moved))
    result: Array = ((backward - forward) / (2 * size)).T
    return result


def same_branch(tree: Tree) -> NDArray[np.bool_]:
    """Return which pairs of velocities belong to joints that carry one another, (nv, nv)."""
    mask = np.zeros((tree.nv, tree.nv), dtype=bool)
    for i, there in enumerate(tree.velocities):
        above = i
        while above != WORLD:
            mask[there, tree.velocities[above]] = mask[tree.velocities[above], there] = True
            above = tree.links[above].parent
    return mask
