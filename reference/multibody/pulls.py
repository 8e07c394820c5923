"""Forces along lengths that are combinations of joints' positions: tendons, servos, polynomials."""

from __future__ import annotations

import numpy as np

from reference.multibody.algebra import DOUBLES, Field, Scalars
from reference.multibody.tree import Pull, Tree


class Pulls:
    """What the pulls of a tree do, over one kind of numbers; the batch comes last.

    Args:
        tree: the links, with pulls.
        field: the kind of numbers, with an order.
    """

    def __init__(self, tree: Tree, field: Field = DOUBLES) -> None:
        self._tree, self._field = tree, field

    def __bool__(self) -> bool:
        """Whether there are any."""
        return bool(self._tree.pulls)

    def forces(self, q: Scalars, v: Scalars) -> Scalars:
        """On the joints, (nv, ...)."""
        out = 0 * v
        for pull in self._tree.pulls:
            length = self._along(pull, q, [here.start for here in self._tree.positions])
            rate = self._along(pull, v, [there.start for there in self._tree.velocities])
            force = self._number(pull.constant) - self._sprung(pull, length)
            force = force - self._damped(pull, rate) * rate
            for i, share in pull.joints:
                at = self._tree.velocities[i].start
                out[at] = out[at] + (self._number(share) * force).reshape(v.shape[1:])
        return out

    def mass(self) -> Scalars:
        """Of armatures, (nv, nv)."""
        out = np.zeros((self._tree.nv, self._tree.nv))
        for pull in self._tree.pulls:
            column = np.zeros(self._tree.nv)
            for i, share in pull.joints:
                column[self._tree.velocities[i].start] += share
            out += pull.armature * np.outer(column, column)
        return self._field.array(out)

    def stored(self, q: Scalars) -> Scalars:
        """Potential energy of the springs, less what the constants have done, joules, (...)."""
        found: Scalars = 0 * q[0]
        for pull in self._tree.pulls:
            length = self._along(pull, q, [here.start for here in self._tree.positions])
            found = found - (self._number(pull.constant) * length).reshape(q.shape[1:])
            x = self._outside(pull, length)
            for i, k in enumerate(pull.stiffness, start=1):
                found = found + (self._number(k / (i + 1)) * x ** (i + 1)).reshape(q.shape[1:])
        return found

    def dissipated(self, v: Scalars) -> Scalars:
        """Power that the dampers take, watts, (...)."""
        found: Scalars = 0 * v[0]
        for pull in self._tree.pulls:
            rate = self._along(pull, v, [there.start for there in self._tree.velocities])
            found = found + (self._damped(pull, rate) * rate * rate).reshape(v.shape[1:])
        return found

    @property
    def bent(self) -> bool:
        """Whether there is a spring with play, or a damper with an even power."""
        return any(_plays(pull) or _turns(pull) for pull in self._tree.pulls)

    def bends(self, q: Scalars, v: Scalars) -> Scalars:
        """Lengths beyond the ends of play, and the rates of dampers that turn, (m, ...)."""
        found = [0 * v[:0]]
        for pull in self._tree.pulls:
            if _plays(pull):
                length = self._along(pull, q, [here.start for here in self._tree.positions])
                found += [length - self._number(end) for end in pull.rest]
            if _turns(pull):
                found.append(self._along(pull, v, [there.start for there in self._tree.velocities]))
        return np.concatenate(found)

    def _along(self, pull: Pull, x: Scalars, starts: list[int]) -> Scalars:
        """The combination of positions or of velocities, (1, ...)."""
        found: Scalars = 0 * x[:1]
        for i, share in pull.joints:
            found = found + self._number(share) * x[starts[i] : starts[i] + 1]
        return found

    def _outside(self, pull: Pull, length: Scalars) -> Scalars:
        low, high = pull.rest
        if low == high:
            found: Scalars = length - self._number(low)
            return found
        over, under = length - self._number(high), length - self._number(low)
        both: Scalars = np.where(over > 0, over, np.where(under < 0, under, 0 * length))
        return both

    def _sprung(self, pull: Pull, length: Scalars) -> Scalars:
        x, found = self._outside(pull, length), 0 * length
        for k in reversed(pull.stiffness):
            found = (found + self._number(k)) * x
        return found

    def _damped(self, pull: Pull, rate: Scalars) -> Scalars:
        """By which the rate is to be multiplied."""
        found, size = 0 * rate, abs(rate) if len(pull.damping) > 1 else rate
        for d in reversed(pull.damping):
            found = found * size + self._number(d)
        return found

    def _number(self, value: float) -> Scalars:
        """(1,): it broadcasts against every batch."""
        return self._field.array([value])


def _plays(pull: Pull) -> bool:
    """Whether its spring begins to pull somewhere."""
    return bool(pull.stiffness) and pull.rest[0] != pull.rest[1]


def _turns(pull: Pull) -> bool:
    """Whether its damper has a power that is not smooth where it turns: w |w|, w |w|^3, ..."""
    return any(pull.damping[1::2])
