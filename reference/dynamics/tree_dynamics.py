"""Forces on a tree of bodies, and its accelerations and energies."""

from __future__ import annotations

import numpy as np

from physics_crosscheck.reference.dynamics.bushings import Bushes
from physics_crosscheck.reference.dynamics.fluid import Immersion
from physics_crosscheck.reference.dynamics.force_elements import Pulls
from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.mechanism.rotations import DOUBLES, Field, Scalars, cross, turned
from physics_crosscheck.reference.mechanism.tree import Tree, TreeError


class Dynamics:
    """Accelerations and energies of a tree over one number type.

    Positions are (nq, ...), velocities and forces (nv, ...); the batch is last.

    Args:
        tree: the links.
        field: the number type.
    """

    def __init__(self, tree: Tree, field: Field = DOUBLES) -> None:
        self.tree, self.recursion, self._field = tree, Recursion(tree, field), field
        self._pulls, self._bushes = Pulls(tree, self.recursion, field), Bushes(tree, field)
        self._immersion = Immersion(tree, self.recursion, field)
        self._lifts = any(link.lifted for link in tree.links)
        for link in tree.links:
            if link.stiffness and link.kind not in ("hinge", "slide"):
                raise TreeError(f"{link.name}: a {link.kind} joint takes bushings, not springs")
        widths = [there.stop - there.start for there in tree.velocities]
        self._damping, self._armature = (
            field.array(np.repeat(numbers, widths))
            for numbers in (
                [link.damping for link in tree.links],
                [link.armature for link in tree.links],
            )
        )

    def springs(self, q: Scalars) -> Scalars:
        """Return k (q - rest) of the joint springs, (nv, ...)."""
        out = self._field.array(np.zeros((self.tree.nv, *q.shape[1:])))
        rows = zip(self.tree.links, self.tree.positions, self.tree.velocities, strict=True)
        for link, here, there in rows:
            if link.stiffness:
                out[there] = self._array(link.stiffness) * (q[here] - self._array(link.rest[0]))
        return out

    def mass(self, q: Scalars) -> Scalars:
        """Return the mass matrix, all armatures included, (nv, nv, ...)."""
        mass = self.recursion.mass(q)
        if not self._pulls:
            return mass
        own = self._pulls.mass()
        found: Scalars = mass + own.reshape(*own.shape, *(1,) * (q.ndim - 1))
        return found

    def force(self, q: Scalars, v: Scalars, u: Scalars) -> Scalars:
        """Return f of M(q) a = f(q, v, u), (nv, ...).

        Args:
            q, v: state.
            u: forces on the joints, (nv, ...).
        """
        return self._left(self.recursion.bias(q, v), q, v, u)

    def residual(self, q: Scalars, v: Scalars, a: Scalars, u: Scalars) -> Scalars:
        """Return the residual force f(q, v, u) - M(q) a, (nv, ...).

        It needs no mass matrix, so it is the cheapest way to compare accelerations with a tree.
        """
        bodies = self.recursion.bias(q, v, a) + self._along(self._armature, a) * a
        if self._pulls:
            bodies = bodies + np.tensordot(self._pulls.mass(), a, 1)
        return self._left(bodies, q, v, u)

    def _left(self, bodies: Scalars, q: Scalars, v: Scalars, u: Scalars) -> Scalars:
        """Return the sum of all forces, minus the inertial forces `bodies`."""
        damping = self._along(self._damping, v) * v
        left: Scalars = u - bodies - self._turned_armature(v) - self.springs(q) - damping
        if self._pulls:
            left = left + self._pulls.forces(q, v)
        if self._bushes:
            left = left + self._bushes.forces(q, v)
        if self._immersion:
            left = left + self._immersion.forces(q, v)
        return left + self.recursion.lift(q) if self._lifts else left

    def _along(self, numbers: Scalars, like: Scalars) -> Scalars:
        """Shape (nv,) to broadcast with a batch."""
        return numbers.reshape(-1, *(1,) * (like.ndim - 1))

    def _turned_armature(self, v: Scalars) -> Scalars:
        """Return the force m w x u of a free joint's armature, (nv, ...).

        It occurs because the velocity is in a rotating frame. The armature is a mass without moment
        of inertia and weight.
        """
        out = 0 * v
        for link, there in zip(self.tree.links, self.tree.velocities, strict=True):
            if link.kind == "free" and link.armature:
                own = v[there]
                linear = slice(there.start + 3, there.stop)
                out[linear] = self._array(link.armature) * cross(own[:3], own[3:])
        return out

    @property
    def bent(self) -> bool:
        """True if some forces are not smooth."""
        return self._pulls.bent or self._immersion.bent or bool(self._bushes)

    def bends(self, q: Scalars, v: Scalars) -> Scalars:
        """Return quantities that change sign where a force is not smooth, (m, ...)."""
        own = self._bushes.bends(q, v)
        return np.concatenate([self._pulls.bends(q, v), self._immersion.bends(q, v), *own])

    def acceleration(self, q: Scalars, v: Scalars, u: Scalars) -> Scalars:
        """Return a = M^-1 f, (nv, ...)."""
        return solved(self.mass(q), self.force(q, v, u))

    def kinetic(self, q: Scalars, v: Scalars) -> Scalars:
        """Return T = v^T M v / 2, joules, (...)."""
        mass = self.mass(q)
        found: Scalars = (v * (mass * v).sum(axis=1)).sum(axis=0) / 2
        return found

    def potential(self, q: Scalars) -> Scalars:
        """Return V of gravity and springs, joules, (...)."""
        gravity = self._field.array(self.tree.gravity)
        found: Scalars = 0 * q.sum(axis=0, keepdims=True)
        rows = zip(self.tree.links, self.tree.positions, self.recursion.poses(q), strict=True)
        for link, here, pose in rows:
            center = self._field.array(link.center).reshape(3, *(1,) * (q.ndim - 1))
            at = pose.origin + turned(pose.rotation, center)
            found = found - self._array(link.mass) * np.tensordot(gravity[None], at, 1)
            if link.lifted:
                lift = self._field.array(link.lift).reshape(center.shape)
                at = pose.origin + turned(pose.rotation, lift)
                found = found + self._array(link.lifted) * np.tensordot(gravity[None], at, 1)
            if link.stiffness:
                stretched = q[here] - self._array(link.rest[0])
                found = found + self._array(link.stiffness) * stretched**2 / 2
        whole: Scalars = found[0]
        for one in (self._pulls, self._bushes):
            whole = whole + one.stored(q) if one else whole
        return whole

    def dissipated(self, q: Scalars, v: Scalars) -> Scalars:
        """Return the power dissipated by dampers and the fluid, watts, (...)."""
        found: Scalars = (self._damping.reshape(-1, *(1,) * (v.ndim - 1)) * v * v).sum(axis=0)
        for one in (self._pulls, self._bushes):
            found = found + one.dissipated(q, v) if one else found
        if self._immersion:
            found = found - (v * self._immersion.forces(q, v)).sum(axis=0)
        return found

    def _array(self, number: float) -> Scalars:
        """Return a number as (1,), which broadcasts against every batch."""
        return self._field.array([number])


def solved(mass: Scalars, force: Scalars) -> Scalars:
    """Return M^-1 f for a symmetric positive definite M, (n, n, ...), and f, (n, ...).

    Doubles use LAPACK. Other numbers use the factors L D L^T, which need no roots.
    """
    if mass.dtype == np.float64 and force.dtype == np.float64:
        axes = (*range(2, mass.ndim), 0, 1)
        columns = np.moveaxis(force, 0, -1)[..., None]
        return np.moveaxis(np.linalg.solve(mass.transpose(axes), columns)[..., 0], -1, 0)
    n = len(mass)
    left, found = mass.copy(), force.copy()
    for k in range(n):
        for i in range(k + 1, n):
            share = left[i, k] / left[k, k]
            left[i, k + 1 :] = left[i, k + 1 :] - share * left[k, k + 1 :]
            found[i] = found[i] - share * found[k]
    for k in reversed(range(n)):
        for j in range(k + 1, n):
            found[k] = found[k] - left[k, j] * found[j]
        found[k] = found[k] / left[k, k]
    return found
