"""A tree in Pinocchio, from any format: its accelerations and the poses of its bodies."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.documents.document import Mimic
from physics_crosscheck.reference.mechanism.rotations import (
    cross,
    from_quaternion,
    quaternion_product,
    rotate,
    rotate_back,
    rotation_vector,
)
from ..installed import STDERR, STDOUT, capture_output
from ..protocol import Array, EngineError, UnsupportedError
from ..runge_kutta import FREE
from ..source import load_failure, one_line
from ..stepped_here import SteppedHere
from ..tree_model import Weight, constrained_accelerations, leader_matrix


def build_urdf(path: Path, file: Path, root: str) -> Any:
    """Build the model of a URDF, its root fixed or on a joint of that name.

    Raises:
        UnsupportedError: with the text that Pinocchio's parser prints.
    """
    import pinocchio as pin

    try:
        with capture_output((STDOUT, STDERR), again=False) as printed:
            if root:
                return pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer(), root)
            return pin.buildModelFromUrdf(str(path))
    except ValueError as error:
        message = one_line(" ".join(printed)) or one_line(error)
        raise load_failure("Pinocchio", file, message, UnsupportedError) from None


GROUND = "world"
"""A fixed body that carries all others; MuJoCo reserves this name for the world."""


def read_mjcf(path: Path, file: Path) -> Any:
    """Build the model of an MJCF.

    Raises:
        UnsupportedError: with the message of Pinocchio's parser.
    """
    import pinocchio as pin

    try:
        with capture_output((STDOUT, STDERR), again=False):
            model = pin.buildModelFromMJCF(str(path))
    except (ValueError, RuntimeError, IndexError) as error:
        message = one_line(error).rpartition("message: ")[2]
        raise UnsupportedError(f"{file}: Pinocchio can't load it: {message}") from None
    return model[0] if isinstance(model, tuple) else model


def lift_models(model: Any, weights: Sequence[Weight]) -> list[tuple[float, Any, Any]]:
    """Return models whose generalized gravity is the compensating force: sign, model, data.

    They have the lifted masses only, with negative ones in a separate model.
    """
    import pinocchio as pin

    models = []
    for sign in (1.0, -1.0):
        chosen = [weight for weight in weights if sign * weight.mass > 0]
        if not chosen:
            continue
        lifted = model.copy()
        for i in range(model.njoints):
            lifted.inertias[i] = pin.Inertia.Zero()
        for weight in chosen:
            frame = model.frames[model.getFrameId(weight.body, pin.FrameType.BODY)]
            centre = frame.placement.act(np.array(weight.centre))
            lifted.inertias[frame.parentJoint] += pin.Inertia(
                sign * weight.mass, centre, np.zeros((3, 3))
            )
        models.append((sign, lifted, lifted.createData()))
    return models


def frames(model: Any, kind: str) -> dict[str, tuple[int, Array]]:
    """Return the frame of each place, and the point in it.

    Centres of mass are those of bodies that are not fixed to others: Pinocchio merges these.

    Args:
        model: Pinocchio's.
        kind: the file's word for a body.
    """
    import pinocchio as pin

    body = pin.FrameType.BODY
    bodies = [(i, frame) for i, frame in enumerate(model.frames) if frame.type == body]
    carriers = [frame.parentJoint for _, frame in bodies]
    result = {f"{kind}:{frame.name}": (i, np.zeros(3)) for i, frame in bodies}
    for i, frame in bodies:
        if frame.parentJoint and carriers.count(frame.parentJoint) == 1:
            inertia = model.inertias[frame.parentJoint]
            result[f"centre:{frame.name}"] = i, frame.placement.actInv(inertia.lever)
    return result


class _Free(NamedTuple):
    """A free joint: its rotation and its origin in z and in x, and in Pinocchio's positions."""

    turn: tuple[slice, slice]
    origin: tuple[slice, slice]
    place: slice
    quaternion: slice
    armature: float
    damping: float
    stiffness: float = 0.0
    rest: Array = np.zeros(7)  # origin and conjugate quaternion, real part first

    def carried(self, velocities: Array) -> Array:
        """Return what turning axes add to the linear acceleration, (B, 3)."""
        return cross(velocities[:, self.turn[0]].T, velocities[:, self.origin[0]].T).T


