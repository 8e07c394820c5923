"""Where the links of a loaded URDF are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from harness.engines.protocol import Array

BASE = -1
"""PyBullet's index of the link that all others hang on."""


def link_places(body: int) -> dict[str, int]:
    """Index of each link by `link:name`, and of its centre of mass by `centre:name`."""
    import pybullet as p

    names = {p.getBodyInfo(body)[0].decode(): BASE}
    names |= {p.getJointInfo(body, i)[12].decode(): i for i in range(p.getNumJoints(body))}
    return {f"{kind}:{name}": i for kind in ("link", "centre") for name, i in names.items()}


def link_poses(
    body: int, known: Mapping[str, int], places: Sequence[str]
) -> tuple[list[Array], list[Array]]:
    """Origins and rotations of places, as the joints are now; a centre has its link's axes.

    PyBullet tells a link's frame with seven digits, and that of its principal moments with all, in
    the world and in the link.
    """
    import pybullet as p

    origins, turns = [], []
    for place in places:
        link = known[place]
        if link == BASE:
            state = p.getBasePositionAndOrientation(body)
            state += p.getDynamicsInfo(body, BASE)[3:5]
        else:
            state = p.getLinkState(body, link, computeForwardKinematics=1)
        centre, inward = np.array(state[0]), np.array(state[2])
        turn = _matrix(np.array(state[1])) @ _matrix(np.array(state[3])).T
        origins.append(centre if place.startswith("centre:") else centre - turn @ inward)
        turns.append(turn)
    return origins, turns


def _matrix(quaternion: Array) -> Array:
    """Of a quaternion (x, y, z, w)."""
    x, y, z, w = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
