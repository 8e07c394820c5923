"""Equations of motion M(q) a = f(q, v) of a tree, by recursion along its links.

Source: Featherstone, Rigid Body Dynamics Algorithms (2008). The bias force comes from the recursive
Newton-Euler algorithm (section 5.3), the mass matrix from the composite-rigid-body algorithm
(section 6.2). Accelerations of points are the usual ones, not the spatial ones. All quantities are
in each link's own frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np

from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import (
    DOUBLES,
    Field,
    Scalars,
    cross,
    from_quaternion,
    product,
    quaternion_rate,
    rotate,
    rotate_back,
    turned_by,
    weighted,
)
from physics_crosscheck.reference.mechanism.tree import WORLD, Tree, TreeLink
from .propagation import (
    Acting,
    Composite,
    LinkMotion,
    LinkNumbers,
    Moving,
    Placement,
    WrenchColumns,
    carried_down,
    numbers_of,
    tall,
    widened,
)


class Trace(NamedTuple):
    """Quantities of each link at a state, of one recursion.

    Attributes:
        links: the links of the tree.
        placements, motions, wrenches: frame in the parent's, motion, and wrench that causes it.
        passed: force and moment on the parent, in its frame.
        forces: joint forces, (size of the velocity, ...) each.
    """

    links: Sequence[TreeLink]
    placements: list[Placement]
    motions: list[LinkMotion]
    wrenches: list[Acting]
    passed: list[Acting]
    forces: list[Scalars]


class Recursion:
    """The equations of a tree over one number type.

    Positions are (nq, ...), velocities (nv, ...); the batch is last.

    Args:
        tree: the links.
        field: the number type.
        like: recursion of a tree that shares links with this one; None: of no such tree.
    """

    def __init__(self, tree: Tree, field: Field = DOUBLES, like: Recursion | None = None) -> None:
        self.tree, self._field = tree, field
        same = dict(zip(like.tree.links, like._links, strict=True)) if like else {}
        self._links: list[LinkNumbers] = [
            same.get(link) or numbers_of(link, field) for link in tree.links
        ]
        self._gravity = field.array(tree.gravity)

    def placements(self, q: Scalars) -> list[Placement]:
        """Return each link's frame in its parent's."""
        rows = zip(self.tree.links, self._links, self.tree.positions, strict=True)
        return [self._placed(link, one, q[here]) for link, one, here in rows]

    def poses(self, q: Scalars) -> list[Placement]:
        """Return each link's frame in the world."""
        return self.poses_of(self.placements(q))

    def poses_of(self, placements: list[Placement]) -> list[Placement]:
        """Return each link's frame in the world, from the frames in the parents."""
        poses: list[Placement] = []
        for link, placement in zip(self.tree.links, placements, strict=True):
            if link.parent == WORLD:
                poses.append(placement)
                continue
            base = poses[link.parent]
            rotation = product(base.rotation, placement.rotation)
            poses.append(Placement(rotation, base.origin + rotate(base.rotation, placement.origin)))
        return poses

    def rates(self, q: Scalars, v: Scalars) -> Scalars:
        """Return dq/dt, (nq, ...)."""
        parts = []
        rows = zip(self.tree.links, self.tree.positions, self.tree.velocities, strict=True)
        for link, here, there in rows:
            given, velocity = q[here], v[there]
            match link.kind:
                case "hinge" | "slide":
                    parts.append(velocity)
                case "ball":
                    parts.append(quaternion_rate(given, velocity))
                case "free":
                    parts.append(rotate(from_quaternion(given[3:]), velocity[3:]))
                    parts.append(quaternion_rate(given[3:], velocity[:3]))
        return np.concatenate(parts)

    def mass(self, q: Scalars, placements: list[Placement] | None = None) -> Scalars:
        """Return the mass matrix, (nv, nv, ...), armatures included.

        Args:
            q: positions.
            placements: each link's frame in its parent's; None: computed here.
        """
        placements, tree = placements or self.placements(q), self.tree
        bodies, batch = self._composites(placements), q.shape[1:]
        out = self._field.array(np.zeros((tree.nv, tree.nv, *batch)))
        columns_at = [WrenchColumns.none(self._field, batch) for _ in tree.links]
        for i in reversed(range(len(tree.links))):
            link, rows = self._links[i], tree.velocities[i]
            joint_columns = bodies[i].momentum(link.turning, link.sliding, rows, batch)
            columns = columns_at[i].joined(joint_columns)
            block = self._joint_force(i, columns.force, columns.moment)
            out[rows, columns.which] = block
            out[columns.which, rows] = np.swapaxes(block, 0, 1)
            for k in range(rows.start, rows.stop):
                out[k, k] = (out[k, k] + link.armature).reshape(batch)
            if (parent := tree.links[i].parent) != WORLD:
                columns_at[parent] = columns_at[parent].joined(columns.in_parent(placements[i]))
        return out

    def bias(
        self,
        q: Scalars,
        v: Scalars,
        a: Scalars | None = None,
        placements: list[Placement] | None = None,
    ) -> Scalars:
        """Return joint forces for accelerations `a`, by default 0: the bias force, (nv, ...).

        It includes bodies and gravity only, without springs, dampers or armatures.

        Args:
            q, v, a: state and accelerations.
            placements: each link's frame in its parent's; None: computed here.
        """
        placements = placements or self.placements(q)
        motions = self.motions(placements, v, a)
        forces = [motion.wrench(link) for motion, link in zip(motions, self._links, strict=True)]
        return self.propagate(placements, forces)

    def trace(self, q: Scalars, v: Scalars, a: Scalars, before: Trace | None = None) -> Trace:
        """Return the joint forces of `bias`, with the quantities of each link.

        Args:
            q, v, a: state and accelerations.
            before: of a tree with the same kinds of joints and gravity, at the same state. Only
                links that differ from its links, their descendants and ancestors are computed.
        """
        links = self.tree.links
        same = [before is not None and one is before.links[i] for i, one in enumerate(links)]
        parts = [[None] * len(links)] * 5 if before is None else before[1:]
        placements, motions, wrenches, passed, forces = (list[Any](part) for part in parts)
        moved = set[int]()
        for i, link in enumerate(links):
            if not same[i]:
                here = q[self.tree.positions[i]]
                placements[i] = self._placed(link, self._links[i], here)
            if not same[i] or link.parent in moved:
                moved.add(i)
                motions[i] = self._motion(i, placements, motions, v, a)
                wrenches[i] = motions[i].wrench(self._links[i])
        carriers = set(moved)
        for i in reversed(range(len(links))):
            carriers |= {links[i].parent} if i in carriers else set()
        total = {i: wrenches[i] for i in carriers - {WORLD}}
        for i in reversed(range(len(links))):
            if i in total:
                forces[i] = self._joint_force(i, *total[i])
                passed[i] = _passed(placements[i], *total[i])
            if (parent := links[i].parent) in total:
                total[parent] = total[parent][0] + passed[i][0], total[parent][1] + passed[i][1]
        return Trace(links, placements, motions, wrenches, passed, forces)

    def regressor(self, q: Scalars, v: Scalars, a: Scalars) -> Scalars:
        """Return the regressor of `bias` by the inertial parameters, (nv, 10 links, ...).

        The parameters of each link are its mass, mass times center of mass (3), and inertia about
        its origin, xx, yy, zz, xy, xz, yz (Atkeson, An and Hollerbach 1986, Int. J. Robotics
        Research 5(3)).
        """
        placements, tree = self.placements(q), self.tree
        out = self._field.array(np.zeros((tree.nv, 10 * len(tree.links), *v.shape[1:])))
        for i, motion in enumerate(self.motions(placements, v, a)):
            force, moment = motion.wrench_regressor(self._field)
            ancestor, columns = i, slice(10 * i, 10 * i + 10)
            while True:
                out[tree.velocities[ancestor], columns] = self._joint_force(ancestor, force, moment)
                if (parent := tree.links[ancestor].parent) == WORLD:
                    break
                force, moment = carried_down(placements[ancestor], force, moment)
                ancestor = parent
        return out

    def lift(self, q: Scalars) -> Scalars:
        """Return the joint forces of compensated weights, (nv, ...)."""
        batch, forces = q.shape[1:], list[Acting]()
        for link, pose in zip(self.tree.links, self.poses(q), strict=True):
            up = self._field.array([-link.lifted]) * tall(self._gravity, batch)
            force = rotate_back(pose.rotation, up + 0 * pose.origin)
            forces.append((force, cross(tall(self._field.array(link.lift), batch), force)))
        return self.propagate(self.placements(q), forces)

    def motions(
        self, placements: list[Placement], v: Scalars, a: Scalars | None
    ) -> list[LinkMotion]:
        """Return the motion of each link, relative to a freely falling frame."""
        motions: list[LinkMotion] = []
        for i in range(len(self.tree.links)):
            motions.append(self._motion(i, placements, motions, v, a))
        return motions

    def _motion(
        self,
        i: int,
        placements: list[Placement],
        motions: list[LinkMotion],
        v: Scalars,
        a: Scalars | None,
    ) -> LinkMotion:
        """Return the motion of a link from its parent's."""
        parent, there = self.tree.links[i].parent, self.tree.velocities[i]
        if parent == WORLD:
            still = self._field.array(np.zeros((3, *v.shape[1:])))
            base = LinkMotion(still, still, still - tall(self._gravity, v.shape[1:]))
        else:
            base = motions[parent]
        acceleration = None if a is None else a[there]
        return base.child(placements[i], self._links[i], v[there], acceleration)

    def velocities(self, placements: list[Placement], v: Scalars) -> list[Moving]:
        """Return the velocity of each link, in its own frame, (3, ...) each."""
        velocities: list[Moving] = []
        still = self._field.array(np.zeros((3, *v.shape[1:])))
        rows = zip(self.tree.links, self._links, placements, self.tree.velocities, strict=True)
        for link, numbers, here, there in rows:
            base = Moving(still, still) if link.parent == WORLD else velocities[link.parent]
            linear = rotate_back(here.rotation, base.linear + cross(base.angular, here.origin))
            angular = rotate_back(here.rotation, base.angular)
            velocities.append(
                Moving(
                    angular + weighted(numbers.turning, v[there]),
                    linear + weighted(numbers.sliding, v[there]),
                )
            )
        return velocities

    def propagate(self, placements: list[Placement], forces: list[Acting]) -> Scalars:
        """Return the joint forces of forces, and moments about origins, on the links, (nv, ...).

        Args:
            placements: each link's frame in its parent's.
            forces: on each link, in its own frame, (3, ...) each; overwritten.
        """
        tree = self.tree
        out: list[Scalars] = [forces[0][0]] * len(tree.links)
        for i in reversed(range(len(tree.links))):
            force, moment = forces[i]
            out[i] = self._joint_force(i, force, moment)
            if (parent := tree.links[i].parent) != WORLD:
                force, moment = _passed(placements[i], force, moment)
                forces[parent] = forces[parent][0] + force, forces[parent][1] + moment
        return np.concatenate(out)

    def _joint_force(self, link: int, force: Scalars, moment: Scalars) -> Scalars:
        numbers = self._links[link]
        result: Scalars = weighted(numbers.turning.T, moment)
        result = result + weighted(numbers.sliding.T, force)
        return result

    def _placed(self, link: TreeLink, numbers: LinkNumbers, q: Scalars) -> Placement:
        batch = q.shape[1:]
        base = numbers.placement
        rotation = base.rotation.reshape(3, 3, *(1,) * len(batch))
        origin = tall(base.origin, batch)
        match link.kind:
            case "hinge":
                if link.pitch:
                    origin = origin + rotate(rotation, tall(numbers.sliding[:, 0], batch)) * q[0]
                return Placement(turned_by(numbers.turned, q[0], self._field), origin)
            case "slide":
                moved = rotate(rotation, tall(numbers.axis, batch)) * q[0]
                return Placement(rotation + 0 * q[0], origin + moved)
            case "ball":
                return Placement(product(rotation, from_quaternion(q)), origin)
        return Placement(
            product(rotation, from_quaternion(q[3:])), origin + rotate(rotation, q[:3])
        )

    def _composites(self, placements: list[Placement]) -> list[Composite]:
        """Return the composite body of each link and its descendants, in the link's frame."""
        bodies = [
            Composite(
                one.mass, tall(one.mass * one.center, here.origin.shape[1:]), self._about(one)
            )
            for one, here in zip(self._links, placements, strict=True)
        ]
        for i in reversed(range(len(bodies))):
            if (parent := self.tree.links[i].parent) != WORLD:
                bodies[parent] = bodies[parent].combined(
                    bodies[i].in_frame(placements[i], self._field)
                )
        return [widened(one, here) for one, here in zip(bodies, placements, strict=True)]

    def _about(self, numbers: LinkNumbers) -> Scalars:
        """Return the inertia about the link's origin, (3, 3)."""
        c = numbers.center
        eye = self._field.array(np.eye(3))
        moved = (c * c).sum(keepdims=True) * eye - c[:, None] * c[None]
        result: Scalars = numbers.inertia + numbers.mass * moved
        return result


