"""A tree in Pinocchio, whatever its file's format: its accelerations, and where its bodies are."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.engines.attitude import cross, matrix, turned
from physics_crosscheck.harness.engines.following import held_accelerations, leading
from physics_crosscheck.harness.engines.pinocchio.reading import frames, lifting
from physics_crosscheck.harness.engines.protocol import Array, EngineError
from physics_crosscheck.harness.engines.runge_kutta import to_state
from physics_crosscheck.harness.engines.stepped_here import SteppedHere
from physics_crosscheck.harness.engines.tree_model import FREE
from physics_crosscheck.harness.engines.urdf import Mimic


class PinocchioModel(SteppedHere):
    """A tree of slides and hinges, fixed or not."""

    body_kind = "link"
    """What a body is called in places."""

    def take(
        self, model: Any, names: Sequence[Sequence[str]], refs: Array, mimics: Sequence[Mimic]
    ) -> None:
        """Take what was read of the file.

        Args:
            model: Pinocchio's.
            names: of the slides and hinges of each of its joints but the universe; none of a root.
            refs: what positions of slides and hinges are where it has zero.
            mimics: joints that are held to those that they follow.
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
            # Cosine and sine stand for the angle of a hinge without limits.
            if joint.nq > joint.nv:
                self._turns.append((len(speeds), joint.idx_q))
            else:
                places += [(len(speeds) + i, joint.idx_q + i) for i in range(joint.nq)]
            speeds += range(joint.idx_v, joint.idx_v + joint.nv)
        here, there = np.array(places, dtype=int).reshape(-1, 2).T
        self._here, self._there = _run(here), _run(there)
        at = np.array([*range(root_v, root_v + first), *speeds], dtype=int)
        # Where each of Pinocchio's velocities is among those here, unless it is there itself.
        self._order = None if np.array_equal(at, np.arange(model.nv)) else np.argsort(at)
        damping = np.array(model.damping)[at[first:]]
        self._springs = self.dampers(singles, damping)
        along = leading(mimics, self.coordinates, self.path) if mimics else None
        # In Pinocchio's order.
        self._along = along if along is None or self._order is None else along[self._order]
        self._upper = np.triu(np.ones((model.nv, model.nv)))
        self._above = np.triu(self._upper, 1)
        self._referred = bool(refs.any())
        self._lifts = lifting(model, self.lifts)
        own = not (self.floats or self._turns or self._referred)
        self._straight = own and np.array_equal(there, np.arange(len(singles)))
        self._permuted = np.argsort(there) if own else None
        bare = self._straight and self._along is None and self._order is None
        bare = bare and not self._lifts
        one = None if self.floats or self._along is not None else self._one
        self.step_by(self._plain if bare else self._accelerations, one)

    def _plain(self, x: Array, m: Array, f: Array) -> Array:
        """Of a tree of slides and hinges with limits, whose positions are Pinocchio's own."""
        pull = f if self._springs.empty else f + self._springs.at(x, m)
        aba, model, data = self._aba, self._model, self._data
        return np.array([aba(model, data, *row) for row in zip(x, m, pull, strict=True)])

    def _one(self, x: Array, m: Array, f: Array) -> Array:
        """The same of one state, (n,) each; of a fixed root, where no joint follows another."""
        pull = f if self._springs.empty else f + self._springs.at(x, m)
        q, order = self._configuration(x), self._order
        if order is None:
            a: Array = self._aba(self._model, self._data, q, m, pull + self._lifted(q))
            return a
        found = np.empty_like(m)
        pull = pull[order] + self._lifted(q)
        found[order] = self._aba(self._model, self._data, q, m[order], pull)
        return found

    def _lifted(self, q: Array) -> Array | float:
        """Return forces of gravity compensation at one position, in Pinocchio's order."""
        force: Array | float = 0.0
        for sign, model, data in self._lifts:
            force = force + sign * self._gravity_force(model, data, q)
        return force

    def _accelerations(self, x: Array, m: Array, f: Array) -> Array:
        """Of positions, velocities and forces, as `RungeKutta` has them."""
        free = FREE if self.floats else 0
        own, pull = m, f.copy()
        if not self._springs.empty:
            pull[:, free:] += self._springs.at(x[:, free + bool(free) :], m[:, free:])
        if self.floats:
            turn = matrix(x[:, 3:7])
            back = turn.swapaxes(1, 2)
            own = np.concatenate([turned(back, m[:, :3]), m[:, 3:]], axis=1)
            pull[:, :3] = turned(back, pull[:, :3])
        a = self._own(self._configuration(x), own, pull)
        if self.floats:
            inward = a[:, :3] + cross(own[:, 3:6], own[:, :3])
            a[:, :3] = turned(turn, inward)
        return a

    def _own(self, q: Array, v: Array, pull: Array) -> Array:
        """Pinocchio's, of its positions, and of velocities and forces in the order here."""
        order = self._order
        if order is not None:
            v, pull = v[:, order], pull[:, order]
        if self._lifts:
            pull = pull + np.array([self._lifted(row) for row in q])
        rows = zip(q, v, pull, strict=True)
        if self._along is None:
            aba, model, data = self._aba, self._model, self._data
            a = np.array([aba(model, data, *row) for row in rows])
        else:
            a = self._led(rows, self._along)
        if order is None:
            return a
        found = np.empty_like(a)
        found[:, order] = a
        return found

    def _led(self, rows: Iterable[tuple[Array, Array, Array]], along: Array) -> Array:
        """Where joints follow others, on the mass matrix: Pinocchio tells its upper half."""
        import pinocchio as pin

        model, data = self._model, self._data
        found = [
            (pin.crba(model, data, q), pull - pin.nonLinearEffects(model, data, q, v))
            for q, v, pull in rows
        ]
        upper = np.array([mass for mass, _ in found]) * self._upper
        mass = upper + (upper * self._above).swapaxes(1, 2)
        return held_accelerations(mass, np.array([pull for _, pull in found]), along)

    def _configuration(self, x: Array) -> Array:
        """Positions (..., nq) as Pinocchio has them; the real part of a quaternion is its last."""
        if self._straight:
            return x
        if self._permuted is not None:
            return x[..., self._permuted]
        q, joints = np.empty((*x.shape[:-1], self._model.nq)), x
        if self.floats:
            turn = x[:, 3:7] / np.linalg.norm(x[:, 3:7], axis=1, keepdims=True)
            at = self._root_q
            q[:, at : at + 3], q[:, at + 3 : at + 6] = x[:, :3], turn[:, 1:]
            q[:, at + 6], joints = turn[:, 0], x[:, 7:]
        if self._referred:
            joints = joints - self._refs
        q[..., self._there] = joints[..., self._here]
        for i, at in self._turns:
            angle = joints[..., i]
            q[..., at], q[..., at + 1] = np.cos(angle), np.sin(angle)
        return q

    @property
    def places(self) -> tuple[str, ...]:
        """Bodies; and centres of mass of those with which no other moves as one."""
        return tuple(frames(self._model, self.body_kind))

    def poses(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """By its forward kinematics."""
        import pinocchio as pin

        known, found = frames(self._model, self.body_kind), []
        for q in self._configuration(to_state(z, 0 * z)[0] if self.floats else z):
            pin.framesForwardKinematics(self._model, self._data, q)
            at = [(self._data.oMf[known[place][0]], known[place][1]) for place in places]
            found.append([(frame.act(point), np.array(frame.rotation)) for frame, point in at])
        origins, turns = ([[pair[k] for pair in row] for row in found] for k in (0, 1))
        shape = len(z), len(places)
        return np.array(origins).reshape(*shape, 3), np.array(turns).reshape(*shape, 3, 3)


def _run(indices: NDArray[np.intp]) -> NDArray[np.intp] | slice:
    """Indices, as a slice where they follow one another: numpy is quicker with that."""
    first = int(indices[0]) if len(indices) else 0
    whole = np.array_equal(indices, np.arange(first, first + len(indices)))
    return slice(first, first + len(indices)) if whole else indices
