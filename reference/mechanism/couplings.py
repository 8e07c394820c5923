"""Joint couplings: independent coordinates, and all coordinates as functions of them."""

from __future__ import annotations

import numpy as np

from .rotations import DOUBLES, Field, Scalars
from .tree import Tree, TreeCoupling, TreeError


class Coupled:
    """All coordinates of a tree, y = G x + c, as functions of the independent ones, x.

    Attributes:
        couplings: of the tree.
        kept: indices of x in y.
        matrix: G, (nv, kept).
        offset: c, (nv,).
    """

    def __init__(self, tree: Tree) -> None:
        rows = {tree.velocities[one.follower].start: one for one in tree.couplings}
        self.couplings = tree.couplings
        self.kept = [i for i in range(tree.nv) if i not in rows]
        self.matrix, self.offset = np.zeros((tree.nv, len(self.kept))), np.zeros(tree.nv)
        self.matrix[self.kept, range(len(self.kept))] = 1.0
        waiting = dict(rows)
        while waiting:
            ready = [
                i for i, one in waiting.items() if not _leaders(tree, one).keys() & waiting.keys()
            ]
            if not ready:
                names = ", ".join(tree.links[one.follower].name for one in waiting.values())
                raise TreeError(f"{names} follow each other in a cycle")
            for i in ready:
                self._follow(i, _leaders(tree, waiting.pop(i)), rows[i].offset)

    def _follow(self, i: int, leaders: dict[int, float], offset: float) -> None:
        self.offset[i] = offset
        for leader, multiplier in leaders.items():
            self.matrix[i] += multiplier * self.matrix[leader]
            self.offset[i] += multiplier * self.offset[leader]

    def positions(self, x: Scalars, field: Field = DOUBLES) -> Scalars:
        """Return y, (nv, ...), for x, (kept, ...)."""
        offset = field.array(self.offset).reshape(-1, *(1,) * (x.ndim - 1))
        result: Scalars = self.rates(x, field) + offset
        return result

    def rates(self, x: Scalars, field: Field = DOUBLES) -> Scalars:
        """Return G x for rates or accelerations."""
        result: Scalars = np.tensordot(field.array(self.matrix), x, 1)
        return result

    def forces(self, y: Scalars, field: Field = DOUBLES) -> Scalars:
        """Return G^T y: forces on all coordinates, projected onto the independent ones."""
        result: Scalars = np.tensordot(field.array(self.matrix.T), y, 1)
        return result

    def mass(self, whole: Scalars, field: Field = DOUBLES) -> Scalars:
        """Return G^T M G, (kept, kept, ...)."""
        half = np.tensordot(field.array(self.matrix.T), whole, 1)
        both = np.tensordot(half, field.array(self.matrix), ([1], [0]))
        result: Scalars = np.moveaxis(both, -1, 1)
        return result


def _leaders(tree: Tree, coupling: TreeCoupling) -> dict[int, float]:
    """Return the multipliers, by index of the leading coordinate."""
    return {tree.velocities[link].start: multiplier for link, multiplier in coupling.leaders}
