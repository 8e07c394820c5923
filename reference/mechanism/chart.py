"""Minimal coordinates of a tree, one per degree of freedom, with velocities as their rates.

A rotation has the coordinates p = 4 tan(angle/4) axis (see `rotations`). A free joint adds the
position of its origin in the joint's frame.

Generalized forces here are not conjugate to these coordinates. They are the forces that engines
hold constant: a moment about the link's axes, and a force along the joint's axes.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from .rotations import (
    DOUBLES,
    Field,
    Scalars,
    angular_velocity,
    coordinate_rate,
    cross,
    exponential,
    exponential_rate,
    from_quaternion,
    minimal_coordinates,
    place_names,
    quaternion_product,
    raw_quaternion,
    rotate,
    rotate_back,
    rotation_names,
    unit_quaternion,
)
from .tree import Kind, Tree, TreeCoupling, TreeError


def coordinate_names(kind: Kind, joint: str) -> tuple[tuple[str, str], ...]:
    """Return names and units of a joint's coordinates, in the order of its velocities."""
    turning = tuple((name, "rad") for name in rotation_names(joint))
    match kind:
        case "hinge":
            return ((joint, "rad"),)
        case "slide":
            return ((joint, "m"),)
        case "ball":
            return turning
    return (*turning, *((name, "m") for name in place_names(joint)))


class _Joint(NamedTuple):
    """Slices of a ball or free joint in q (`place`, `quaternion`) and y (`turning`, `moving`)."""

    place: slice
    quaternion: slice
    turning: slice
    moving: slice


class MinimalCoordinates:
    """Positions y and rates of a tree's minimal coordinates, each (nv, ...); the batch is last.

    Args:
        tree: the links.
        field: the number type.
    """

    def __init__(self, tree: Tree, field: Field = DOUBLES) -> None:
        self._tree, self._field = tree, field
        self._joints = list(_joints(tree))
        self._free = [one for one in self._joints if one.moving.stop > one.moving.start]
        self._plain = [
            (here, there)
            for link, here, there in zip(tree.links, tree.positions, tree.velocities, strict=True)
            if link.kind in ("hinge", "slide")
        ]

    @property
    def plain(self) -> bool:
        """True if y equals the tree's own q: all joints are hinges or slides."""
        return not self._joints

    def positions(self, y: Scalars) -> Scalars:
        """Return the tree's q, (nq, ...), with quaternions of any length."""
        if self.plain:
            return y
        q = self._field.array(np.zeros((self._tree.nq, *y.shape[1:])))
        for here, there in self._plain:
            q[here] = y[there]
        for joint in self._joints:
            q[joint.quaternion] = raw_quaternion(y[joint.turning])
            q[joint.place] = y[joint.moving]
        return q

    def velocities(self, y: Scalars, rate: Scalars) -> Scalars:
        """Return the tree's v."""
        return self.tree_velocities(y, self.stored_velocities(y, rate))

    def rates(self, y: Scalars, v: Scalars) -> Scalars:
        """Return the coordinate rates for the tree's v."""
        return self.to_joint_axes(y, self.rates_of_stored(y, v))

    def second_derivatives(self, y: Scalars, v: Scalars, a: Scalars) -> Scalars:
        """Return the second derivatives of the coordinates for the tree's v and its derivative."""
        return self.rates(y, a) + self._turning(y, v)

    def accelerations(self, y: Scalars, v: Scalars, second: Scalars) -> Scalars:
        """Return the derivative of the tree's v that gives these second derivatives."""
        return self.velocities(y, second - self._turning(y, v))

    def _turning(self, y: Scalars, v: Scalars) -> Scalars:
        """Return the second derivatives of the coordinates at constant v."""
        out = 0 * v
        for joint in self._joints:
            s, angular = y[joint.turning] / 4, v[joint.turning]
            ds = coordinate_rate(y[joint.turning], angular) / 4
            along, across = (s * angular).sum(axis=0), (ds * angular).sum(axis=0)
            out[joint.turning] = (
                2 * (ds * along + s * across - (s * ds).sum(axis=0) * angular)
                + 2 * cross(ds, angular)
            )  # fmt: skip
        for joint in self._free:
            transport = cross(v[joint.turning], v[joint.moving])
            out[joint.moving] = rotate(self._turn(y, joint), transport)
        return out

    def stored_velocities(self, y: Scalars, rate: Scalars) -> Scalars:
        """Return the velocities that engines store: angular velocity replaces the rate of p."""
        out = rate.copy()
        for joint in self._joints:
            out[joint.turning] = angular_velocity(y[joint.turning], rate[joint.turning])
        return out

    def rates_of_stored(self, y: Scalars, m: Scalars) -> Scalars:
        """Return the coordinate rates for the velocities that engines store."""
        out = m.copy()
        for joint in self._joints:
            out[joint.turning] = coordinate_rate(y[joint.turning], m[joint.turning])
        return out

    def frame_acceleration(self, y: Scalars, m: Scalars) -> Scalars:
        """Return the derivative of the tree's v at constant m, caused by rotating link axes."""
        v, out = self.tree_velocities(y, m), 0 * m
        for joint in self._free:
            out[joint.moving] = -cross(v[joint.turning], v[joint.moving])
        return out

    def tree_velocities(self, y: Scalars, m: Scalars) -> Scalars:
        """Return the tree's v for the velocities that engines store."""
        out = m.copy()
        self._place(out, y, m, rotate_back)
        return out

    def exponential_rate(self, moved: Scalars, m: Scalars) -> Scalars:
        """Return m as the rate of the rotation vectors, after displacements `moved`, (nv, ...)."""
        out = m.copy()
        for joint in self._joints:
            out[joint.turning] = exponential_rate(moved[joint.turning], m[joint.turning])
        return out

    def advance(self, y: Scalars, m: Scalars, h: float) -> Scalars:
        """Return the coordinates after h seconds at constant m; each rotation has a fixed axis."""
        out = y + h * m
        for joint in self._joints:
            before = unit_quaternion(y[joint.turning])
            after = quaternion_product(before, exponential(h * m[joint.turning]))
            out[joint.turning] = minimal_coordinates(after, before)
        return out

    def forces(self, y: Scalars, coordinate_forces: Scalars) -> Scalars:
        """Return forces on the tree's velocities for forces on the coordinates."""
        out = coordinate_forces.copy()
        self._place(out, y, coordinate_forces, rotate_back)
        return out

    def to_joint_axes(self, y: Scalars, values: Scalars) -> Scalars:
        """Rotate velocities or forces of free joints from the link's axes to the joint's.

        `values` are (nv, ...), with the axes of `y` last.
        """
        out = values.copy()
        self._place(out, y, values, rotate)
        return out

    def _place(
        self, out: Scalars, y: Scalars, values: Scalars, way: Callable[[Scalars, Scalars], Scalars]
    ) -> None:
        """Rotate the linear part of free joints between the link's axes and the joint's."""
        for joint in self._free:
            out[joint.moving] = way(self._turn(y, joint), values[joint.moving])

    def _turn(self, y: Scalars, joint: _Joint) -> Scalars:
        return from_quaternion(raw_quaternion(y[joint.turning]))


def _joints(tree: Tree) -> Iterator[_Joint]:
    for link, here, there in zip(tree.links, tree.positions, tree.velocities, strict=True):
        if link.kind in ("ball", "free"):
            yield _Joint(
                place=slice(here.start, here.stop - 4),
                quaternion=slice(here.stop - 4, here.stop),
                turning=slice(there.start, there.start + 3),
                moving=slice(there.start + 3, there.stop),
            )


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
