"""Limits, dry friction and compliant contacts in a convex problem in velocities after a step.

The impulse of a limit at distance g is p = max(0, (v_hat - v) / R), with v_hat = -g / (h + tau) and
R = max(s w, 1 / (h k (h + tau))), where w is the inverse inertia of its joint alone. Dampers act at
the step's end: (M + h D) (v - v*) = J^T p. As rows of `reference.laws.soft` these have a constant
impedance 1 / (1 + s).

Dry friction is F sign(v), or what stops the joint; with R = s w, where w is the inverse inertia
along its joint. It may act on M instead of M + h D.

A contact at depth x presses by k (x - h v_n) (1 - d v_n), where neither factor is negative. Its
friction is mu N0 v_t / sqrt(v_t^2 + e^2): N0 is the normal force that the velocity before the step
gives, and e the larger of a constant and mu s w h N0.

Sources: Castro, Permenter and Han, An unconstrained convex formulation of compliant contact (IEEE
T-RO 2022); Castro, Han and Masterjohn, A theory of irrotational contact fields (2023), lagged
model; Drake 1.51, sap_driver.cc, sap_limit_constraint.cc, sap_hunt_crossley_constraint.cc,
discrete_update_manager.cc and sap_model.cc; DART 6.20, JointCoulombFrictionConstraint.cpp.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.reference.mechanism.laws import (
    CompliantSurface,
    ContactPoint,
    Mixing,
    NearRigidRules,
    Softness,
)
from physics_crosscheck.reference.mechanism.numeric import Array
from .constraints import mixed_friction
from .drives import Driven
from .mechanics import Posture
from .soft import Kind, Part, Rows
from .step import DIGITS, LawModel, LawStep


def near_rigid_softness(rules: NearRigidRules) -> Softness:
    """Return the softness of a limit's rows, without the lower bound of R."""
    full, h = 1 / (1 + rules.share), rules.step
    return Softness(
        reference=(-full / (h * (h + rules.dissipation)), -full / h),
        impedance=(full, full, 0.0, 0.5, 1.0),
    )


class CompliantPoint(NamedTuple):
    """A contact at one state: a normal row and two of friction, as in `Rows.add_rate`.

    Attributes:
        start: index of the first row.
        step: s.
        elastic: normal force without dissipation at the step's start, N.
        stiffness: N/m.
        dissipation: s/m.
        sliding: largest friction, N.
        slow: slip velocity at which friction is at 0.7 of it, m/s.
    """

    start: int
    step: float
    elastic: float
    stiffness: float
    dissipation: float
    sliding: float
    slow: float

    @property
    def rows(self) -> NDArray[np.int_]:
        """Its rows, the normal one first, (1, 3)."""
        return self.start + np.arange(3)[None]

    def force(self, x: Array, _softness: Array) -> tuple[Array, Array]:
        """Return the forces, and minus their slopes by x, as in `RowBlock.force`."""
        h, k, d = self.step, self.stiffness, self.dissipation
        force, slope = np.zeros(3), np.zeros((3, 3))
        normal, slip = h * x[0, 0], h * x[0, 1:]
        pressed, damped = self.elastic - h * k * normal, 1 - d * normal
        if pressed > 0 and damped > 0:
            force[0], slope[0, 0] = pressed * damped, h * (h * k * damped + d * pressed)
        size = float(np.sqrt(slip @ slip + self.slow**2))
        along = slip / size
        force[1:] = -self.sliding * along
        slope[1:, 1:] = h * self.sliding / size * (np.eye(2) - np.outer(along, along))
        return force[None], slope[None]


