"""Springs and dampers on linear combinations of joints, as forces by state."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from physics_crosscheck.harness.engines.protocol import Array, EngineError, Spring


class SpringForces:
    """Forces of springs of a sidecar and of joints, along all joints.

    Args:
        springs: the declared springs.
        joints: names of the n joints, in the engine's order.
        place: the file, for messages.
        damping: of each joint, (n,), for engines that ignore it.
        pushed: constant forces on the joints, (n,), N or N m.

    Attributes:
        empty: whether there are no forces.

    Raises:
        EngineError: if a spring names something other than a moving joint.
    """

    def __init__(
        self,
        springs: Sequence[Spring],
        joints: Sequence[str],
        place: object,
        damping: Array | None = None,
        pushed: Array | None = None,
    ) -> None:
        along = np.zeros((len(springs), len(joints)))
        for row, spring in zip(along, springs, strict=True):
            for name, share in spring.joints.items():
                if name not in joints:
                    raise EngineError(
                        f"{place}: a spring names {name!r}, which is not a moving joint"
                    )
                row[joints.index(name)] += share
        k = np.array([one.stiffness for one in springs], dtype=float)
        c = np.array([one.damping for one in springs], dtype=float)
        rest = np.array([one.rest for one in springs], dtype=float)
        joint_damping = np.zeros(len(joints)) if damping is None else damping
        self._stiffness = along.T @ (k[:, None] * along)
        self._damping = along.T @ (c[:, None] * along) + np.diag(joint_damping)
        self._k, self._c = self._stiffness.diagonal(), self._damping.diagonal()
        self._apart = all(
            np.array_equal(np.diag(a.diagonal()), a) for a in (self._stiffness, self._damping)
        )
        push = np.zeros(len(joints)) if pushed is None else pushed
        self._at_zero = along.T @ (k * rest) + push
        self._joint_damping = None if springs or push.any() else joint_damping
        self.empty = self._joint_damping is not None and not joint_damping.any()

    def forces(self, q: Array, v: Array) -> Array:
        """Return forces along joints at positions and velocities, (..., n) each."""
        if self._joint_damping is not None:
            return -self._joint_damping * v
        if self._apart:
            apart: Array = self._at_zero - (self._k * q + self._c * v)
            return apart
        # Sum along the last axis: the last digits of a matrix product depend on the number of rows.
        contributions = self._stiffness * q[..., None, :] + self._damping * v[..., None, :]
        force: Array = self._at_zero - contributions.sum(axis=-1)
        return force
