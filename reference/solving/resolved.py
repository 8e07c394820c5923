"""Segments of a tree whose numbers are others: where its equations take the same states.

States that tell numbers apart are chosen once, and solved once by two methods. Of a tree with other
numbers the same states tell as much, and its segments are near: Newton's method comes to them from
the ones that are known, with the linear problem that is known (`solving.flows`). So another draw
of a robot's numbers costs some recursions, and none of what the first one did.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.multibody import TreeSystem
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.tree import Tree
from physics_crosscheck.reference.solving.flows import Flow
from physics_crosscheck.reference.solving.integrate import ReferenceError
from physics_crosscheck.reference.solving.samples import Samples, rate_of, rounding_of, solved

QUICKER = 1.5
"""Up to this ratio of their rates one length suits both trees. Quicker ones get shorter segments,
and are solved by two methods as the first."""

STAGES = 6
"""Of the collocation, order 12: what it errs by is beyond rounding over a twentieth of the fastest
period. Order 8 was up to 1e-12 of the movement off."""

UNCERTAIN = 4.0
"""By how many times what it errs by for the known segments it may err for those of a draw."""


class Resolved:
    """Segments of a tree, and those of trees like it.

    Args:
        system: of the tree whose segments they are.
        known: these.

    Raises:
        ReferenceError: where the collocation doesn't come to the ends that are known.
    """

    def __init__(self, system: TreeSystem, known: Samples) -> None:
        self._system, self._known = system, known
        self._rate = rate_of(TreeEquations(system), known.start, known.forces)
        self._flow = Flow(system.tree, known.start, known.forces, known.length, STAGES)
        self._off: Array = np.max(np.abs(self._flow.end - known.end), axis=0)

    def at(self, tree: Tree) -> Samples:
        """The same states and forces; where another tree with the same joints takes them.

        Raises:
            ReferenceError: where it can't be solved.
        """
        known, equations = self._known, TreeEquations(replace(self._system, tree=tree))
        ratio = rate_of(equations, known.start, known.forces) / self._rate
        fastest = known.fastest * max(ratio, 1.0)
        length = known.length / (ratio if ratio > QUICKER else 1.0)
        if ratio <= QUICKER:
            try:
                return self._near(equations, fastest)
            except ReferenceError:  # it is not near
                pass
        return solved(equations, known.start, known.forces, length, fastest)

    def _near(self, equations: TreeEquations, fastest: float) -> Samples:
        known = self._known
        flow = self._flow.at(equations.system.tree)
        end = known.end + flow.apart(self._flow)
        rounded = rounding_of(equations, known.start, known.forces, end, known.length)
        bound = known.bound + UNCERTAIN * self._off + rounded
        return replace(known, end=end, bound=bound, fastest=fastest)
