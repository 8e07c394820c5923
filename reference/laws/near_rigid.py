"""Joint limits as near-rigid rows of a convex problem in the velocities after a step.

The impulse of a limit at distance g is p = max(0, (v_hat - v) / R), with v_hat = -g / (h + tau) and
R = max(s w, 1 / (h k (h + tau))), where w is the inverse inertia of its joint alone. Dampers act at
the step's end: (M + h D) (v - v*) = J^T p. As rows of `reference.laws.soft` these have a constant
impedance 1 / (1 + s). Sources: Castro, Permenter and Han, An unconstrained convex formulation of
compliant contact (IEEE T-RO 2022); Drake 1.51, sap_driver.cc, sap_limit_constraint.cc and
sap_model.cc.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from physics_crosscheck.reference.laws.drives import Driven
from physics_crosscheck.reference.laws.mechanics import Posture
from physics_crosscheck.reference.laws.soft import Kind, Part, Rows
from physics_crosscheck.reference.laws.step import LawModel, LawStep
from physics_crosscheck.reference.mechanism.laws import ContactPoint, NearRigidRules, Softness
from physics_crosscheck.reference.mechanism.numeric import Array


def near_rigid_softness(rules: NearRigidRules) -> Softness:
    """Return the softness of a limit's rows, without the lower bound of R."""
    full, h = 1 / (1 + rules.share), rules.step
    return Softness(
        reference=(-full / (h * (h + rules.dissipation)), -full / h),
        impedance=(full, full, 0.0, 0.5, 1.0),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class NearRigidModel(LawModel):
    """A tree of slides and hinges whose limits are near-rigid; it has no drives and no contacts.

    Attributes:
        rules: settings of the engine.
    """

    rules: NearRigidRules

    def evaluate(
        self, posture: Posture, controls: Array, states: Array, contacts: Sequence[ContactPoint]
    ) -> LawStep:
        """Evaluate the laws at a state; arguments as in `LawModel.evaluate`."""
        rows, nv = self.rows(posture, contacts), len(posture.m)
        return LawStep(
            posture=posture,
            problem=rows.problem(self._mass(posture), self._free(posture)),
            driven=Driven(
                forces=np.zeros(0), joint_forces=np.zeros(nv), states=states,
                clipped=frozenset(), damping=np.zeros((nv, nv)),
            ),
            parts=tuple(rows.parts),
            contacts=0,
        )  # fmt: skip

    def rows(self, posture: Posture, contacts: Sequence[ContactPoint]) -> Rows:
        """Return the rows of limits that a joint may meet within a step."""
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
        return rows

    def _mass(self, posture: Posture) -> Array:
        """Return M + h D, (nv, nv)."""
        result: Array = posture.mass + self.rules.step * np.diag(self._joint_damping)
        return result

    def _free(self, posture: Posture) -> Array:
        """Return the accelerations without limits, (nv,)."""
        return np.asarray(np.linalg.solve(self._mass(posture), posture.smooth), dtype=np.float64)
