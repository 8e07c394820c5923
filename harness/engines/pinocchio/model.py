"""A tree in Pinocchio, from any format: its accelerations and the poses of its bodies."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.documents.tree import Mimic
from physics_crosscheck.harness.engines.pinocchio.reading import frames, lift_models
from physics_crosscheck.harness.engines.protocol import Array, EngineError
from physics_crosscheck.harness.engines.runge_kutta import to_state
from physics_crosscheck.harness.engines.stepped_here import SteppedHere
from physics_crosscheck.harness.engines.tree_model import (
    FREE,
    constrained_accelerations,
    leader_matrix,
)
from physics_crosscheck.reference.mechanism.rotations import (
    cross,
    from_quaternion,
    rotate,
    rotate_back,
)


class PinocchioModel(SteppedHere):
    """A tree of slides and hinges, fixed or floating."""

    body_kind = "link"
    """The word for a body in places."""

    def take(
        self, model: Any, names: Sequence[Sequence[str]], refs: Array, mimics: Sequence[Mimic]
    ) -> None:
        """Set up the model from a parsed file.

        Args:
            model: Pinocchio's.
            names: of the slides and hinges of each joint except the universe; empty for a floating
                root.
            refs: positions of slides and hinges at Pinocchio's zero.
            mimics: joints that the adapter couples to others.
        """
        import pinocchio

        self._model, self._refs = model, refs
        model.gravity.linear = np.array(self.gravity)
        self._aba = pinocchio.aba
        self._gravity_force = pinocchio.computeGeneralizedGravity
        self._data = model.createData()
        singles = [name for row in names for name in row]
        first = FREE if self.floats else 0
        places: list[tuple[int, int]] = []
        speeds: list[int] = []
        self._turns: list[tuple[int, int]] = []
        self._root_q, root_v = 0, 0
        for joint, row in zip(list(model.joints)[1:], names, strict=True):
            if not row:
                self._root_q, root_v = joint.idx_q, joint.idx_v
                continue
            if joint.nv != len(row) or joint.nq not in (joint.nv, 2):
                raise EngineError(f"{self.path}: joint {row[0]!r} is neither a slide nor a hinge")
            # A continuous hinge has the coordinates cosine and sine.
            if joint.nq > joint.nv:
                self._turns.append((len(speeds), joint.idx_q))
            else:
                places += [(len(speeds) + i, joint.idx_q + i) for i in range(joint.nq)]
            speeds += range(joint.idx_v, joint.idx_v + joint.nv)
        here, there = np.array(places, dtype=int).reshape(-1, 2).T
        self._here, self._there = _run(here), _run(there)
        velocity_indices = np.array([*range(root_v, root_v + first), *speeds], dtype=int)
        # The permutation from Pinocchio's velocities to the harness's, unless they agree.
        self._order = (
            None
            if np.array_equal(velocity_indices, np.arange(model.nv))
            else np.argsort(velocity_indices)
        )
        damping = np.array(model.damping)[velocity_indices[first:]]
        self._root_armature = float(model.armature[root_v]) if self.floats else 0.0
        self._springs = self.dampers(singles, damping)
        along = leader_matrix(mimics, self.coordinates, self.path) if mimics else None
        # In Pinocchio's order.
        self._along = along if along is None or self._order is None else along[self._order]
        self._upper = np.triu(np.ones((model.nv, model.nv)))
        self._above = np.triu(self._upper, 1)
        self._referred = bool(refs.any())
        self._lifts = lift_models(model, self.lifts)
        is_plain = not (self.floats or self._turns or self._referred)
        self._straight = is_plain and np.array_equal(there, np.arange(len(singles)))
        self._permuted = np.argsort(there) if is_plain else None
        bare = self._straight and self._along is None and self._order is None
        bare = bare and not self._lifts
        single = None if self.floats or self._along is not None else self._single
        self.step_by(self._plain if bare else self._accelerations, single)

    def _plain(self, x: Array, m: Array, f: Array) -> Array:
        """Return accelerations of bounded slides and hinges, whose positions equal Pinocchio's."""
        force = f if self._springs.empty else f + self._springs.forces(x, m)
        aba, model, data = self._aba, self._model, self._data
        return np.array([aba(model, data, *row) for row in zip(x, m, force, strict=True)])

    def _single(self, x: Array, m: Array, f: Array) -> Array:
        """Return the accelerations of one state, (n,) each, for a fixed root without mimics."""
        force = f if self._springs.empty else f + self._springs.forces(x, m)
        q, order = self._configuration(x), self._order
        if order is None:
            a: Array = self._aba(self._model, self._data, q, m, force + self._lifted(q))
            return a
        result = np.empty_like(m)
        force = force[order] + self._lifted(q)
        result[order] = self._aba(self._model, self._data, q, m[order], force)
        return result

    def _lifted(self, q: Array) -> Array | float:
        """Return forces of gravity compensation at one position, in Pinocchio's order."""
        force: Array | float = 0.0
        for sign, model, data in self._lifts:
            force = force + sign * self._gravity_force(model, data, q)
        return force

    def _accelerations(self, x: Array, m: Array, f: Array) -> Array:
        """Return accelerations of positions, velocities and forces in `RungeKutta`'s convention."""
        free = FREE if self.floats else 0
        velocities, forces = m, f.copy()
        if not self._springs.empty:
            forces[:, free:] += self._springs.forces(x[:, free + bool(free) :], m[:, free:])
        if self.floats:
            turn = from_quaternion(x[:, 3:7].T)
            velocities = np.concatenate([rotate_back(turn, m[:, :3].T).T, m[:, 3:]], axis=1)
            forces[:, :3] = rotate_back(turn, forces[:, :3].T).T
            if self._root_armature:  # acts on world velocities, which Pinocchio's turn with it
                carried = cross(velocities[:, 3:6].T, velocities[:, :3].T).T
                forces[:, :3] -= self._root_armature * carried
        a = self._in_own_order(self._configuration(x), velocities, forces)
        if self.floats:
            inward = a[:, :3].T + cross(velocities[:, 3:6].T, velocities[:, :3].T)
            a[:, :3] = rotate(turn, inward).T
        return a

    def _in_own_order(self, q: Array, v: Array, forces: Array) -> Array:
        """Return Pinocchio's accelerations, of its positions and of velocities and forces in our
        order.
        """
        order = self._order
        if order is not None:
            v, forces = v[:, order], forces[:, order]
        if self._lifts:
            forces = forces + np.array([self._lifted(row) for row in q])
        rows = zip(q, v, forces, strict=True)
        if self._along is None:
            aba, model, data = self._aba, self._model, self._data
            a = np.array([aba(model, data, *row) for row in rows])
        else:
            a = self._accelerations_with_mimics(rows, self._along)
        if order is None:
            return a
        result = np.empty_like(a)
        result[:, order] = a
        return result

    def _accelerations_with_mimics(
        self, rows: Iterable[tuple[Array, Array, Array]], along: Array
    ) -> Array:
        """Solve with mimic joints on the mass matrix, whose upper half Pinocchio computes."""
        import pinocchio as pin

        model, data = self._model, self._data
        mass_and_force = [
            (pin.crba(model, data, q), pull - pin.nonLinearEffects(model, data, q, v))
            for q, v, pull in rows
        ]
        upper = np.array([mass for mass, _ in mass_and_force]) * self._upper
        mass = upper + (upper * self._above).swapaxes(1, 2)
        return constrained_accelerations(
            mass, np.array([pull for _, pull in mass_and_force]), along
        )

    def _configuration(self, x: Array) -> Array:
        """Return positions (..., nq) in Pinocchio's convention, with the real part of a quaternion
        last.
        """
        if self._straight:
            return x
        if self._permuted is not None:
            return x[..., self._permuted]
        q, joints = np.empty((*x.shape[:-1], self._model.nq)), x
        if self.floats:
            turn = x[:, 3:7] / np.linalg.norm(x[:, 3:7], axis=1, keepdims=True)
            start = self._root_q
            q[:, start : start + 3], q[:, start + 3 : start + 6] = x[:, :3], turn[:, 1:]
            q[:, start + 6], joints = turn[:, 0], x[:, 7:]
        if self._referred:
            joints = joints - self._refs
        q[..., self._there] = joints[..., self._here]
        for i, start in self._turns:
            angle = joints[..., i]
            q[..., start], q[..., start + 1] = np.cos(angle), np.sin(angle)
        return q

    @property
    def places(self) -> tuple[str, ...]:
        """Bodies, and centres of mass of bodies that are not fixed to others."""
        return tuple(frames(self._model, self.body_kind))

    def poses(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """Return poses by Pinocchio's forward kinematics."""
        import pinocchio as pin

        by_place, rows = frames(self._model, self.body_kind), []
        for q in self._configuration(to_state(z, 0 * z)[0] if self.floats else z):
            pin.framesForwardKinematics(self._model, self._data, q)
            placed = [(self._data.oMf[by_place[place][0]], by_place[place][1]) for place in places]
            rows.append([(frame.act(point), np.array(frame.rotation)) for frame, point in placed])
        origins, turns = ([[pair[k] for pair in row] for row in rows] for k in (0, 1))
        shape = len(z), len(places)
        return np.array(origins).reshape(*shape, 3), np.array(turns).reshape(*shape, 3, 3)


def _run(indices: NDArray[np.intp]) -> NDArray[np.intp] | slice:
    """Return indices, as a slice if they are consecutive: numpy is faster with slices."""
    first = int(indices[0]) if len(indices) else 0
    whole = np.array_equal(indices, np.arange(first, first + len(indices)))
    return slice(first, first + len(indices)) if whole else indices
