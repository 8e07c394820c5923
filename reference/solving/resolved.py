"""Segments of a tree with changed parameters, from the same states and forces.

Informative states are chosen once, and solved once by two methods. They stay informative for other
parameters, and the new segments are close to the known ones. Newton's method starts from the known
segments with the known Jacobian (`solving.flows`). Each further sample of parameters then costs
only a few recursions.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.multibody import TreeSystem
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.tree import Tree
from .flows import Flow
from .integrate import ReferenceError
from .samples import rate_of, rounding_of, solved
from .segments import Segments

MAX_RATE_RATIO = 1.5
"""Largest ratio of rates for which both trees share one segment length. Faster trees get shorter
segments, solved by two methods like the first."""

STAGES = 6
"""Stages of the collocation, order 12. Its error is below rounding over a twentieth of the fastest
period; order 8 had an error of up to 1e-12 of the movement."""

ERROR_FACTOR = 4.0
"""Factor from the collocation's error for the known segments to that for a sample."""


class ReusedSegments:
    """Segments of a tree, and those of trees with other parameters.

    Args:
        system: system of the tree.
        samples: its solved segments.

    Raises:
        ReferenceError: if the collocation does not reproduce the known ends.
    """

    def __init__(self, system: TreeSystem, samples: Segments) -> None:
        self._system, self._samples = system, samples
        self._rate = rate_of(TreeEquations(system), samples.start, samples.start_inputs)
        self._flow = Flow(system.tree, samples.start, samples.start_inputs, samples.length, STAGES)
        self._off: Array = np.max(np.abs(self._flow.end - samples.end), axis=0)

    def for_tree(self, tree: Tree) -> Segments:
        """Return the segments of another tree with the same joints, from the same states.

        Raises:
            ReferenceError: if they can't be solved.
        """
        samples, equations = self._samples, TreeEquations(replace(self._system, tree=tree))
        ratio = rate_of(equations, samples.start, samples.start_inputs) / self._rate
        fastest = samples.fastest * max(ratio, 1.0)
        length = samples.length / (ratio if ratio > MAX_RATE_RATIO else 1.0)
        if ratio <= MAX_RATE_RATIO:
            try:
                return self._near(equations, fastest)
            except ReferenceError:  # the tree is too different
                pass
        return solved(equations, samples.start, samples.start_inputs, length, fastest)

    def _near(self, equations: TreeEquations, fastest: float) -> Segments:
        samples = self._samples
        flow = self._flow.for_tree(equations.system.tree)
        end = samples.end + flow.apart(self._flow)
        rounded = rounding_of(equations, samples.start, samples.start_inputs, end, samples.length)
        bound = samples.bound + ERROR_FACTOR * self._off + rounded
        return replace(samples, end=end, bound=bound, fastest=fastest)
