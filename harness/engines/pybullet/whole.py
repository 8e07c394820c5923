"""PyBullet with limits, motors and contacts with a floor, for single steps from given states.

Measured with PyBullet 3.2.7, and read in its source: limits recover 0.2 of a violation per step,
none beyond 0.04; contacts 0.08, with a slop of 1e-5 m; nothing bounces below 0.2 m/s; frictions and
restitutions of two links are multiplied. `<contact_erp>` and `<contact_cfm>` have no effect, and
neither have `<limit velocity>` and `<dynamics friction>`.

A fixed root meets no floor: a contact that cannot move along one of its axes has a residual of 0/0,
which hides the others, so that Bullet may stop after its first iteration.
"""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from physics_crosscheck.reference.mechanism.laws import HardSurface, ImpulseContact, ImpulseRules
from physics_crosscheck.reference.mechanism.rotations import (
    coordinate_rate,
    from_quaternion,
    unit_quaternion,
)
from ..protocol import Array, EngineError, EngineStep, LoadedModel, WholeModel, WholeState
from .base import COUNT, Base
from .stepper import BodyStepper, add_floor, forget_contacts, link_places

WHOLE_SETTINGS = {
    "smooth": False,
    "exact_axes": True,
    "unit_axes": True,
    "bare_links": False,
    "scaled_inertias": False,
    "couplings": False,
}
"""Settings of the adapter: with limits and shapes, and without PyBullet's rounding of the file."""

GAIN = 0.1
"""Position gain of a motor: PyBullet's default."""

ITERATIONS = 999, 2000
"""Numbers of solver iterations; the second one shows what the first one leaves."""

CONVERGED = 1e-9
"""Largest effect of more iterations, as a share of the largest change or impulse."""

_LINK = HardSurface(friction=0.5)
_FLOOR = HardSurface(friction=1.0, restitution=1.0)

_EDITS = (
    "linearDamping=0", "angularDamping=0", "maxJointVelocity=1e300", "solverResidualThreshold=0",
    f"numSolverIterations={ITERATIONS[-1]}", "URDF_USE_INERTIA_FROM_FILE",
    "a floor of friction 1 and restitution 1 under a floating root",
    f"position motors of gain {GAIN:g} with the file's efforts; motors without an effort off",
)  # fmt: skip


