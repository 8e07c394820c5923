"""Forces along lengths: tendons, servos, polynomial springs of joints."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from physics_crosscheck.reference.dynamics.path_lengths import Lines
from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.mechanism.force_paths import CablePath, FrameForce, JointForce
from physics_crosscheck.reference.mechanism.rotations import DOUBLES, Field, Scalars
from physics_crosscheck.reference.mechanism.tree import Pull, Tree


class _Line(NamedTuple):
    """A force element's length, (1, ...), and its derivatives by slices of the velocities."""

    pull: Pull
    length: Scalars
    columns: list[tuple[slice, Scalars]]

    def rate(self, v: Scalars) -> Scalars:
        """Return the rate of the length, (1, ...)."""
        found: Scalars = 0 * v[:1]
        for there, column in self.columns:
            found = found + (column * v[there]).sum(axis=0, keepdims=True)
        return found


class Pulls:
    """The force elements of a tree over one number type; the batch is last.

    Args:
        tree: the links and force elements.
        recursion: the tree's kinematics over the same numbers.
        field: the number type, which must be ordered.
    """

    def __init__(self, tree: Tree, recursion: Recursion, field: Field = DOUBLES) -> None:
        self._tree, self._field = tree, field
        self._lines = Lines(tree, recursion, field)
        self._ways = [pull.along for pull in tree.pulls if pull.along is not None]

    def __bool__(self) -> bool:
        """Return whether the tree has force elements."""
        return bool(self._tree.pulls)

    def forces(self, q: Scalars, v: Scalars) -> Scalars:
        """Return their forces on the joints, (nv, ...)."""
        out = 0 * v
        for line in self._along(q):
            force = self._force(line, v)
            for there, column in line.columns:
                out[there] = out[there] + column * force
        return out

    def mass(self) -> Scalars:
        """Return the mass matrix of their armatures, (nv, nv)."""
        out = np.zeros((self._tree.nv, self._tree.nv))
        for pull in self._tree.pulls:
            column = np.zeros(self._tree.nv)
            for i, share in pull.joints:
                column[self._tree.velocities[i].start] += share
            out += pull.armature * np.outer(column, column)
        return self._field.array(out)

    def stored(self, q: Scalars) -> Scalars:
        """Return the potential energy of springs and constant forces, joules, (...)."""
        found: Scalars = 0 * q[0]
        for line in self._along(q):
            pull, length = line.pull, line.length
            if not _stores(pull):
                continue
            found = found - (self._number(pull.constant) * length).reshape(q.shape[1:])
            x = self._outside(pull, length)
            for i, k in enumerate(pull.stiffness, start=1):
                found = found + (self._number(k / (i + 1)) * x ** (i + 1)).reshape(q.shape[1:])
        return found

    def dissipated(self, q: Scalars, v: Scalars) -> Scalars:
        """Return the power taken by dampers and non-conservative elements, watts, (...)."""
        found: Scalars = 0 * v[0]
        for line in self._along(q):
            rate = line.rate(v)
            lost = self._damped(line.pull, rate) * rate
            if not _stores(line.pull):
                lost = -self._force(line, v)
            found = found + (lost * rate).reshape(v.shape[1:])
        return found

    @property
    def bent(self) -> bool:
        """True if a spring has a dead band, a damper an even power, or a length a jump."""
        return any(_plays(pull) or _turns(pull) or _jumps(pull) for pull in self._tree.pulls)

    def bends(self, q: Scalars, v: Scalars) -> Scalars:
        """Return quantities, (m, ...), that change sign where a force is not smooth.

        These are the deflections at the ends of dead bands, the rates of even-power dampers, and
        the cosines whose zeros make lengths jump.
        """
        found = [0 * v[:0]]
        for line in self._along(q) if self.bent else ():
            pull = line.pull
            if _plays(pull):
                found += [line.length - self._number(end) for end in pull.rest]
            if _turns(pull):
                found.append(line.rate(v))
            if _jumps(pull):
                assert isinstance(pull.along, (JointForce, FrameForce))  # other paths have no angle
                found.append(self._lines.turning(pull.along, q))
        return np.concatenate(found)

    def _along(self, q: Scalars) -> Iterator[_Line]:
        """Yield each element with its length."""
        lines = iter(self._lines.at(self._ways, q) if self._ways else ())
        for pull in self._tree.pulls:
            if pull.along is not None:
                length, row = next(lines)
                yield _Line(pull, length, [(slice(0, self._tree.nv), row)])
                continue
            length, columns = 0 * q[:1], []
            for i, share in pull.joints:
                here, there = self._tree.positions[i], self._tree.velocities[i]
                column = self._number(share).reshape(1, *(1,) * (q.ndim - 1))
                length = length + column * q[here]
                columns.append((there, column))
            yield _Line(pull, length, columns)

    def _force(self, line: _Line, v: Scalars) -> Scalars:
        """Return F, (1, ...)."""
        pull, rate = line.pull, line.rate(v)
        force = self._number(pull.constant) - self._sprung(pull, line.length)
        found: Scalars = force - self._damped(pull, rate) * rate
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
        """Return the secant damping: the force per unit of rate."""
        found, size = 0 * rate, abs(rate) if len(pull.damping) > 1 else rate
        for d in reversed(pull.damping):
            found = found * size + self._number(d)
        return found

    def _number(self, value: float) -> Scalars:
        """Return a number as (1,), which broadcasts against every batch."""
        return self._field.array([value])


def _stores(pull: Pull) -> bool:
    """Return whether an element is conservative: its force acts along its length."""
    return pull.along is None or isinstance(pull.along, CablePath)


def _jumps(pull: Pull) -> bool:
    """Return whether the force depends on a rotation vector, which jumps at half a turn."""
    one = pull.along
    if not pull.stiffness or one is None or isinstance(one, CablePath):
        return False
    if isinstance(one, JointForce):
        return len(one.gear) == 3
    return one.against is not None and any(one.gear[3:])


def _plays(pull: Pull) -> bool:
    """Return whether the spring has a dead band."""
    return bool(pull.stiffness) and pull.rest[0] != pull.rest[1]


def _turns(pull: Pull) -> bool:
    """Return whether the damper has even powers, such as w |w| and w |w|^3."""
    return any(pull.damping[1::2])