def _passed(placed: Placement, force: Scalars, moment: Scalars) -> Acting:
    """Return a force and its moment in the parent's frame."""
    force, moment = rotate(placed.rotation, force), rotate(placed.rotation, moment)
    return force, moment + cross(placed.origin, force)


_INERTIAL = ("mass", "center", "inertia")
_LINKS = tuple(one.name for one in fields(TreeLink) if one.name not in _INERTIAL)
_TREES = ("pulls", "couplings", "bushings")


def ten(link: TreeLink) -> Array:
    """Return the ten inertial parameters of a link, (10,), as in `Recursion.regressor`.

    They are mass, mass times center (3), and inertia about the origin, xx, yy, zz, xy, xz, yz.
    """
    c = link.center
    about = link.inertia + link.mass * (c @ c * np.eye(3) - np.outer(c, c))
    (xx, xy, xz), (_, yy, yz), (*_, zz) = about
    return np.array([link.mass, *(link.mass * c), xx, yy, zz, xy, xz, yz])


def bodies_apart(first: Tree, second: Tree) -> Array | None:
    """Return differences of inertial parameters, (10 links,); None if anything else differs."""
    same = (
        len(first.links) == len(second.links)
        and first.fluid is None
        and second.fluid is None
        and np.array_equal(first.gravity, second.gravity)
        and all(getattr(first, name) == getattr(second, name) for name in _TREES)
    )
    if not same:
        return None
    differences = np.zeros((len(first.links), 10))
    for row, mine, theirs in zip(differences, first.links, second.links, strict=True):
        if mine is theirs:
            continue
        if not _carried_alike(mine, theirs):
            return None
        if not all(np.array_equal(getattr(mine, x), getattr(theirs, x)) for x in _INERTIAL):
            row[:] = ten(mine) - ten(theirs)
    return differences.ravel()


def _carried_alike(first: TreeLink, second: TreeLink) -> bool:
    """Return whether two links differ at most in their inertial parameters."""
    for name in _LINKS:
        mine, theirs = getattr(first, name), getattr(second, name)
        if mine is not theirs and not np.array_equal(mine, theirs):
            return False
    return True