class PybulletWhole(WholeModel):
    """A loaded URDF with its limits and shapes, its motors, and a floor.

    Args:
        model: the loaded model, with `WHOLE_SETTINGS`.
        load: returns its body, which is loaded again if another model has replaced it, or `reload`.
    """

    activations = 0
    edits = _EDITS
    speed = 0.4  # above that at which contacts bounce
    point_share = 0.0
    shape_error = 1e-3  # the collision margin of its polyhedra

    def __init__(self, model: LoadedModel, load: Callable[..., BodyStepper]) -> None:
        import pybullet as p

        self._model, self._load = model, load
        self.coordinates, self.step = model.coordinates, model.step
        self._take(load())
        self._free = COUNT if self._base is not None else 0
        info = [p.getJointInfo(self._body, joint) for joint in self._joints]
        self._efforts = [max(0.0, one[10]) for one in info]
        self.controls = len(info)
        names = {index: name for name, index in link_places(self._body).items() if "link:" in name}
        self._links = sorted(names)
        self.uncovered = tuple(self._switch_off())
        self._add_floor()
        self.rules = ImpulseRules(
            step=self.step, limit_recovery=0.2, contact_recovery=0.08, friction_recovery=0.2,
            deepest=0.04, largest=100.0, slop=1e-5, bounce=0.2, gain=GAIN, drag=0.04, default=_LINK,
            floor=_FLOOR,
            controls=self.coordinates[self._free :],
            bodies=("", *(names[index].removeprefix("link:") for index in self._links)),
        )  # fmt: skip

    def _take(self, stepper: BodyStepper) -> None:
        self._stepper, self._body, self._joints = stepper, stepper.body, stepper.joints
        bases = [part for part, _ in stepper.turning if isinstance(part, Base)]
        if len(bases) < len(stepper.turning):
            raise EngineError("ball joints")
        self._base = bases[0] if bases else None
        self._floor = -1

    def _ensure_loaded(self) -> None:
        if (stepper := self._load()) is not self._stepper:
            self._take(stepper)
            _ = tuple(self._switch_off())
            self._add_floor()

    def _switch_off(self) -> Iterator[str]:
        """Switch off friction without a law; yield what acted.

        PyBullet keeps its impulses, by the first iterations, of contacts that have none in the end.
        """
        import pybullet as p

        dynamics = [p.getDynamicsInfo(self._body, index) for index in self._links]
        for index in self._links:
            p.changeDynamics(self._body, index, rollingFriction=0, spinningFriction=0)
        for name, place in (("rolling friction", 6), ("spinning friction", 7)):
            if any(one[place] for one in dynamics):
                yield name

    def _add_floor(self) -> None:
        import pybullet as p

        if self._base is None:
            return
        home = self._model.home
        self._set(WholeState(home, np.zeros(len(home)), np.full(self.controls, np.nan), home[:0]))
        self.floor = min(p.getAABB(self._body, index)[0][2] for index in self._links)
        self._floor = add_floor()

    def finds_exactly(self, first: str, other: str) -> bool:
        """Return False for cylinders: polyhedra with 32 sides."""
        return "cylinder" not in (first, other)

    @property
    def starts(self) -> Iterator[WholeState]:
        """The drawn configuration, twice with motors and twice without."""
        home = self._model.home
        for control in (0.0, 0.0, np.nan, np.nan):
            controls = np.full(self.controls, control)
            yield WholeState(home, np.zeros(len(home)), controls, home[:0])

    def moved(self, state: WholeState, steps: int) -> WholeState:
        """Return the state after some steps."""
        import pybullet as p

        self._set(state, ITERATIONS[0])
        p.setPhysicsEngineParameter(solverResidualThreshold=1e-7, numSolverIterations=50)
        for _ in range(steps):
            p.stepSimulation()
            if self._base is not None:
                self._base.position()  # continuous across turns
        return self._read(state, self._turn(state.z) if not steps else None)

    def evaluate(self, state: WholeState) -> EngineStep:
        """Return the mean acceleration of a step, its contacts and the next state."""
        import pybullet as p

        turn, effects = self._turn(state.z), []
        for iterations in ITERATIONS:
            self._set(state, iterations)
            p.stepSimulation()
            contacts, velocities = tuple(self._contacts()), self._velocities(turn)
            impulses = [self.step * one[3] for one in self._joint_states()]
            impulses += [size for contact in contacts for size in contact.impulse]
            effects.append((velocities, np.array(impulses)))
        (before, rough), (after, exact) = effects
        rest = np.abs(after - before) / self.step
        return EngineStep(
            acceleration=(after - state.m) / self.step,
            unbalanced=rest,
            contacts=contacts,
            after=self._read(state, turn),
            # Velocities may stand still while impulses of two rows that oppose each other grow.
            converged=_alike(before - state.m, after - state.m) and _alike(rough, exact),
        )

    def _set(self, state: WholeState, iterations: int = ITERATIONS[0]) -> None:
        import pybullet as p

        self._ensure_loaded()
        p.setPhysicsEngineParameter(
            fixedTimeStep=self.step, numSolverIterations=iterations, solverResidualThreshold=0.0
        )
        if self._floor >= 0:
            forget_contacts(self._floor, self.floor or 0.0)
        rates = state.m.copy()
        if self._free:
            rates[3:COUNT] = coordinate_rate(state.z[3:COUNT], state.m[3:COUNT])
        self._stepper.reset(state.z, rates)
        motors = zip(self._joints, state.controls, self._efforts, strict=True)
        for joint, target, effort in motors:
            on = bool(np.isfinite(target))
            p.setJointMotorControl2(
                self._body, joint, p.POSITION_CONTROL, targetPosition=target if on else 0.0,
                positionGain=GAIN, velocityGain=1.0, force=effort if on else 0.0,
            )  # fmt: skip

    def _turn(self, z: Array) -> Array:
        return from_quaternion(unit_quaternion(z[3:COUNT])) if self._free else np.eye(3)

    def _joint_states(self) -> Any:
        import pybullet as p

        return p.getJointStates(self._body, self._joints) if self._joints else ()

    def _velocities(self, turn: Array) -> Array:
        """Return stored velocities of a base with a given rotation, and of the joints."""
        import pybullet as p

        joints = [state[1] for state in self._joint_states()]
        if self._base is None:
            return np.array(joints)
        linear, spin = map(np.array, p.getBaseVelocity(self._body))
        origin = linear - np.cross(spin, turn @ self._base.center)
        return np.concatenate([origin, turn.T @ spin, joints])

    def _read(self, state: WholeState, turn: Array | None) -> WholeState:
        """Return the current state, with velocities for a given rotation of the base."""
        z = self._stepper.position()
        m = self._velocities(self._turn(z) if turn is None else turn)
        if not np.isfinite([*z, *m]).all():  # a NaN stays through every reset: no row acts again
            self._load(reload=True)
        return state._replace(z=z, m=m)

    def _contacts(self) -> Iterator[ImpulseContact]:
        """Yield contacts, from the second body to the first one, whose normal PyBullet reports."""
        import pybullet as p

        for point in p.getContactPoints():
            bodies = point[1:3]
            if self._body not in bodies:
                continue
            first, other = (
                0 if body == self._floor else 1 + self._links.index(link)
                for body, link in zip(bodies[::-1], point[3:5][::-1], strict=True)
            )
            yield ImpulseContact(
                surfaces=(first, other),
                distance=point[8],
                position=np.array(point[6]),
                other=np.array(point[5]),
                frame=np.array([point[7], point[11], point[13]]),
                impulse=self.step * np.array([point[9], point[10], point[12]]),
            )


def _alike(first: Array, second: Array) -> bool:
    """Return whether two arrays have the same size and, roughly, the same values."""
    if len(first) != len(second):
        return False
    size = np.max(np.abs(second), initial=0.0)
    return bool(np.max(np.abs(first - second), initial=0.0) <= CONVERGED * size)
