"""A tree of slides and hinges in an engine, from any format: its rollouts, the forces of springs
and dampers that an adapter adds, and mimic joints that it constrains through the mass matrix.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from physics_crosscheck.harness.documents.document import Mimic
from physics_crosscheck.reference.mechanism.rotations import place_names, rotation_names
from .protocol import (
    Array,
    EngineError,
    Force,
    LoadedModel,
    ModelSpec,
    Spring,
    StateForce,
    WholeModel,
    WholeState,
)
from .runge_kutta import BALL, FREE, Accelerations, JointLayout, RungeKutta
from .source import engine_errors


def leader_matrix(mimics: Sequence[Mimic], names: Sequence[str], place: object) -> Array:
    """Return G of v = G v', (n, n - followers), where v' are the velocities of the leaders.

    Args:
        mimics: which joint follows which.
        names: of all n coordinates.
        place: the file, for messages.

    Raises:
        EngineError: if a follower or leader is not a moving joint, or the couplings form a loop.
    """
    by = {mimic.joint: mimic for mimic in mimics}
    for mimic in mimics:
        for joint in (mimic.leader, mimic.joint):
            if joint not in names:
                raise EngineError(f"{place}: <mimic> names {joint!r}, which is not a moving joint")
    lead = [name for name in names if name not in by]
    rows = np.zeros((len(names), len(lead)))
    for row, name in zip(rows, names, strict=True):
        share, joint_name = 1.0, name
        for _ in names:
            if joint_name not in by:
                break
            share, joint_name = share * by[joint_name].multiplier, by[joint_name].leader
        if joint_name in by:
            raise EngineError(f"{place}: <mimic> of {name!r} leads back to it")
        row[lead.index(joint_name)] = share
    return rows


def constrained_accelerations(mass: Array, force: Array, along: Array) -> Array:
    """Solve M a = force subject to v = along v'; the constraint forces do no work.

    Args:
        mass: (..., n, n).
        force: (..., n).
        along: by `leading`, (n, n').
    """
    led = _solve(along.T @ mass @ along, (along.T @ force[..., None])[..., 0])
    result: Array = (along @ led[..., None])[..., 0]
    return result


def _solve(a: Array, b: Array) -> Array:
    """Solve A x = b, (..., k); faster than numpy's solver for up to two leaders."""
    if b.shape[-1] == 1:
        return b / a[..., 0]
    if b.shape[-1] > 2:
        return np.asarray(np.linalg.solve(a, b[..., None])[..., 0], dtype=np.float64)
    # Symmetric and positive definite, so elimination needs no pivots.
    first, both, last = a[..., 0, 0], a[..., 0, 1], a[..., 1, 1]
    share = both / first
    led = np.empty_like(b)
    led[..., 1] = second = (b[..., 1] - share * b[..., 0]) / (last - share * both)
    led[..., 0] = b[..., 0] / first - share * second
    return led


class SpringForces:
    """Forces of springs of a sidecar and of joints, along all joints.

    Args:
        springs: the declared springs.
        joints: names of the n joints, in the engine's order.
        place: the file, for messages.
        damping: of each joint, (n,), for engines that ignore it.
        pushed: constant forces on the joints, (n,), N or N m.

    Attributes:
        empty: whether there are no forces.

    Raises:
        EngineError: if a spring names something other than a moving joint.
    """

    def __init__(
        self,
        springs: Sequence[Spring],
        joints: Sequence[str],
        place: object,
        damping: Array | None = None,
        pushed: Array | None = None,
    ) -> None:
        along = np.zeros((len(springs), len(joints)))
        for row, spring in zip(along, springs, strict=True):
            for name, share in spring.joints.items():
                if name not in joints:
                    raise EngineError(
                        f"{place}: a spring names {name!r}, which is not a moving joint"
                    )
                row[joints.index(name)] += share
        k = np.array([one.stiffness for one in springs], dtype=float)
        c = np.array([one.damping for one in springs], dtype=float)
        rest = np.array([one.rest for one in springs], dtype=float)
        joint_damping = np.zeros(len(joints)) if damping is None else damping
        self._stiffness = along.T @ (k[:, None] * along)
        self._damping = along.T @ (c[:, None] * along) + np.diag(joint_damping)
        self._k, self._c = self._stiffness.diagonal(), self._damping.diagonal()
        self._apart = all(
            np.array_equal(np.diag(a.diagonal()), a) for a in (self._stiffness, self._damping)
        )
        push = np.zeros(len(joints)) if pushed is None else pushed
        self._at_zero = along.T @ (k * rest) + push
        self._joint_damping = None if springs or push.any() else joint_damping
        self.empty = self._joint_damping is not None and not joint_damping.any()

    def forces(self, q: Array, v: Array) -> Array:
        """Return forces along joints at positions and velocities, (..., n) each."""
        if self._joint_damping is not None:
            return -self._joint_damping * v
        if self._apart:
            apart: Array = self._at_zero - (self._k * q + self._c * v)
            return apart
        # Sum along the last axis: the last digits of a matrix product depend on the number of rows.
        contributions = self._stiffness * q[..., None, :] + self._damping * v[..., None, :]
        force: Array = self._at_zero - contributions.sum(axis=-1)
        return force


class Stepper(ABC):
    """A model in one state, advanced by steps; positions and velocities are (nz,) each."""

    @abstractmethod
    def reset(self, q: Array, v: Array) -> None:
        """Set a state."""

    @abstractmethod
    def position(self) -> Array:
        """Return the position."""

    @abstractmethod
    def state(self) -> tuple[Array, Array]:
        """Return positions and velocities."""

    @abstractmethod
    def step(self, h: float, force: Array | None) -> None:
        """Advance by h seconds, under constant forces on its coordinates."""

    def coast(self, h: float, n: int) -> None:
        """Advance by n steps without such forces."""
        for _ in range(n):
            self.step(h, None)


@np.errstate(all="ignore")  # a diverging motion is returned as it is
def rollout(
    stepper: Stepper, q: Array, v: Array, h: float, n: int, force: Force, every: int
) -> tuple[Array, Array]:
    """Return a rollout as in `Model.rollout`; after a non-finite state the rest is NaN."""
    out_q = np.full((len(q), n // every, q.shape[1]), np.nan)
    out_v = np.full_like(out_q, np.nan)
    for b in range(len(q)):
        if not (np.isfinite(q[b]).all() and np.isfinite(v[b]).all()):
            continue
        stepper.reset(q[b], v[b])
        for row in range(n // every):
            if force is None:
                stepper.coast(h, every)
            else:
                for i in range(row * every, (row + 1) * every):
                    stepper.step(h, held(stepper, force, b, i))
            out_q[b, row], out_v[b, row] = stepper.state()
            if not (np.isfinite(out_q[b, row]).all() and np.isfinite(out_v[b, row]).all()):
                break
    return out_q, out_v


def held(stepper: Stepper, force: Array | StateForce, b: int, i: int) -> Array:
    """Return the forces on state b over step i, (nz,)."""
    if isinstance(force, StateForce):
        position, u = stepper.position().tolist(), force.inputs[b, i].tolist()
        return np.array(force.evaluate(position, u), dtype=float)
    row: Array = force[b, i]
    return row


@dataclass(frozen=True, kw_only=True)
class Weight:
    """A weight that gravity compensation cancels on an engine's body.

    Attributes:
        body: its name in the engine.
        centre: point of application, m in the body's frame.
        mass: kg; negative to add weight.
    """

    body: str
    centre: tuple[float, ...]
    mass: float


class TreeModel(LoadedModel):
    """A tree, fixed or floating; a subclass reads it and creates the `stepper`.

    Args:
        spec: the file, with step and gravity among its settings.
        title: of the engine.
        settings: all of them, including defaults.

    Attributes:
        floats: whether a root is free.
        root: the name of its joint, for a format with a single root.
        layout: of the joints.
        springs: of the file and of its sidecar.
        mimics: joints that follow others.
        pushes: constant forces on joints, by name, N or N m.
        lifts: weights that gravity compensation cancels.
    """

    stepper: Stepper | RungeKutta
    forward: Accelerations | None = None
    """The engine's accelerations, if no soft constraint acts on joints."""
    floats: bool = False
    root: str = ""
    layout: JointLayout
    springs: tuple[Spring, ...] = ()
    mimics: tuple[Mimic, ...] = ()
    pushes: Mapping[str, float] = {}
    lifts: tuple[Weight, ...] = ()

    def __init__(self, spec: ModelSpec, title: str, settings: Mapping[str, object]) -> None:
        self.path, self.title, self.settings = spec.path, title, dict(settings)
        self.step = float(settings["step"])  # type: ignore[arg-type]  # checked
        self.gravity = tuple(map(float, settings["gravity"]))  # type: ignore[call-overload]

    @property
    def frees(self) -> tuple[str, ...]:
        """Names of free joints, which place roots in the world."""
        return (self.root,) if self.floats else ()

    def name(
        self, joints: Sequence[str], damping: Array | None = None, sizes: Sequence[int] = ()
    ) -> SpringForces:
        """Set the names of joints, in the engine's order.

        Args:
            joints: their names; without `sizes` those of slides and hinges, after a free root.
            damping: of each slide and hinge, if the spring forces include it.
            sizes: number of coordinates of each joint, as in `JointLayout`.

        Returns:
            The forces of springs and constant inputs along slides and hinges.
        """
        if not sizes:
            free = [self.root] if self.floats else []
            sizes, joints = [FREE] * len(free) + [1] * len(joints), [*free, *joints]
        self.layout, names = JointLayout(sizes), list[str]()
        for joint, size in zip(joints, sizes, strict=True):
            if size == FREE and joint not in self.frees:
                raise EngineError(f"{self.path}: joint {joint!r} is neither a slide nor a hinge")
            names += place_names(joint) if size == FREE else ()
            each = (joint,) if size == 1 else (f"{joint}:1", f"{joint}:2")
            names += rotation_names(joint) if size >= BALL else each
        self.coordinates = tuple(names)
        if not self.coordinates:
            raise EngineError(f"{self.path}: it has no moving joint")
        singles = [names[i] for i in self.layout.singles]
        pushed = np.array([self.pushes.get(joint, 0.0) for joint in singles])
        return SpringForces(self.springs, tuple(singles), self.path, damping, pushed)

    @property
    def stated_limits(self) -> Array:
        """Position limits of the file, (nz, 2); infinite for joints without one."""
        raise NotImplementedError

    def accelerations(self, z: Array, w: Array, force: Array) -> Array | None:
        """Return accelerations by the engine's forward dynamics."""
        if self.forward is None:
            return None
        with engine_errors(self.path, self.title), np.errstate(all="ignore"):
            return self.forward(*self.layout.to_state(z, w), force)

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """Step through a rollout: one state after the other, or all together with RK4."""
        with engine_errors(self.path, self.title):
            if isinstance(self.stepper, RungeKutta):
                return self.stepper.rollout(q, v, h, n, force, every)
            return rollout(self.stepper, q, v, h, n, force, every)


class UndrivenWhole(WholeModel):
    """A tree without drives, with its other forces, for single steps.

    Args:
        model: the loaded model.
        uncovered: parts of the file that have no law here.

    Attributes:
        home: the drawn configuration, (nz,).
    """

    controls = activations = 0
    speed = 0.4

    def __init__(self, model: TreeModel, uncovered: tuple[str, ...]) -> None:
        self._model, self.uncovered, self.home = model, uncovered, model.home
        self.coordinates, self.step = model.coordinates, model.step

    @property
    def starts(self) -> Iterator[WholeState]:
        """The drawn configuration."""
        yield WholeState(self.home, np.zeros(len(self.home)), self.home[:0], self.home[:0])
