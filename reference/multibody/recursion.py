"""Equations of motion M(q) a = f(q, v) of a tree, by recursion along its links.

Featherstone, Rigid Body Dynamics Algorithms (2008): the recursive Newton-Euler algorithm (section
5.3) for the forces that velocities and gravity ask for, the composite-rigid-body algorithm (section
6.2) for the mass matrix. Accelerations of points are the usual ones, not the spatial ones, so that
every line can be read as mechanics; all in each link's own frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference.multibody.algebra import (
    DOUBLES,
    Field,
    Scalars,
    about_axis,
    cross,
    from_quaternion,
    product,
    quaternion_rate,
    turned,
    turned_back,
)
from reference.multibody.tree import WORLD, Link, Tree

INERTIAS = np.array([
    np.outer(one, other) + (np.outer(other, one) if k > 2 else 0)
    for k, (one, other) in enumerate(
        (np.eye(3)[i], np.eye(3)[j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    )
]).swapaxes(0, 1)  # fmt: skip
"""The matrices of which an inertia is a sum, xx, yy, zz, xy, xz, yz, (3, 6, 3): rows first."""


class Placement(NamedTuple):
    """A frame in another: its axes as columns, (3, 3, ...), and its origin, (3, ...)."""

    rotation: Scalars
    origin: Scalars


class Moving(NamedTuple):
    """Angular velocity of a link, and the velocity of its origin, (3, ...) each."""

    angular: Scalars
    linear: Scalars


Acting = tuple[Scalars, Scalars]
"""A force on a link, and its moment about the link's origin, (3, ...) each."""


@dataclass(frozen=True)
class _Constants:
    """A link's numbers, as those that are computed with; single ones are arrays (1,).

    Libraries of symbols have ideas of their own about a symbol times an array.
    """

    placement: Placement
    axis: Scalars
    turning: Scalars
    sliding: Scalars
    mass: Scalars
    armature: Scalars
    center: Scalars
    inertia: Scalars


