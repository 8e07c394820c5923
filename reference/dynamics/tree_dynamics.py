"""Forces on a tree of bodies, and its accelerations and energies."""

from __future__ import annotations

import numpy as np

from physics_crosscheck.reference.mechanism.rotations import DOUBLES, Field, Scalars, cross, rotate
from physics_crosscheck.reference.mechanism.tree import Tree, TreeError
from .bushings import Bushings
from .fluid import Immersion
from .force_elements import ForceElements
from .recursion import Recursion


class Dynamics:
    """Accelerations and energies of a tree over one number type.

    Positions are (nq, ...), velocities and forces (nv, ...); the batch is last.

    Args:
        tree: the links.
        field: the number type.
    """

    def __init__(self, tree: Tree, field: Field = DOUBLES) -> None:
        self.tree, self.recursion, self._field = tree, Recursion(tree, field), field
        self._pulls, self._bushings = (
            ForceElements(tree, self.recursion, field),
            Bushings(tree, field),
        )
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
        return self._with_armatures(self.recursion.mass(q))

    def _with_armatures(self, mass: Scalars) -> Scalars:
        """Return the mass matrix of the links, with the armatures of force elements."""
        if not self._pulls:
            return mass
        armatures = self._pulls.mass()
        result: Scalars = mass + armatures.reshape(*armatures.shape, *(1,) * (mass.ndim - 2))
        return result

    def force(self, q: Scalars, v: Scalars, u: Scalars) -> Scalars:
        """Return f of M(q) a = f(q, v, u), (nv, ...).

        Args:
            q, v: state.
            u: forces on the joints, (nv, ...).
        """
        return self._net_force(self.recursion.bias(q, v), q, v, u)

    def residual(self, q: Scalars, v: Scalars, a: Scalars, u: Scalars) -> Scalars:
        """Return the residual force f(q, v, u) - M(q) a, (nv, ...).

        It needs no mass matrix, so it is the cheapest way to compare accelerations with a tree.
        """
        bodies = self.recursion.bias(q, v, a) + self._along(self._armature, a) * a
        if self._pulls:
            bodies = bodies + np.tensordot(self._pulls.mass(), a, 1)
        return self._net_force(bodies, q, v, u)

    def _net_force(self, bodies: Scalars, q: Scalars, v: Scalars, u: Scalars) -> Scalars:
        """Return the sum of all forces, minus the inertial forces `bodies`."""
        damping = self._along(self._damping, v) * v
        force: Scalars = u - bodies - self._turned_armature(v) - self.springs(q) - damping
        if self._pulls:
            force = force + self._pulls.forces(q, v)
        if self._bushings:
            force = force + self._bushings.forces(q, v)
        if self._immersion:
            force = force + self._immersion.forces(q, v)
        return force + self.recursion.lift(q) if self._lifts else force

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
                velocity = v[there]
                linear = slice(there.start + 3, there.stop)
                out[linear] = self._array(link.armature) * cross(velocity[:3], velocity[3:])
        return out

    @property
    def nonsmooth(self) -> bool:
        """True if some forces are not smooth."""
        return self._pulls.nonsmooth or self._immersion.nonsmooth or bool(self._bushings)

    def switching_functions(self, q: Scalars, v: Scalars) -> Scalars:
        """Return quantities that change sign where a force is not smooth, (m, ...)."""
        of_bushings = self._bushings.switching_functions(q, v)
        return np.concatenate(
            [
                self._pulls.switching_functions(q, v),
                self._immersion.switching_functions(q, v),
                *of_bushings,
            ]
        )

    def acceleration(self, q: Scalars, v: Scalars, u: Scalars) -> Scalars:
        """Return a = M^-1 f, (nv, ...)."""
        placements = self.recursion.placements(q)
        mass = self._with_armatures(self.recursion.mass(q, placements))
        bias = self.recursion.bias(q, v, placements=placements)
        return solved(mass, self._net_force(bias, q, v, u))

    def kinetic(self, q: Scalars, v: Scalars) -> Scalars:
        """Return T = v^T M v / 2, joules, (...)."""
        mass = self.mass(q)
        result: Scalars = (v * (mass * v).sum(axis=1)).sum(axis=0) / 2
        return result

    def potential(self, q: Scalars) -> Scalars:
        """Return V of gravity and springs, joules, (...)."""
        gravity = self._field.array(self.tree.gravity)
        energy: Scalars = 0 * q.sum(axis=0, keepdims=True)
        rows = zip(self.tree.links, self.tree.positions, self.recursion.poses(q), strict=True)
        for link, here, pose in rows:
            center = self._field.array(link.center).reshape(3, *(1,) * (q.ndim - 1))
            point = pose.origin + rotate(pose.rotation, center)
            energy = energy - self._array(link.mass) * np.tensordot(gravity[None], point, 1)
            if link.lifted:
                lift = self._field.array(link.lift).reshape(center.shape)
                point = pose.origin + rotate(pose.rotation, lift)
                energy = energy + self._array(link.lifted) * np.tensordot(gravity[None], point, 1)
            if link.stiffness:
                stretched = q[here] - self._array(link.rest[0])
                energy = energy + self._array(link.stiffness) * stretched**2 / 2
        whole: Scalars = energy[0]
        for elements in (self._pulls, self._bushings):
            whole = whole + elements.stored(q) if elements else whole
        return whole

    def dissipated(self, q: Scalars, v: Scalars) -> Scalars:
        """Return the power dissipated by dampers and the fluid, watts, (...)."""
        power: Scalars = (self._damping.reshape(-1, *(1,) * (v.ndim - 1)) * v * v).sum(axis=0)
        for elements in (self._pulls, self._bushings):
            power = power + elements.dissipated(q, v) if elements else power
        if self._immersion:
            power = power - (v * self._immersion.forces(q, v)).sum(axis=0)
        return power

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
    matrix, solution = mass.copy(), force.copy()
    for k in range(n):
        for i in range(k + 1, n):
            share = matrix[i, k] / matrix[k, k]
            matrix[i, k + 1 :] = matrix[i, k + 1 :] - share * matrix[k, k + 1 :]
            solution[i] = solution[i] - share * solution[k]
    for k in reversed(range(n)):
        for j in range(k + 1, n):
            solution[k] = solution[k] - matrix[k, j] * solution[j]
        solution[k] = solution[k] / matrix[k, k]
    return solution
