"""Forces along lengths: tendons, servos, polynomial springs of joints."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from physics_crosscheck.reference.dynamics.path_lengths import Lines
from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.mechanism.force_paths import CablePath, FrameForce, JointForce
from physics_crosscheck.reference.mechanism.rotations import DOUBLES, Field, Scalars
from physics_crosscheck.reference.mechanism.tree import Tree, TreeForce


class _Line(NamedTuple):
    """A force element's length, (1, ...), and its derivatives by slices of the velocities."""

    element: TreeForce
    length: Scalars
    columns: list[tuple[slice, Scalars]]

    def rate(self, v: Scalars) -> Scalars:
        """Return the rate of the length, (1, ...)."""
        result: Scalars = 0 * v[:1]
        for there, column in self.columns:
            result = result + (column * v[there]).sum(axis=0, keepdims=True)
        return result


class ForceElements:
    """The force elements of a tree over one number type; the batch is last.

    Args:
        tree: the links and force elements.
        recursion: the tree's kinematics over the same numbers.
        field: the number type, which must be ordered.
    """

    def __init__(self, tree: Tree, recursion: Recursion, field: Field = DOUBLES) -> None:
        self._tree, self._field = tree, field
        self._lines = Lines(tree, recursion, field)
        self._ways = [element.along for element in tree.pulls if element.along is not None]

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
        for element in self._tree.pulls:
            column = np.zeros(self._tree.nv)
            for i, share in element.joints:
                column[self._tree.velocities[i].start] += share
            out += element.armature * np.outer(column, column)
        return self._field.array(out)

    def stored(self, q: Scalars) -> Scalars:
        """Return the potential energy of springs and constant forces, joules, (...)."""
        energy: Scalars = 0 * q[0]
        for line in self._along(q):
            element, length = line.element, line.length
            if not _stores(element):
                continue
            energy = energy - (self._number(element.constant) * length).reshape(q.shape[1:])
            x = self._outside(element, length)
            for i, k in enumerate(element.stiffness, start=1):
                energy = energy + (self._number(k / (i + 1)) * x ** (i + 1)).reshape(q.shape[1:])
        return energy

    def dissipated(self, q: Scalars, v: Scalars) -> Scalars:
        """Return the power taken by dampers and non-conservative elements, watts, (...)."""
        power: Scalars = 0 * v[0]
        for line in self._along(q):
            rate = line.rate(v)
            lost = self._damped(line.element, rate) * rate
            if not _stores(line.element):
                lost = -self._force(line, v)
            power = power + (lost * rate).reshape(v.shape[1:])
        return power

    @property
    def nonsmooth(self) -> bool:
        """True if a spring has a dead band, a damper an even power, or a length a jump."""
        return any(
            _plays(element) or _turns(element) or _jumps(element) for element in self._tree.pulls
        )

    def switching_functions(self, q: Scalars, v: Scalars) -> Scalars:
        """Return quantities, (m, ...), that change sign where a force is not smooth.

        These are the deflections at the ends of dead bands, the rates of even-power dampers, and
        the cosines whose zeros make lengths jump.
        """
        values = [0 * v[:0]]
        for line in self._along(q) if self.nonsmooth else ():
            element = line.element
            if _plays(element):
                values += [line.length - self._number(end) for end in element.rest]
            if _turns(element):
                values.append(line.rate(v))
            if _jumps(element):
                assert isinstance(
                    element.along, (JointForce, FrameForce)
                )  # other paths have no angle
                values.append(self._lines.turning(element.along, q))
        return np.concatenate(values)

    def _along(self, q: Scalars) -> Iterator[_Line]:
        """Yield each element with its length."""
        lines = iter(self._lines.lines_of(self._ways, q) if self._ways else ())
        for element in self._tree.pulls:
            if element.along is not None:
                length, row = next(lines)
                yield _Line(element, length, [(slice(0, self._tree.nv), row)])
                continue
            length, columns = 0 * q[:1], []
            for i, share in element.joints:
                here, there = self._tree.positions[i], self._tree.velocities[i]
                column = self._number(share).reshape(1, *(1,) * (q.ndim - 1))
                length = length + column * q[here]
                columns.append((there, column))
            yield _Line(element, length, columns)

    def _force(self, line: _Line, v: Scalars) -> Scalars:
        """Return F, (1, ...)."""
        element, rate = line.element, line.rate(v)
        force = self._number(element.constant) - self._sprung(element, line.length)
        result: Scalars = force - self._damped(element, rate) * rate
        return result

    def _outside(self, element: TreeForce, length: Scalars) -> Scalars:
        low, high = element.rest
        if low == high:
            result: Scalars = length - self._number(low)
            return result
        over, under = length - self._number(high), length - self._number(low)
        both: Scalars = np.where(over > 0, over, np.where(under < 0, under, 0 * length))
        return both

    def _sprung(self, element: TreeForce, length: Scalars) -> Scalars:
        x, result = self._outside(element, length), 0 * length
        for k in reversed(element.stiffness):
            result = (result + self._number(k)) * x
        return result

    def _damped(self, element: TreeForce, rate: Scalars) -> Scalars:
        """Return the secant damping: the force per unit of rate."""
        result, size = 0 * rate, abs(rate) if len(element.damping) > 1 else rate
        for d in reversed(element.damping):
            result = result * size + self._number(d)
        return result

    def _number(self, value: float) -> Scalars:
        """Return a number as (1,), which broadcasts against every batch."""
        return self._field.array([value])


def _stores(element: TreeForce) -> bool:
    """Return whether an element is conservative: its force acts along its length."""
    return element.along is None or isinstance(element.along, CablePath)


def _jumps(element: TreeForce) -> bool:
    """Return whether the force depends on a rotation vector, which jumps at half a turn."""
    path = element.along
    if not element.stiffness or path is None or isinstance(path, CablePath):
        return False
    if isinstance(path, JointForce):
        return len(path.gear) == 3
    return path.against is not None and any(path.gear[3:])


def _plays(element: TreeForce) -> bool:
    """Return whether the spring has a dead band."""
    return bool(element.stiffness) and element.rest[0] != element.rest[1]


def _turns(element: TreeForce) -> bool:
    """Return whether the damper has even powers, such as w |w| and w |w|^3."""
    return any(element.damping[1::2])