def mix_compliant(
    first: CompliantSurface, other: CompliantSurface, mixing: Mixing
) -> CompliantSurface:
    """Return the numbers of a contact of two surfaces, whose springs are in series."""
    stiffness = first.stiffness + other.stiffness
    share = other.stiffness / stiffness if stiffness else 0.5
    return CompliantSurface(
        friction=mixed_friction(mixing, first.friction, other.friction),
        stiffness=first.stiffness * share,
        dissipation=share * first.dissipation + (1 - share) * other.dissipation,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class NearRigidStep(LawStep):
    """Forces at one state.

    Attributes:
        step: s.
    """

    step: float

    def uncertainty(self, a: Array, unbalanced: Array) -> Array:
        """Return the uncertainty of accelerations, (nv,), which are differences of velocities."""
        m = self.posture.m
        sizes = np.abs(m) + np.abs(m + self.step * a)
        rounding = DIGITS * np.finfo(float).eps * sizes / self.step
        result: Array = super().uncertainty(a, unbalanced) + rounding
        return result


@dataclass(frozen=True, kw_only=True, eq=False)
class NearRigidModel(LawModel):
    """A tree of slides and hinges, after an optional free root, without drives.

    Its limits are near-rigid and its contacts compliant.

    Attributes:
        rules: settings of the engine; its shapes are the bodies of `tree`.
    """

    rules: NearRigidRules

    def evaluate(
        self, posture: Posture, controls: Array, states: Array, contacts: Sequence[ContactPoint]
    ) -> NearRigidStep:
        """Evaluate the laws at a state; arguments as in `LawModel.evaluate`."""
        rows, nv = self.rows(posture, contacts), len(posture.m)
        return NearRigidStep(
            model=self,
            step=self.rules.step,
            posture=posture,
            problem=rows.problem(self._mass(posture), self._free(posture)),
            driven=Driven(
                forces=np.zeros(0), joint_forces=np.zeros(nv), states=states,
                clipped=frozenset(), damping=np.zeros((nv, nv)),
            ),
            parts=tuple(rows.parts),
        )  # fmt: skip

    def rows(self, posture: Posture, contacts: Sequence[ContactPoint]) -> Rows:
        """Return the rows of contacts, and of limits that a joint may meet within a step."""
        rules, mass = self.rules, self._mass(posture)
        rows = Rows(step=rules.step, safe=False, velocities=posture.m)
        after = posture.m + rules.step * self._free(posture)
        distances = rules.window * rules.step * np.maximum(np.abs(posture.m), np.abs(after))
        softest = rules.step * rules.stiffness * (rules.step + rules.dissipation)
        for i, limit in enumerate(self.laws.limits):
            place = self.tree.tree.velocities[limit.joint].start
            position, along = float(posture.y[place]), np.eye(len(posture.m))[place]
            for sign, bound in ((-1, limit.lower), (1, limit.upper)):
                distance = sign * (bound - position)
                if distance <= distances[place]:
                    weight = max(1 / float(mass[place, place]), 1 / (softest * rules.share))
                    rows.add(Kind.ONE_SIDED, -sign * along, limit.softness, distance, weight,
                             position=abs(position) + abs(bound),
                             part=Part("limit" if distance <= 0 else "next limit", i, sign),
                             )  # fmt: skip
        for i, friction in enumerate(self.laws.frictions):
            place = self.tree.tree.velocities[friction.joint].start
            rows.add_rate(
                Kind.FRICTION, np.eye(len(posture.m))[place], bound=friction.force,
                softness=rules.dry_friction_share * float(posture.inverse[place, place]),
                part=Part("dry friction", i),
            )  # fmt: skip
        axes = self._world_axes(posture)
        mobility = axes / np.diagonal(axes.T @ mass @ axes) @ axes.T
        for i, contact in enumerate(contacts):
            self._add_point(rows, posture, contact, mobility, Part("contact", i))
        return rows

    def _add_point(
        self, rows: Rows, posture: Posture, contact: ContactPoint, mobility: Array, part: Part
    ) -> None:
        """Add the rows of a contact.

        Args:
            rows, posture, contact: as in `rows`.
            mobility: inverse of the diagonal of M + h D along the axes of the world, (nv, nv); the
                law takes it for the whole inverse.
            part: that the rows belong to.
        """
        rules, h = self.rules, self.rules.step
        surface, touched = (self.laws.compliant[i] for i in contact.surfaces)
        pair = mix_compliant(surface, touched, self.laws.mixing)
        first, other = (posture.jacobian(i, contact.position) for i in contact.surfaces)
        jacobian = contact.frame @ (other[0] - first[0])
        weight = float(np.linalg.norm(jacobian @ mobility @ jacobian.T)) / 3
        depth, rate = max(0.0, -contact.distance), float(jacobian[0] @ posture.m)
        elastic = pair.stiffness * depth
        sliding = pair.friction * elastic * max(0.0, 1 - pair.dissipation * rate)
        rows.blocks.append(
            CompliantPoint(
                start=len(rows.kinds), step=h, elastic=elastic, stiffness=pair.stiffness,
                dissipation=pair.dissipation, sliding=sliding,
                slow=max(rules.slowest, rules.slip * weight * h * sliding),
            )
        )  # fmt: skip
        # A vector product has no term of equal axes: on a joint's axis an arm is exactly zero.
        lengths = np.abs(contact.position).sum() - np.abs(contact.position)
        arms = lengths @ (np.abs(first[1]) + np.abs(other[1]))
        # The largest friction has the rounding of the normal velocity.
        rates = pair.dissipation * float(np.abs(jacobian[0]) @ np.abs(posture.m))
        rounding = rates * pair.friction * elastic / sliding if sliding else 0.0
        sizes, shares = (depth / h**2, 0.0, 0.0), (0.0, rounding, rounding)
        for row, size, share in zip(jacobian, sizes, shares, strict=True):
            rows.add_rate(Kind.BLOCK, row, size=size, arms=arms + share * np.abs(row),
                          part=part)  # fmt: skip

    def _world_axes(self, posture: Posture) -> Array:
        """Return stored velocities by those along the axes of the world, (nv, nv)."""
        axes = np.eye(len(posture.m))
        for i, link in enumerate(self.tree.tree.links):
            if link.kind == "free":
                spin = self.tree.tree.velocities[i].start
                axes[spin : spin + 3, spin : spin + 3] = posture.poses[i].rotation.T
        return axes

    def _mass(self, posture: Posture) -> Array:
        """Return the mass matrix of constraint forces, (nv, nv): M + h D, or M."""
        return self._damped_mass(posture) if self.rules.damped_mass else posture.mass

    def _damped_mass(self, posture: Posture) -> Array:
        result: Array = posture.mass + self.rules.step * np.diag(self._joint_damping)
        return result

    def _free(self, posture: Posture) -> Array:
        """Return the accelerations without constraints, (nv,)."""
        free = np.linalg.solve(self._damped_mass(posture), posture.smooth)
        return np.asarray(free, dtype=np.float64)
