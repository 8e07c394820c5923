"""Forces on a tree of bodies, and its accelerations and energies."""

from collections.abc import Iterator

import numpy as np

from physics_crosscheck.reference.mechanism.rotations import (
    DOUBLES,
    Field,
    Scalars,
    cross,
    from_quaternion,
    quaternion_product,
    rotate,
    rotate_back,
    rotation_vector,
)
from physics_crosscheck.reference.mechanism.tree import Bushing, Tree, TreeError
from .force_elements import ForceElements, Immersion
from .recursion import Recursion, Trace


class Bushings:
    """The bushings of a tree over one number type; the batch is last.

    Args:
        tree: the links.
        field: the number type.
    """

    def __init__(self, tree: Tree, field: Field = DOUBLES) -> None:
        self._tree, self._field = tree, field

    def __bool__(self) -> bool:
        """Return whether the tree has bushings."""
        return bool(self._tree.bushings)

    def forces(self, q: Scalars, v: Scalars) -> Scalars:
        """Return their forces on the joints, (nv, ...)."""
        out = 0 * v
        for bushing in self._tree.bushings:
            there = self._tree.velocities[bushing.link]
            turn, *stretched = self._stretched(bushing, q)
            forces = [-self._sprung(bushing, x) * x for x in stretched]
            rates = self._rates(v[there], turn)
            forces = [f - self._damped(bushing, w) * w for f, w in zip(forces, rates, strict=True)]
            if len(forces) == 2:
                forces[1] = rotate_back(turn, forces[1])
            out[there] = np.concatenate(forces)
        return out

    def stored(self, q: Scalars) -> Scalars:
        """Return their potential energy, joules, (...)."""
        energy: Scalars = 0 * q[0]
        for bushing in self._tree.bushings:
            for x in self._stretched(bushing, q)[1:]:
                size = (x * x).sum(axis=0) ** 0.5
                for i, k in enumerate(bushing.stiffness, start=1):
                    energy = energy + self._field.array([k / (i + 1)]) * size ** (i + 1)
        return energy

    def dissipated(self, q: Scalars, v: Scalars) -> Scalars:
        """Return the power dissipated by their dampers, watts, (...)."""
        power: Scalars = 0 * v[0]
        for bushing in self._tree.bushings:
            for w in self._rates(v[self._tree.velocities[bushing.link]], self._turn(bushing, q)):
                power = power + (self._damped(bushing, w) * w * w).sum(axis=0)
        return power

    def switching_functions(self, q: Scalars, v: Scalars) -> Iterator[Scalars]:
        """Yield quantities, (m, ...), that change sign where a force is not smooth.

        These are the cosine of half the rotation angle of each spring, and the rates of even-power
        dampers.
        """
        for bushing in self._tree.bushings:
            if bushing.stiffness:
                yield self._apart(bushing, q)[:1]
            if any(bushing.damping[::2]):
                yield from self._rates(
                    v[self._tree.velocities[bushing.link]], self._turn(bushing, q)
                )

    def _turn(self, bushing: Bushing, q: Scalars) -> Scalars:
        """Return the joint's rotation, (3, 3, ...)."""
        here = self._tree.positions[bushing.link]
        return from_quaternion(q[here.stop - 4 : here.stop])

    def _apart(self, bushing: Bushing, q: Scalars) -> Scalars:
        """Return the rotation from the spring's rest, a quaternion (4, ...)."""
        here = self._tree.positions[bushing.link]
        turn = q[here.stop - 4 : here.stop]
        back = np.array(bushing.turn) * [1.0, -1.0, -1.0, -1.0]
        rest = self._field.array(back).reshape(4, *(1,) * (q.ndim - 1)) + 0 * turn
        result: Scalars = quaternion_product(rest, turn)
        return result

    def _stretched(self, bushing: Bushing, q: Scalars) -> list[Scalars]:
        """Return the joint's rotation, and its rotation vector and displacement from rest."""
        here = self._tree.positions[bushing.link]
        result = [self._turn(bushing, q), rotation_vector(self._apart(bushing, q))]
        if here.stop - here.start == 7:
            place = self._field.array(np.array(bushing.place)).reshape(3, *(1,) * (q.ndim - 1))
            result.append(q[here.start : here.start + 3] - place)
        return result

    def _rates(self, velocity: Scalars, turn: Scalars) -> list[Scalars]:
        """Return the angular velocity in the link's axes and the linear velocity in the joint's."""
        return [velocity[:3]] if len(velocity) == 3 else [velocity[:3], rotate(turn, velocity[3:])]

    def _sprung(self, bushing: Bushing, x: Scalars) -> Scalars:
        """Return the secant stiffness: the force per unit of deflection."""
        result: Scalars = 0 * x[0]
        size = (x * x).sum(axis=0) ** 0.5 if len(bushing.stiffness) > 1 else result
        for k in reversed(bushing.stiffness):
            result = result * size + self._field.array([k])
        return result

    def _damped(self, bushing: Bushing, w: Scalars) -> Scalars:
        """Return the secant damping of each rate: the force per unit of rate."""
        result: Scalars = 0 * w
        for d in reversed(bushing.damping):
            result = (result + self._field.array([d])) * abs(w)
        return result


class Dynamics:
    """Accelerations and energies of a tree over one number type.

    Positions are (nq, ...), velocities and forces (nv, ...); the batch is last.

    Args:
        tree: the links.
        field: the number type.
        like: as in `Recursion`.
    """

    def __init__(self, tree: Tree, field: Field = DOUBLES, like: Recursion | None = None) -> None:
        self.tree, self.recursion, self._field = tree, Recursion(tree, field, like), field
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

    def residual(
        self, q: Scalars, v: Scalars, a: Scalars, u: Scalars, before: Trace | None = None
    ) -> Scalars:
        """Return the residual force f(q, v, u) - M(q) a, (nv, ...).

        It needs no mass matrix, so it is the cheapest way to compare accelerations with a tree.

        Args:
            q, v, a, u: state, accelerations and forces on the joints.
            before: as in `Recursion.trace`.
        """
        bodies = np.concatenate(self.recursion.trace(q, v, a, before).forces)
        bodies = bodies + self._along(self._armature, a) * a
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
