"""Motions of a loaded body: its joints' torques are set from the state before each step."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.protocol import Array, Force, StateForce
from physics_crosscheck.harness.engines.pybullet.ball import Ball
from physics_crosscheck.harness.engines.pybullet.base import Base
from physics_crosscheck.harness.engines.pybullet.poses import link_poses

ForceElement = tuple[list[tuple[int, float]], float, float, float]
"""A spring: coefficients by the joint's place among all, stiffness, damping, rest."""


class Stepper:
    """A body's slides and hinges, and what turns freely, whose coordinates come first.

    Args:
        body: PyBullet's number of it.
        joints: PyBullet's numbers of slides and hinges.
        turning: a base that floats, ball joints.
        springs: that the adapter adds as torques.
    """

    def __init__(
        self,
        body: int,
        joints: Sequence[int],
        turning: Sequence[Base | Ball],
        springs: Sequence[ForceElement],
    ) -> None:
        self._body, self._joints, self._springs = body, joints, springs
        ends = np.cumsum([0, *(one.count for one in turning)]).tolist()
        self._free = ends[-1]
        self._turning = [(one, slice(*at)) for one, at in zip(turning, pairwise(ends), strict=True)]

    def reset(self, q: Array, v: Array) -> None:
        """Put it into a state, (nz,) each."""
        import pybullet as p

        for one, at in self._turning:
            one.reset(q[at], v[at])
        for i, joint in enumerate(self._joints, start=self._free):
            p.resetJointState(self._body, joint, q[i], v[i])

    def poses(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """Origins (K, F, 3) and rotations (K, F, 3, 3) of places at positions z, (K, nz)."""
        if not self._turning:
            return link_poses(self._body, self._joints, places, z)
        found = []
        for row in z:
            for one, at in self._turning:
                one.reset(row[at], np.zeros(one.count))
            found.append(link_poses(self._body, self._joints, places, row[None, self._free :]))
        origins, turns = zip(*found, strict=True)
        return np.concatenate(origins), np.concatenate(turns)

    def run(self, b: int, n: int, force: Force, every: int, out_q: Array, out_v: Array) -> None:
        """Take n steps from where it is, under the forces of the batch's row b.

        `out_q` and `out_v` take positions and velocities after every `every` steps.
        """
        import pybullet as p

        body, joints, free = self._body, self._joints, self._free
        states, step = p.getJointStates, p.stepSimulation
        by_state = force if isinstance(force, StateForce) else None
        held: Any = force[b].tolist() if isinstance(force, np.ndarray) else None
        inputs: Any = by_state.inputs[b].tolist() if by_state is not None else None
        driven = bool(self._springs) or force is not None
        feedback = bool(self._springs) or by_state is not None
        current: Any = states(body, joints) if feedback and joints else ()
        still = [0.0] * (len(joints) + free)
        for i in range(n):
            if driven:
                if by_state is not None:
                    turned = [one.position() for one, _ in self._turning]
                    at = [*np.concatenate([[], *turned]), *(s[0] for s in current)]
                    self._push(list(by_state.at(at, inputs[i])), current)
                else:
                    self._push(list(held[i] if held is not None else still), current)
            step()
            sampled = (i + 1) % every == 0
            if (feedback or sampled) and joints:
                current = states(body, joints)
            if sampled:
                self._take(current, out_q[i // every], out_v[i // every])

    def _push(self, forces: list[float], current: Any) -> None:
        """Set what acts over the next step: forces on all coordinates, and the springs'."""
        import pybullet as p

        for one, at in self._turning:
            one.push(forces[at])
        tau = forces[self._free :]
        for terms, stiffness, damping, rest in self._springs:
            stretch, rate = -rest, 0.0
            for j, c in terms:
                stretch += c * current[j][0]
                rate += c * current[j][1]
            pull = stiffness * stretch + damping * rate
            for j, c in terms:
                tau[j] -= c * pull
        if tau:
            p.setJointMotorControlArray(self._body, self._joints, p.TORQUE_CONTROL, forces=tau)

    def _take(self, current: Any, q: Array, v: Array) -> None:
        """Write positions and velocities of now into rows, (nz,) each."""
        for one, at in self._turning:
            q[at] = one.position()
            v[at] = one.rates(q[at])
        for j, state in enumerate(current, start=self._free):
            q[j], v[j] = state[0], state[1]
