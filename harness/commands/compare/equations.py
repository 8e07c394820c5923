"""Equations of a file's tree, in the coordinates of the engine that runs the file."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.harness.modelfiles.robot_system import names_of
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.couplings import Coupled
from physics_crosscheck.reference.mechanism.multibody import tree_system
from physics_crosscheck.reference.mechanism.tree import Tree
from physics_crosscheck.reference.solving.collocation import ReferenceError
from physics_crosscheck.reference.solving.samples import ends_of
from physics_crosscheck.reference.solving.segments import Segments

PIECES = (1, 8, 64)
"""Numbers of pieces that a run is divided into, tried until its equations can be solved."""


class FileEquations:
    """Equations of a tree whose n coordinates determine the nz coordinates of an engine.

    Attributes:
        equations: of the tree.
        kept: index of each of its coordinates among the engine's, (n,).
        matrix, offset: the engine's positions are `matrix @ q + offset`, (nz, n) and (nz,).
    """

    def __init__(self, tree: Tree, names: Sequence[str]) -> None:
        order, coupled = [names.index(name) for name in names_of(tree)], Coupled(tree)
        self.equations = TreeEquations(tree_system(name="", title="", source="", tree=tree))
        self.kept = np.array(order)[coupled.kept]
        self.matrix, self.offset = np.zeros((len(names), len(self.kept))), np.zeros(len(names))
        self.matrix[order], self.offset[order] = coupled.matrix, coupled.offset

    def expanded(self, states: Array) -> tuple[Array, Array]:
        """Return states (K, 2n) as the engine's positions and velocities, (K, nz) each."""
        n = len(self.kept)
        return states[:, :n] @ self.matrix.T + self.offset, states[:, n:] @ self.matrix.T

    def reduced(self, states: Array) -> Array:
        """Return the coordinates' states, (K, 2n), of the engine's, (K, 2nz)."""
        nz = len(self.offset)
        return states[:, [*self.kept, *(nz + i for i in self.kept)]]

    def accelerations(self, runs: Segments) -> Array:
        """Return accelerations at the starts of runs under their forces, (K, nz)."""
        start, n = self.reduced(runs.start), len(self.kept)
        forces = runs.start_inputs @ self.matrix
        pushed = self.equations.pushed_acceleration(start[:, :n], start[:, n:], forces)
        return pushed @ self.matrix.T

    def ends(self, runs: Segments) -> Array:
        """Return the end states of runs under forces on the engine's coordinates, (K, 2nz).

        They are not a number if the equations cannot be solved.
        """
        forces, start = runs.start_inputs @ self.matrix, self.reduced(runs.start)
        for pieces in PIECES:
            reached = start
            try:
                for _ in range(pieces):
                    reached = ends_of(self.equations, reached, forces, runs.length / pieces)
            except ReferenceError:
                continue
            return np.hstack(self.expanded(reached))
        return np.full((len(start), 2 * len(self.offset)), np.nan)