class Recursion:
    """The equations of a tree over one kind of numbers.

    Positions are (nq, ...), velocities (nv, ...): the batch comes last.

    Args:
        tree: the links.
        field: the kind of numbers.
    """

    def __init__(self, tree: Tree, field: Field = DOUBLES) -> None:
        self.tree, self._field = tree, field
        self._links = [_constants(link, field) for link in tree.links]
        self._gravity = field.array(tree.gravity)

    def placements(self, q: Scalars) -> list[Placement]:
        """Each link's frame in its parent's."""
        rows = zip(self.tree.links, self._links, self.tree.positions, strict=True)
        return [self._placed(link.kind, one, q[here]) for link, one, here in rows]

    def poses(self, q: Scalars) -> list[Placement]:
        """Each link's frame in the world."""
        return self.poses_of(self.placements(q))

    def poses_of(self, placements: list[Placement]) -> list[Placement]:
        """The same, of each link's frame in its parent's."""
        found: list[Placement] = []
        for link, own in zip(self.tree.links, placements, strict=True):
            if link.parent == WORLD:
                found.append(own)
                continue
            base = found[link.parent]
            rotation = product(base.rotation, own.rotation)
            found.append(Placement(rotation, base.origin + turned(base.rotation, own.origin)))
        return found

    def rates(self, q: Scalars, v: Scalars) -> Scalars:
        """dq/dt, (nq, ...)."""
        parts = []
        rows = zip(self.tree.links, self.tree.positions, self.tree.velocities, strict=True)
        for link, here, there in rows:
            given, own = q[here], v[there]
            match link.kind:
                case "hinge" | "slide":
                    parts.append(own)
                case "ball":
                    parts.append(quaternion_rate(given, own))
                case "free":
                    parts.append(turned(from_quaternion(given[3:]), own[3:]))
                    parts.append(quaternion_rate(given[3:], own[:3]))
        return np.concatenate(parts)

    def mass(self, q: Scalars) -> Scalars:
        """The mass matrix, (nv, nv, ...), armatures included."""
        placements, tree = self.placements(q), self.tree
        bodies, batch = self._composites(placements), q.shape[1:]
        out = self._field.array(np.zeros((tree.nv, tree.nv, *batch)))
        felt = [_Columns.none(self._field, batch) for _ in tree.links]
        for i in reversed(range(len(tree.links))):
            one, rows = self._links[i], tree.velocities[i]
            own = bodies[i].momentum(one.turning, one.sliding, rows, batch)
            columns = felt[i].beside(own)
            found = self._felt(i, columns.force, columns.moment)
            out[rows, columns.which] = found
            out[columns.which, rows] = np.swapaxes(found, 0, 1)
            for k in range(rows.start, rows.stop):
                out[k, k] = (out[k, k] + one.armature).reshape(batch)
            if (parent := tree.links[i].parent) != WORLD:
                felt[parent] = felt[parent].beside(columns.carried(placements[i]))
        return out

    def bias(self, q: Scalars, v: Scalars, a: Scalars | None = None) -> Scalars:
        """Forces that the joints must give for accelerations `a`, of zero without, (nv, ...).

        Of bodies and gravity alone: no springs, dampers or armatures.
        """
        placements = self.placements(q)
        motions = self._motions(placements, v, a)
        forces = [own.asks(one) for own, one in zip(motions, self._links, strict=True)]
        return self.handed_down(placements, forces)

    def regressor(self, q: Scalars, v: Scalars, a: Scalars) -> Scalars:
        """What `bias` is times, in which it is linear: (nv, 10 links, ...).

        Of each link those are its mass, mass times center of mass (3), and inertia about its
        origin, xx, yy, zz, xy, xz, yz (Atkeson, An and Hollerbach 1986, Int. J. Robotics Research
        5(3)).
        """
        placements, tree = self.placements(q), self.tree
        out = self._field.array(np.zeros((tree.nv, 10 * len(tree.links), *v.shape[1:])))
        for i, motion in enumerate(self._motions(placements, v, a)):
            force, moment = motion.asks_each(self._field)
            at, columns = i, slice(10 * i, 10 * i + 10)
            while True:
                out[tree.velocities[at], columns] = self._felt(at, force, moment)
                if (parent := tree.links[at].parent) == WORLD:
                    break
                force, moment = _carried_down(placements[at], force, moment)
                at = parent
        return out

    def lift(self, q: Scalars) -> Scalars:
        """What acts on the joints because gravity does not pull on what is lifted, (nv, ...)."""
        batch, forces = q.shape[1:], list[Acting]()
        for link, pose in zip(self.tree.links, self.poses(q), strict=True):
            up = self._field.array([-link.lifted]) * _tall(self._gravity, batch)
            force = turned_back(pose.rotation, up + 0 * pose.origin)
            forces.append((force, cross(_tall(self._field.array(link.lift), batch), force)))
        return self.handed_down(self.placements(q), forces)

    def _motions(self, placements: list[Placement], v: Scalars, a: Scalars | None) -> list[_Motion]:
        """How each link moves, seen from what falls with gravity."""
        tree, batch = self.tree, v.shape[1:]
        still = self._field.array(np.zeros((3, *batch)))
        up = still - _tall(self._gravity, batch)
        found: list[_Motion] = []
        for i, (link, one) in enumerate(zip(tree.links, self._links, strict=True)):
            base = _Motion(still, still, up) if link.parent == WORLD else found[link.parent]
            there = tree.velocities[i]
            own = None if a is None else a[there]
            found.append(_carried(base, placements[i], one, v[there], own))
        return found

    def velocities(self, placements: list[Placement], v: Scalars) -> list[Moving]:
        """Of each link, in its own frame, (3, ...) each."""
        found: list[Moving] = []
        still = self._field.array(np.zeros((3, *v.shape[1:])))
        rows = zip(self.tree.links, self._links, placements, self.tree.velocities, strict=True)
        for link, one, here, there in rows:
            base = Moving(still, still) if link.parent == WORLD else found[link.parent]
            linear = turned_back(here.rotation, base.linear + cross(base.angular, here.origin))
            angular = turned_back(here.rotation, base.angular)
            found.append(
                Moving(
                    angular + np.tensordot(one.turning, v[there], 1),
                    linear + np.tensordot(one.sliding, v[there], 1),
                )
            )
        return found

    def handed_down(self, placements: list[Placement], forces: list[Acting]) -> Scalars:
        """What forces, and moments about origins, on the links do on the joints, (nv, ...).

        Args:
            placements: each link's frame in its parent's.
            forces: on each link, in its own frame, (3, ...) each; it is written over.
        """
        tree = self.tree
        out: list[Scalars] = [forces[0][0]] * len(tree.links)
        for i in reversed(range(len(tree.links))):
            force, moment = forces[i]
            out[i] = self._felt(i, force, moment)
            if (parent := tree.links[i].parent) != WORLD:
                force = turned(placements[i].rotation, force)
                moment = turned(placements[i].rotation, moment) + cross(placements[i].origin, force)
                forces[parent] = forces[parent][0] + force, forces[parent][1] + moment
        return np.concatenate(out)

    def _felt(self, link: int, force: Scalars, moment: Scalars) -> Scalars:
        """What a joint's velocities feel of a force and its moment about the link's origin."""
        one = self._links[link]
        found: Scalars = np.tensordot(one.turning.T, moment, 1)
        found = found + np.tensordot(one.sliding.T, force, 1)
        return found

    def _placed(self, kind: str, one: _Constants, q: Scalars) -> Placement:
        batch = q.shape[1:]
        base = one.placement
        rotation = base.rotation.reshape(3, 3, *(1,) * len(batch))
        origin = _tall(base.origin, batch)
        match kind:
            case "hinge":
                return Placement(product(rotation, about_axis(one.axis, q[0], self._field)), origin)
            case "slide":
                moved = turned(rotation, _tall(one.axis, batch)) * q[0]
                return Placement(rotation + 0 * q[0], origin + moved)
            case "ball":
                return Placement(product(rotation, from_quaternion(q)), origin)
        return Placement(
            product(rotation, from_quaternion(q[3:])), origin + turned(rotation, q[:3])
        )

    def _composites(self, placements: list[Placement]) -> list[_Body]:
        """Each link with all that it carries, in its own frame."""
        bodies = [
            _Body(one.mass, _tall(one.mass * one.center, here.origin.shape[1:]), self._about(one))
            for one, here in zip(self._links, placements, strict=True)
        ]
        for i in reversed(range(len(bodies))):
            if (parent := self.tree.links[i].parent) != WORLD:
                bodies[parent] = bodies[parent].with_(bodies[i].seen(placements[i], self._field))
        return [_widened(one, here) for one, here in zip(bodies, placements, strict=True)]

    def _about(self, one: _Constants) -> Scalars:
        """Inertia about the link's origin, (3, 3)."""
        c = one.center
        eye = self._field.array(np.eye(3))
        moved = (c * c).sum(keepdims=True) * eye - c[:, None] * c[None]
        found: Scalars = one.inertia + one.mass * moved
        return found