class PinocchioModel(SteppedHere):
    """A tree of slides and hinges, with roots that are fixed or free."""

    body_kind = "link"
    """The word for a body in places."""

    def take(
        self,
        model: Any,
        names: Sequence[Sequence[str]],
        refs: Mapping[str, float],
        mimics: Sequence[Mimic],
    ) -> None:
        """Set up the model from a parsed file.

        Args:
            model: Pinocchio's.
            names: of the joints that each of Pinocchio's consists of, except the universe.
            refs: positions of slides and hinges at Pinocchio's zero, by name; zero without one.
            mimics: joints that the adapter couples to others.
        """
        import pinocchio

        self._model = model
        model.gravity.linear = np.array(self.gravity)
        self._aba = pinocchio.aba
        self._gravity_force = pinocchio.computeGeneralizedGravity
        self._data = model.createData()
        joints = list(model.joints)[1:]
        sizes = [size for joint, row in zip(joints, names, strict=True)
                 for size in self._sizes(joint, row)]  # fmt: skip
        singles = [joint.idx_v + i for joint, row in zip(joints, names, strict=True)
                   if joint.nv == len(row) for i in range(joint.nv)]  # fmt: skip
        damping = np.array(model.damping)[singles]
        self._springs = self.dampers([name for row in names for name in row], damping, sizes)
        self._undamped = not self.settings["damping"] and bool(np.any(model.damping))
        self._refs = np.array([refs.get(self.coordinates[i], 0.0) for i in self.layout.singles])
        self._place_joints(joints)
        self._along = leader_matrix(mimics, self.coordinates, self.path) if mimics else None
        self._upper = np.triu(np.ones((model.nv, model.nv)))
        self._above = np.triu(self._upper, 1)
        self._lifts = lift_models(model, self.lifts)
        self._straight = not (self.floats or self._turns or self._refs.any())
        bare = self._straight and self._along is None and not self._lifts
        single = None if self.floats or self._along is not None else self._single
        self.step_by(self._plain if bare else self._accelerations, single)

    def _sizes(self, joint: Any, row: Sequence[str]) -> list[int]:
        """Return the number of coordinates of each joint of a row."""
        if len(row) == 1 and (joint.nv, joint.nq) == (FREE, FREE + 1):
            return [FREE]
        if joint.nv != len(row) or joint.nq not in (joint.nv, 2):
            raise EngineError(f"{self.path}: joint {row[0]!r} is neither a slide nor a hinge")
        return [1] * joint.nv

    def _place_joints(self, joints: Sequence[Any]) -> None:
        """Set the places of slides and hinges, of turns, and of free joints among positions."""
        single, frees = 0, iter(zip(self.layout.turns, self.layout.origins, strict=True))
        places: list[tuple[int, int]] = []
        self._turns: list[tuple[int, int]] = []
        self._frees: list[_Free] = []
        for joint in joints:
            q = joint.idx_q
            if joint.nv == FREE:
                armature, damping = self._model.armature[v := joint.idx_v], self._model.damping[v]
                slices = *next(frees), slice(q, q + 3), slice(q + 3, q + 7)
                self._frees.append(
                    _Free(*slices, armature, damping * bool(self.settings["damping"]))
                )
                continue
            # A continuous hinge has the coordinates cosine and sine.
            if joint.nq > joint.nv:
                self._turns.append((single, q))
            else:
                places += [(single + i, q + i) for i in range(joint.nq)]
            single += joint.nv
        here, there = np.array(places, dtype=int).reshape(-1, 2).T
        self._here, self._there = _run(here), _run(there)

    def _plain(self, x: Array, m: Array, f: Array) -> Array:
        """Return accelerations of bounded slides and hinges, whose positions equal Pinocchio's."""
        force = f if self._springs.empty else f + self._springs.forces(x, m)
        aba, model, data = self._aba, self._model, self._data
        return np.array([aba(model, data, *row) for row in zip(x, m, force, strict=True)])

    def _single(self, x: Array, m: Array, f: Array) -> Array:
        """Return the accelerations of one state, (n,) each, for a fixed root without mimics."""
        force = f if self._springs.empty else f + self._springs.forces(x, m)
        q = self._configuration(x)
        a: Array = self._aba(self._model, self._data, q, m, force + self._lifted(q))
        return a

    def _lifted(self, q: Array) -> Array | float:
        """Return forces of gravity compensation at one position."""
        force: Array | float = 0.0
        for sign, model, data in self._lifts:
            force = force + sign * self._gravity_force(model, data, q)
        return force

    def _accelerations(self, x: Array, m: Array, f: Array) -> Array:
        """Return accelerations of positions, velocities and forces in `RungeKutta`'s convention."""
        velocities, forces, turns = m.copy(), f.copy(), list[Array]()
        if not self._springs.empty:
            rows = self.layout.singles
            forces[:, rows] += self._springs.forces(x[:, self.layout.singles_x], m[:, rows])
        for free in self._frees:
            turn, (place, _) = from_quaternion(x[:, free.turn[1]].T), free.origin
            velocities[:, place] = rotate_back(turn, m[:, place].T).T
            forces[:, place] = rotate_back(turn, f[:, place].T).T
            if free.stiffness:  # along the world's axes, and a rotation vector
                offset = x[:, free.origin[1]] - free.rest[:3]
                twist = quaternion_product(free.rest[3:, None], x[:, free.turn[1]].T)
                forces[:, place] -= free.stiffness * rotate_back(turn, offset.T).T
                forces[:, free.turn[0]] -= free.stiffness * rotation_vector(twist).T
            if free.damping:
                for part in (place, free.turn[0]):
                    forces[:, part] -= free.damping * velocities[:, part]
            if free.armature:  # acts on world velocities, which Pinocchio's turn with it
                forces[:, place] -= free.armature * free.carried(velocities)
            turns.append(turn)
        q = self._configuration(x)
        if self._lifts:
            forces = forces + np.array([self._lifted(row) for row in q])
        rows_of_states = zip(q, velocities, forces, strict=True)
        if self._along is None:
            aba, model, data = self._aba, self._model, self._data
            a = np.array([aba(model, data, *row) for row in rows_of_states])
        else:
            a = self._accelerations_with_mimics(rows_of_states, self._along)
        for free, turn in zip(self._frees, turns, strict=True):
            inward = a[:, free.origin[0]] + free.carried(velocities)
            a[:, free.origin[0]] = rotate(turn, inward.T).T
        return a

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
        q = np.empty((*x.shape[:-1], self._model.nq))
        for free in self._frees:
            turn = x[:, free.turn[1]]
            q[:, free.place] = x[:, free.origin[1]]
            q[:, free.quaternion] = np.roll(
                turn / np.linalg.norm(turn, axis=1, keepdims=True), -1, 1
            )
        joints = x[..., self.layout.singles_x] - self._refs
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
        for q in self._configuration(self.layout.to_state(z, 0 * z)[0]):
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
