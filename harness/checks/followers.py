"""Map between a tree's coordinates and an engine's, including mimic joints."""

from __future__ import annotations

from dataclasses import dataclass

from physics_crosscheck.harness.numerics.coordinates import CoordinateMap, linear
from physics_crosscheck.reference.mechanism.chart import Coupled, coordinate_names
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.tree import Tree


@dataclass(frozen=True, kw_only=True)
class Followers:
    """The joint positions of an engine as a linear function of a tree's coordinates: G q + c.

    Attributes:
        names: names of all joints of the engine, (nz,).
        matrix: G, (nz, n).
        offset: c, (nz,).
    """

    names: tuple[str, ...]
    matrix: Array
    offset: Array

    @staticmethod
    def build(tree: Tree) -> Followers:
        """Build the map to all joints of a tree."""
        coupled = Coupled(tree)
        rows = (row for link in tree.links for row in coordinate_names(link.kind, link.name))
        names = tuple(name for name, _ in rows)
        return Followers(names=names, matrix=coupled.matrix, offset=coupled.offset)

    def map(self, order: list[int], names: tuple[str, ...]) -> CoordinateMap:
        """Build the map from the coordinates, by name, to an engine's, in the engine's order."""
        engine_names = [self.names[i] for i in order]
        kept = [engine_names.index(name) for name in names]
        return linear(self.matrix[order], self.offset[order], kept)