class _Body(NamedTuple):
    """Mass, its first moment (3, ...) and inertia (3, 3, ...), about a frame's origin."""

    mass: Scalars
    moment: Scalars
    inertia: Scalars

    def momentum(
        self, turning: Scalars, sliding: Scalars, rows: slice, batch: tuple[int, ...]
    ) -> _Columns:
        """Linear momentum, and angular momentum about the origin, of a joint's velocities."""
        ones = (1,) * len(batch)
        angular, linear = (part.reshape(3, -1, *ones) for part in (turning, sliding))
        first = self.moment[:, None]
        moment = product(self.inertia, angular) + cross(first, linear)
        force = self.mass * linear + cross(angular, first)
        shape = (3, angular.shape[1], *batch)
        which = np.arange(rows.start, rows.stop)
        return _Columns(np.broadcast_to(force, shape), np.broadcast_to(moment, shape), which)

    def seen(self, placed: Placement, field: Field) -> _Body:
        """The same from the frame in which its own is placed (Steiner)."""
        r, moment = placed.origin, turned(placed.rotation, self.moment)
        inertia = self.inertia.reshape(3, 3, *self.inertia.shape[2:] or (1,) * (r.ndim - 1))
        own = product(product(placed.rotation, inertia), np.swapaxes(placed.rotation, 0, 1))
        eye = field.array(np.eye(3)).reshape(3, 3, *(1,) * (r.ndim - 1))
        square = self.mass * (r * r).sum(axis=0) + 2 * (r * moment).sum(axis=0)
        mixed = r[:, None] * moment[None]
        whole = own + square * eye - self.mass * r[:, None] * r[None]
        return _Body(self.mass, moment + self.mass * r, whole - mixed - np.swapaxes(mixed, 0, 1))

    def with_(self, other: _Body) -> _Body:
        """Both together."""
        one = self.inertia
        inertia = one.reshape(3, 3, *(1,) * (other.inertia.ndim - 2)) if one.ndim == 2 else one
        return _Body(self.mass + other.mass, self.moment + other.moment, inertia + other.inertia)


