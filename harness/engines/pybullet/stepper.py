"""Motions and poses of a loaded body: torques are set from the state before each step."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from physics_crosscheck.reference.mechanism.rotations import from_quaternion
from ..protocol import Array, Force, StateForce
from .base import Ball, Base, real_first

BASE = -1
"""PyBullet's index of the root link."""


def link_places(body: int) -> dict[str, int]:
    """Return the index of each link by `link:name`, and of its centre of mass by `centre:name`."""
    import pybullet as p

    names = {p.getBodyInfo(body)[0].decode(): BASE}
    names |= {p.getJointInfo(body, i)[12].decode(): i for i in range(p.getNumJoints(body))}
    return {f"{kind}:{name}": i for kind in ("link", "centre") for name, i in names.items()}


def link_poses(
    body: int, joints: Sequence[int], places: Sequence[str], z: Array
) -> tuple[Array, Array]:
    """Return origins (K, F, 3) and rotations (K, F, 3, 3) of places at joint positions z, (K,
    nz).
    """
    import pybullet as p

    by_place = link_places(body)
    links = [by_place[place] for place in places]
    indices = sorted({*links} - {BASE})
    origins = np.empty((len(z), len(places), 3))
    turns = np.empty((*origins.shape, 3))
    for k, row in enumerate(z.tolist()):
        for joint, value in zip(joints, row, strict=True):
            p.resetJointState(body, joint, value, 0.0)
        # Each request computes and sends the whole body, so one asks for all links.
        answers = p.getLinkStates(body, indices, computeForwardKinematics=1) if indices else ()
        states = dict(zip(indices, answers, strict=True))
        states[BASE] = p.getBasePositionAndOrientation(body) + p.getDynamicsInfo(body, BASE)[3:5]
        for f, place in enumerate(places):
            origins[k, f], turns[k, f] = _pose(states[links[f]], place.startswith("centre:"))
    return origins, turns


def _pose(state: Sequence[Any], centre: bool) -> tuple[Array, Array]:
    """Return a link's frame, or its centre of mass with the link's axes, of its state.

    PyBullet returns a link's frame with seven digits, but the frame of its principal axes with all,
    in the world and in the link.
    """
    middle, inward = np.array(state[0]), np.array(state[2])
    turn = from_quaternion(real_first(state[1])) @ from_quaternion(real_first(state[3])).T
    return middle if centre else middle - turn @ inward, turn


FAR = 1e3
"""Depth at which a floor is out of reach, m."""


def add_floor() -> int:
    """Add a plane through the origin of friction 1 and restitution 1; return its body."""
    import pybullet as p

    floor = int(p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE)))
    p.changeDynamics(floor, -1, lateralFriction=1.0, restitution=1.0)
    return floor


def forget_contacts(floor: int, height: float = 0.0, speed: float = 0.0) -> None:
    """Remove the contacts that PyBullet keeps of earlier states; set the floor's height and speed.

    A static body with a velocity stays in place; only its contacts move.
    """
    import pybullet as p

    level = [0, 0, 0, 1]
    p.resetBasePositionAndOrientation(floor, [0.0, 0.0, height - FAR], level)
    p.performCollisionDetection()
    p.resetBasePositionAndOrientation(floor, [0.0, 0.0, height], level)
    p.resetBaseVelocity(floor, [speed, 0.0, 0.0])


ForceElement = tuple[list[tuple[int, float]], float, float, float]
"""A spring: coefficients by the joint's index, stiffness, damping, rest."""


class BodyStepper:
    """A body's slides and hinges, after the coordinates of its base and ball joints.

    Args:
        body: PyBullet's index of the body.
        joints: PyBullet's indices of slides and hinges.
        turning: a floating base, ball joints.
        springs: added by the adapter as torques.

    Attributes:
        body, joints: as above.
        turning: those parts, each with its rows.
    """

    def __init__(
        self,
        body: int,
        joints: Sequence[int],
        turning: Sequence[Base | Ball],
        springs: Sequence[ForceElement],
    ) -> None:
        self.body, self.joints, self._springs = body, joints, springs
        ends = np.cumsum([0, *(one.count for one in turning)]).tolist()
        self._free = ends[-1]
        self.turning = [(one, slice(*at)) for one, at in zip(turning, pairwise(ends), strict=True)]

    def reset(self, q: Array, v: Array) -> None:
        """Set a state, (nz,) each."""
        import pybullet as p

        for part, rows in self.turning:
            part.reset(q[rows], v[rows])
        for i, joint in enumerate(self.joints, start=self._free):
            p.resetJointState(self.body, joint, q[i], v[i])

    def position(self) -> Array:
        """Return the current positions, (nz,)."""
        import pybullet as p

        states = p.getJointStates(self.body, self.joints) if self.joints else ()
        turned = [part.position() for part, _ in self.turning]
        return np.concatenate([*turned, [state[0] for state in states]])

    def poses(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """Return origins (K, F, 3) and rotations (K, F, 3, 3) of places at positions z, (K, nz)."""
        if not self.turning:
            return link_poses(self.body, self.joints, places, z)
        poses = []
        for row in z:
            for part, rows in self.turning:
                part.reset(row[rows], np.zeros(part.count))
            poses.append(link_poses(self.body, self.joints, places, row[None, self._free :]))
        origins, turns = zip(*poses, strict=True)
        return np.concatenate(origins), np.concatenate(turns)

    def run(self, b: int, n: int, force: Force, every: int, out_q: Array, out_v: Array) -> None:
        """Take n steps from the current state, under the forces of the batch's row b.

        Write positions and velocities after every `every` steps to `out_q` and `out_v`.
        """
        import pybullet as p

        body, joints, free = self.body, self.joints, self._free
        states, step = p.getJointStates, p.stepSimulation
        by_state = force if isinstance(force, StateForce) else None
        held: Any = force[b].tolist() if isinstance(force, np.ndarray) else None
        inputs: Any = by_state.inputs[b].tolist() if by_state is not None else None
        driven = bool(self._springs) or force is not None
        feedback = bool(self._springs) or by_state is not None
        current: Any = states(body, joints) if feedback and joints else ()
        still = [0.0] * (len(joints) + free)
        for i in range(n):
            if driven:
                if by_state is not None:
                    turned = [one.position() for one, _ in self.turning]
                    position = [*np.concatenate([[], *turned]), *(s[0] for s in current)]
                    self._push(list(by_state.evaluate(position, inputs[i])), current)
                else:
                    self._push(list(held[i] if held is not None else still), current)
            step()
            sampled = (i + 1) % every == 0
            if (feedback or sampled) and joints:
                current = states(body, joints)
            if sampled:
                self._take(current, out_q[i // every], out_v[i // every])

    def _push(self, forces: list[float], current: Any) -> None:
        import pybullet as p

        for part, rows in self.turning:
            part.push(forces[rows])
        tau = forces[self._free :]
        for coefficients, stiffness, damping, rest in self._springs:
            stretch, rate = -rest, 0.0
            for j, c in coefficients:
                stretch += c * current[j][0]
                rate += c * current[j][1]
            force = stiffness * stretch + damping * rate
            for j, c in coefficients:
                tau[j] -= c * force
        if tau:
            p.setJointMotorControlArray(self.body, self.joints, p.TORQUE_CONTROL, forces=tau)

    def _take(self, current: Any, q: Array, v: Array) -> None:
        for part, rows in self.turning:
            q[rows] = part.position()
            v[rows] = part.rates(q[rows])
        for j, state in enumerate(current, start=self._free):
            q[j], v[j] = state[0], state[1]
