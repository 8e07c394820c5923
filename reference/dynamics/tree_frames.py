"""World poses of frames that are fixed to the links of a tree."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.mechanism.chart import MinimalCoordinates
from physics_crosscheck.reference.mechanism.couplings import Coupled
from physics_crosscheck.reference.mechanism.frames import ENTRIES
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.tree import WORLD, Tree


class TreeFrames:
    """Position and rotation of F frames as a function of a tree's independent coordinates.

    Args:
        tree: the links.
        names: the frames, of those that the tree has.
    """

    def __init__(self, tree: Tree, names: Sequence[str]) -> None:
        self._recursion, self._frames = Recursion(tree), [tree.frames[name] for name in names]
        self._coupled, self._chart = Coupled(tree), MinimalCoordinates(tree)

    def __call__(self, x: Array) -> Array:
        """Return the poses at K positions (K, n): (K, 12 F), as `frame_function` does."""
        links = self._recursion.poses(self._chart.positions(self._coupled.positions(x.T)))
        count = len(x)
        values = np.empty((count, len(self._frames), ENTRIES))
        for f, (link, place) in enumerate(self._frames):
            rotation, origin = np.eye(3)[None], np.zeros((1, 3))
            if link != WORLD:
                pose = links[link]
                rotation = np.moveaxis(np.broadcast_to(pose.rotation, (3, 3, count)), -1, 0)
                origin = np.moveaxis(np.broadcast_to(pose.origin, (3, count)), -1, 0)
            values[:, f, :3] = origin + rotation @ place.origin
            values[:, f, 3:] = (rotation @ place.rotation).reshape(-1, 9)
        return values.reshape(count, -1)
