"""Motions of a loaded body: its joints' torques are set from the state before each step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from harness.engines.protocol import Array, Force, StateForce
from harness.engines.pybullet.base import COUNT, Base
from harness.engines.pybullet.poses import link_poses

Pull = tuple[list[tuple[int, float]], float, float, float]
"""A spring: coefficients by the joint's place among all, stiffness, damping, rest."""


class Stepper:
    """A body's joints, and its base where that floats, whose coordinates come first.

    Args:
        body: PyBullet's number of it.
        joints: PyBullet's numbers of those that move.
        base: that floats, or None.
        springs: that the adapter adds as torques.
    """

    def __init__(
        self, body: int, joints: Sequence[int], base: Base | None, springs: Sequence[Pull]
    ) -> None:
        self._body, self._joints, self._base, self._springs = body, joints, base, springs
        self._free = COUNT if base else 0

    def reset(self, q: Array, v: Array) -> None:
        """Put it into a state, (nz,) each."""
        import pybullet as p

        if self._base:
            self._base.reset(q[: self._free], v[: self._free])
        for i, joint in enumerate(self._joints, start=self._free):
            p.resetJointState(self._body, joint, q[i], v[i])

    def poses(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """Origins (K, F, 3) and rotations (K, F, 3, 3) of places at positions z, (K, nz)."""
        if self._base is None:
            return link_poses(self._body, self._joints, places, z)
        found = []
        for row in z:
            self._base.reset(row[: self._free], np.zeros(self._free))
            found.append(link_poses(self._body, self._joints, places, row[None, self._free :]))
        origins, turns = zip(*found, strict=True)
        return np.concatenate(origins), np.concatenate(turns)

    def run(self, b: int, n: int, force: Force, every: int, out_q: Array, out_v: Array) -> None:
        """Take n steps from where it is, under the forces of the batch's row b.

        `out_q` and `out_v` take positions and velocities after every `every` steps.
        """
        import pybullet as p

        body, joints, base, free = self._body, self._joints, self._base, self._free
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
                    at = [*(base.position() if base else ()), *(s[0] for s in current)]
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

        if self._base:
            self._base.push(forces[: self._free])
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
        if self._base:
            q[: self._free] = self._base.position()
            v[: self._free] = self._base.rates(q[: self._free])
        for j, state in enumerate(current, start=self._free):
            q[j], v[j] = state[0], state[1]
