"""Poses of the links of a loaded URDF."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.harness.engines.pybullet.base import real_first
from physics_crosscheck.reference.mechanism.rotations import from_quaternion

BASE = -1
"""PyBullet's index of the root link."""


def link_places(body: int) -> dict[str, int]:
    """Return the index of each link by `link:name`, and of its centre of mass by `centre:name`."""
    import pybullet as p

    names = {p.getBodyInfo(body)[0].decode(): BASE}
    names |= {p.getJointInfo(body, i)[12].decode(): i for i in range(p.getNumJoints(body))}
    return {f"{kind}:{name}": i for kind in ("link", "centre") for name, i in names.items()}


def link_poses(
    body: int, joints: Sequence[int], places: Sequence[str], z: Array
) -> tuple[Array, Array]:
    """Return origins (K, F, 3) and rotations (K, F, 3, 3) of places at joint positions z, (K,
    nz).
    """
    import pybullet as p

    by_place = link_places(body)
    origins = np.empty((len(z), len(places), 3))
    turns = np.empty((*origins.shape, 3))
    for k, row in enumerate(z.tolist()):
        for joint, value in zip(joints, row, strict=True):
            p.resetJointState(body, joint, value, 0.0)
        for f, place in enumerate(places):
            origins[k, f], turns[k, f] = _pose(body, by_place[place], place.startswith("centre:"))
    return origins, turns


def _pose(body: int, link: int, centre: bool) -> tuple[Array, Array]:
    """Return a link's frame, or its centre of mass with the link's axes, at the current joint
    positions.

    PyBullet returns a link's frame with seven digits, but the frame of its principal axes with all,
    in the world and in the link.
    """
    import pybullet as p

    if link == BASE:
        state = p.getBasePositionAndOrientation(body) + p.getDynamicsInfo(body, BASE)[3:5]
    else:
        state = p.getLinkState(body, link, computeForwardKinematics=1)
    middle, inward = np.array(state[0]), np.array(state[2])
    turn = from_quaternion(real_first(state[1])) @ from_quaternion(real_first(state[3])).T
    return middle if centre else middle - turn @ inward, turn