class _Columns(NamedTuple):
    """What accelerations of some velocities, `which`, ask for at a link: (3, columns, ...) each."""

    force: Scalars
    moment: Scalars
    which: NDArray[np.intp]

    @staticmethod
    def none(field: Field, batch: tuple[int, ...]) -> _Columns:
        """Of no velocity."""
        empty = field.array(np.zeros((3, 0, *batch)))
        return _Columns(empty, empty, np.arange(0))

    def beside(self, other: _Columns) -> _Columns:
        """Both."""
        pairs = zip(self[:2], other[:2], strict=True)
        force, moment = (np.concatenate(pair, axis=1) for pair in pairs)
        return _Columns(force, moment, np.concatenate([self.which, other.which]))

    def carried(self, placed: Placement) -> _Columns:
        """The same at the frame in which the link's is placed."""
        return _Columns(*_carried_down(placed, self.force, self.moment), self.which)


class _Motion(NamedTuple):
    """Angular velocity and acceleration of a link, and acceleration of its origin."""

    angular: Scalars
    turning: Scalars
    linear: Scalars

    def asks(self, one: _Constants) -> tuple[Scalars, Scalars]:
        """Force, and moment about the origin, that move the link so (Newton, Euler)."""
        center = _tall(one.center, self.linear.shape[1:])
        w, dw = self.angular, self.turning
        force = one.mass * (self.linear + cross(dw, center) + cross(w, cross(w, center)))
        spin = np.tensordot(one.inertia, w, 1)
        return force, np.tensordot(one.inertia, dw, 1) + cross(w, spin) + cross(center, force)

    def asks_each(self, field: Field) -> tuple[Scalars, Scalars]:
        """The same of each of the ten numbers in which it is linear, (3, 10, ...)."""
        w, dw = self.angular[:, None], self.turning[:, None]
        eye = field.array(np.eye(3)).reshape(3, 3, *(1,) * (self.linear.ndim - 1))
        centers = cross(dw, eye) + cross(w, cross(w, eye))
        still, point = 0 * centers, self.linear[:, None]
        inertias = field.array(INERTIAS)
        spun = np.tensordot(inertias, self.angular, 1)
        moments = np.tensordot(inertias, self.turning, 1) + cross(w, spun)
        force = np.concatenate([point, centers, still, still], axis=1)
        return force, np.concatenate([0 * point, cross(eye, point), moments], axis=1)


def _carried(
    base: _Motion, here: Placement, one: _Constants, v: Scalars, a: Scalars | None
) -> _Motion:
    """The motion of a link that another one carries, its joint's velocities constant without a."""
    w, r = base.angular, here.origin
    carried = turned_back(here.rotation, w)
    turning, sliding = np.tensordot(one.turning, v, 1), np.tensordot(one.sliding, v, 1)
    point = base.linear + cross(base.turning, r) + cross(w, cross(w, r))
    angular = turned_back(here.rotation, base.turning) + cross(carried, turning)
    linear = turned_back(here.rotation, point) + cross(2 * carried + turning, sliding)
    if a is not None:
        angular = angular + np.tensordot(one.turning, a, 1)
        linear = linear + np.tensordot(one.sliding, a, 1)
    return _Motion(carried + turning, angular, linear)


def _carried_down(placed: Placement, force: Scalars, moment: Scalars) -> tuple[Scalars, Scalars]:
    """Columns of forces and moments, (3, columns, ...), at the frame in which the link's is."""
    force, moment = (product(placed.rotation, part) for part in (force, moment))
    return force, moment + cross(placed.origin[:, None], force)


def _constants(link: Link, field: Field) -> _Constants:
    turning, sliding = link.motion
    return _Constants(
        placement=Placement(field.array(link.rotation), field.array(link.position)),
        axis=field.array(link.axis),
        turning=field.array(turning),
        sliding=field.array(sliding),
        mass=field.array([link.mass]),
        armature=field.array([link.armature]),
        center=field.array(link.center),
        inertia=field.array(link.inertia),
    )


def _tall(vector: Scalars, batch: tuple[int, ...]) -> Scalars:
    """A vector (3,) beside a batch, (3, 1, ...)."""
    return vector.reshape(3, *(1,) * len(batch))


def _widened(body: _Body, here: Placement) -> _Body:
    """A body whose inertia may be one for the whole batch, beside a batch."""
    if body.inertia.ndim > 2 or here.origin.ndim == 1:
        return body
    return body._replace(inertia=body.inertia.reshape(3, 3, *(1,) * (here.origin.ndim - 1)))
