"""A tree in Pinocchio, whatever its file's format: its accelerations, and where its bodies are."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from harness.engines.attitude import matrix
from harness.engines.following import held_accelerations, leading
from harness.engines.pinocchio.reading import frames
from harness.engines.protocol import Array, EngineError
from harness.engines.remark import Remark
from harness.engines.runge_kutta import RungeKutta, to_state
from harness.engines.step_rule import StepRule
from harness.engines.tree_model import FREE, TreeModel
from harness.engines.urdf import Mimic

DAMPING = "Pinocchio's leaving out of joints' dampers"


class PinocchioModel(TreeModel):
    """A tree of slides and hinges, fixed or not, stepped by the classical rule of order four."""

    integrator = "Runge-Kutta 4"
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
        self._data, self._q = model.createData(), np.empty(model.nq)
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
                raise EngineError(f"{self.path}: joint {row[0]!r} is no slide or hinge")
            # Cosine and sine stand for the angle of a hinge without limits.
            if joint.nq > joint.nv:
                self._turns.append((len(speeds), joint.idx_q))
            else:
                places += [(len(speeds) + i, joint.idx_q + i) for i in range(joint.nq)]
            speeds += range(joint.idx_v, joint.idx_v + joint.nv)
        self._here, self._there = np.array(places, dtype=int).reshape(-1, 2).T
        at = np.array([*range(root_v, root_v + first), *speeds], dtype=int)
        # Where each of Pinocchio's velocities is among those here, unless it is there itself.
        self._order = None if np.array_equal(at, np.arange(model.nv)) else np.argsort(at)
        damping = np.array(model.damping)[at[first:]]
        self._springs = self.name(singles, damping if self.settings["damping"] else None)
        self._undamped = not self.settings["damping"] and bool(damping.any())
        self._along = leading(mimics, self.coordinates, self.path) if mimics else None
        straight = np.array_equal(self._there, np.arange(len(singles))) and not self.floats
        bare = straight and self._along is None and self._order is None and not refs.any()
        self.forward = self._plain if bare else self._accelerations
        self.stepper = RungeKutta(self.forward, self.floats)
        z = np.zeros(len(self.coordinates))
        x, m = to_state(z, z) if self.floats else (z, z)
        if not np.isfinite(self.forward(x, m, z)).all():
            raise EngineError(f"{self.path}: a joint moves nothing that has inertia")

    def _plain(self, x: Array, m: Array, f: Array) -> Array:
        """Of a tree of slides and hinges with limits, whose positions are Pinocchio's own."""
        pull = f if self._springs.empty else f + self._springs.at(x, m)
        return self._aba(self._model, self._data, x, m, pull)  # type: ignore[no-any-return]

    def _accelerations(self, x: Array, m: Array, f: Array) -> Array:
        """Of positions, velocities and forces, as `RungeKutta` has them."""
        free = FREE if self.floats else 0
        own, pull = m, f.copy()
        if not self._springs.empty:
            pull[free:] += self._springs.at(x[free + bool(free) :], m[free:])
        if self.floats:
            turn = matrix(x[3:7])
            own = np.concatenate([turn.T @ m[:3], m[3:]])
            pull[:3] = turn.T @ pull[:3]
        a = self._own(self._configuration(x), own, pull)
        if self.floats:
            a[:3] = turn @ (a[:3] + np.cross(own[3:6], own[:3]))
        return a

    def _own(self, q: Array, v: Array, pull: Array) -> Array:
        """Pinocchio's, of its positions, and of velocities and forces in the order here."""
        import pinocchio as pin

        order = self._order
        if order is not None:
            v, pull = v[order], pull[order]
        if self._along is None:
            a = self._aba(self._model, self._data, q, v, pull)
        else:
            upper = np.triu(pin.crba(self._model, self._data, q))
            pull = pull - pin.nonLinearEffects(self._model, self._data, q, v)
            along = self._along if order is None else self._along[order]
            a = held_accelerations(upper + np.triu(upper, 1).T, pull, along)
        if order is None:
            return a  # type: ignore[no-any-return]  # pinocchio ships no types
        found = np.empty_like(a)
        found[order] = a
        return found  # type: ignore[no-any-return]

    def _configuration(self, x: Array) -> Array:
        """Positions as Pinocchio has them; the real part of a quaternion is its last."""
        q, joints = self._q, x
        if self.floats:
            turn, at = x[3:7] / np.linalg.norm(x[3:7]), self._root_q
            q[at : at + 3], q[at + 3 : at + 6], q[at + 6] = x[:3], turn[1:], turn[0]
            joints = x[7:]
        joints = joints - self._refs
        q[self._there] = joints[self._here]
        for i, at in self._turns:
            q[at], q[at + 1] = math.cos(joints[i]), math.sin(joints[i])
        return q

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """Order 4, until an input is held over the step."""
        return (1 if varying_input else 4), 1

    @property
    def step_rule(self) -> StepRule:
        """All forces at each stage."""
        return StepRule(scheme="Runge-Kutta 4")

    @property
    def undamped(self) -> dict[str, Mapping[str, object]]:
        """That dampers are left out, where they are, with what undoes it."""
        return {DAMPING: {"damping": True}} if self._undamped else {}

    def damping_remarks(self) -> Iterator[Remark]:
        """Dampers that are left out."""
        if self._undamped:
            yield Remark(
                message=f"{DAMPING}, by the setting damping: nothing brakes a joint",
                address="sidecar:settings.damping",
                shows_in=("damping",),
            )

    @property
    def places(self) -> tuple[str, ...]:
        """Bodies; and centres of mass of those with which no other moves as one."""
        return tuple(frames(self._model, self.body_kind))

    def poses(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """By its forward kinematics."""
        import pinocchio as pin

        known, found = frames(self._model, self.body_kind), []
        for row in z:
            x = to_state(row, 0 * row)[0] if self.floats else row
            pin.framesForwardKinematics(self._model, self._data, self._configuration(x))
            at = [(self._data.oMf[known[place][0]], known[place][1]) for place in places]
            found.append([(frame.act(point), np.array(frame.rotation)) for frame, point in at])
        origins, turns = ([[pair[k] for pair in row] for row in found] for k in (0, 1))
        shape = len(z), len(places)
        return np.array(origins).reshape(*shape, 3), np.array(turns).reshape(*shape, 3, 3)
