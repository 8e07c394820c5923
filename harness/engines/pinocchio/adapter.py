"""Pinocchio, on URDF: its accelerations, by the articulated-body algorithm, stepped here.

Pinocchio has no stepper. Its dynamics take no account of the dampers and the friction of joints
that it reads, nor of limits, contacts, and `<mimic>`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from harness.engines.attitude import cross, matrix
from harness.engines.following import held_accelerations, leading
from harness.engines.mistake import DefaultLeftOn
from harness.engines.pinocchio.reading import built, frames
from harness.engines.protocol import Array, EngineError, Model, ModelSpec
from harness.engines.remark import Remark
from harness.engines.runge_kutta import RungeKutta, to_state
from harness.engines.step_rule import StepRule
from harness.engines.urdf import UrdfReader
from harness.engines.urdf_copy import rewritten, without_shapes
from harness.engines.urdf_engine import FREE, UrdfEngine, UrdfModel
from harness.engines.urdf_sidecar import ROBOTS

DAMPING = "Pinocchio's leaving out of joints' dampers"
MIMICS = "Pinocchio's leaving out of <mimic>"

DEFAULTS: Mapping[str, bool] = MappingProxyType({
    **ROBOTS,
    # Whether dampers are added, as forces by velocity; Pinocchio's dynamics leave them out.
    "damping": True,
    # Whether joints are held to those that they follow; Pinocchio lets them go.
    "hold_mimics": False,
})  # fmt: skip

READER = UrdfReader(
    name="pinocchio",
    no_inertial="no mass and no moments",
    no_friction="Pinocchio",
    no_stops="Pinocchio",
)


class PinocchioEngine(UrdfEngine):
    """Adapter of Pinocchio (Carpentier et al. 2019)."""

    name = "pinocchio"
    title = "Pinocchio"
    package, distribution, extra = "pinocchio", "pin", "pinocchio"
    defaults = DEFAULTS
    capabilities = (
        "URDF", "slides and hinges, roots that float", "accelerations alone, stepped here by RK4",
        "joint dampers, springs on joint combinations and URDF mimic as added here",
    )  # fmt: skip
    unstated = "no step, since it takes none, and -9.81 m/s^2"
    ignores = frozenset({"dynamics@friction"})
    usual_mistakes = (
        DefaultLeftOn(
            name="Pinocchio's dampers not added", setting="damping", value=False, cause=DAMPING
        ),
    )

    def loaded(self, spec: ModelSpec) -> Model:
        """A URDF whose settings are in order."""
        return PinocchioModel(spec)


class PinocchioModel(UrdfModel):
    """A tree of slides and hinges, fixed or not, stepped by the classical rule of order four."""

    integrator = "Runge-Kutta 4"

    def __init__(self, spec: ModelSpec) -> None:
        super().__init__(spec, "Pinocchio", READER, DEFAULTS, (without_shapes,))
        with rewritten(self.declared.robot, spec.path, self.declared.changes) as path:
            self._model = built(path, spec.path, self.root if self.floats else "")
        self._model.gravity.linear = np.array(self.gravity)
        import pinocchio

        self._aba = pinocchio.aba
        self._data = self._model.createData()
        first = 2 if self.floats else 1
        names, joints = (list(one)[first:] for one in (self._model.names, self._model.joints))
        for name, one in zip(names, joints, strict=True):
            if one.nv != 1:
                raise EngineError(f"{spec.path}: joint {name!r} is no slide or hinge")
        # Cosine and sine stand for the angle of a hinge without limits.
        plain = [(i, one.idx_q) for i, one in enumerate(joints) if one.nq == 1]
        self._here, self._there = np.array(plain, dtype=int).reshape(-1, 2).T
        self._turns = [(i, one.idx_q) for i, one in enumerate(joints) if one.nq == 2]
        damping = np.array(self._model.damping)[self._model.nv - len(names) :]
        self._springs = self.name(names, damping if self.settings["damping"] else None)
        self._lost = not self.settings["damping"] and bool(damping.any())
        mimics = self.declared.mimics if self.settings["hold_mimics"] else ()
        self._along = leading(mimics, self.coordinates, spec.path) if mimics else None
        self._upper = np.triu(np.ones((self._model.nv, self._model.nv)))
        self._above = np.triu(self._upper, 1)
        self._straight = np.array_equal(self._there, np.arange(len(names))) and not self.floats
        own = not (self.floats or self._turns)
        self._permuted = np.argsort(self._there) if own else None
        bare = self._straight and self._along is None
        self.forward = self._plain if bare else self._accelerations
        self.stepper = RungeKutta(self.forward, self.floats)
        z = np.zeros((1, len(self.coordinates)))
        x, m = to_state(z, z) if self.floats else (z, z)
        if not np.isfinite(self.forward(x, m, z)).all():
            raise EngineError(f"{spec.path}: a joint moves nothing that has inertia")

    def _plain(self, x: Array, m: Array, f: Array) -> Array:
        """Of a tree of slides and hinges with limits, whose positions are Pinocchio's own."""
        pull = f if self._springs.empty else f + self._springs.at(x, m)
        aba, model, data = self._aba, self._model, self._data
        return np.array([aba(model, data, *row) for row in zip(x, m, pull, strict=True)])

    def _accelerations(self, x: Array, m: Array, f: Array) -> Array:
        """Of positions, velocities and forces, as `RungeKutta` has them."""
        free = FREE if self.floats else 0
        own, pull = m, f.copy()
        if not self._springs.empty:
            pull[:, free:] += self._springs.at(x[:, free + bool(free) :], m[:, free:])
        if self.floats:
            turn = matrix(x[:, 3:7])
            own = np.concatenate([_turned_back(turn, m[:, :3]), m[:, 3:]], axis=1)
            pull[:, :3] = _turned_back(turn, pull[:, :3])
        rows = zip(self._configuration(x), own, pull, strict=True)
        if self._along is None:
            aba, model, data = self._aba, self._model, self._data
            a = np.array([aba(model, data, *row) for row in rows])
        else:
            a = self._led(rows, self._along)
        if self.floats:
            inward = a[:, :3] + cross(own[:, 3:6], own[:, :3])
            a[:, :3] = (turn @ inward[..., None])[..., 0]
        return a

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
        """Positions (B, nq) as Pinocchio has them; the real part of a quaternion is its last."""
        if self._straight:
            return x
        if self._permuted is not None:
            return x[:, self._permuted]
        q, joints = np.empty((len(x), self._model.nq)), x
        if self.floats:
            turn = x[:, 3:7] / np.linalg.norm(x[:, 3:7], axis=1, keepdims=True)
            q[:, :3], q[:, 3:6], q[:, 6] = x[:, :3], turn[:, 1:], turn[:, 0]
            joints = x[:, 7:]
        q[:, self._there] = joints[:, self._here]
        for i, at in self._turns:
            q[:, at], q[:, at + 1] = np.cos(joints[:, i]), np.sin(joints[:, i])
        return q

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """Order 4, until an input is held over the step."""
        return (1 if varying_input else 4), 1

    @property
    def step_rule(self) -> StepRule:
        """All forces at each stage."""
        return StepRule(scheme="Runge-Kutta 4")

    @property
    def remedies(self) -> dict[str, Mapping[str, object]]:
        """What Pinocchio leaves out and the settings let stand, with what undoes it."""
        found: dict[str, Mapping[str, object]] = {DAMPING: {"damping": True}} if self._lost else {}
        if self.declared.mimics and self._along is None:
            found[MIMICS] = {"hold_mimics": True}
        return found

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """What the URDF says in vain, and dampers that are left out."""
        yield from super().remarks(z, w)
        if self._lost:
            yield Remark(
                message=f"{DAMPING}, by the setting damping: nothing brakes a joint",
                address="sidecar:settings.damping",
                shows_in=("damping",),
            )

    @property
    def places(self) -> tuple[str, ...]:
        """Links; and centres of mass of those with which no other moves as one."""
        return tuple(frames(self._model))

    def poses(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """By its forward kinematics."""
        import pinocchio as pin

        known, found = frames(self._model), []
        for q in self._configuration(to_state(z, 0 * z)[0] if self.floats else z):
            pin.framesForwardKinematics(self._model, self._data, q)
            at = [(self._data.oMf[known[place][0]], known[place][1]) for place in places]
            found.append([(frame.act(point), np.array(frame.rotation)) for frame, point in at])
        origins, turns = ([[pair[k] for pair in row] for row in found] for k in (0, 1))
        shape = len(z), len(places)
        return np.array(origins).reshape(*shape, 3), np.array(turns).reshape(*shape, 3, 3)


def _turned_back(turn: Array, of: Array) -> Array:
    """Vectors (B, 3) of the world's axes along those of what `turn` (B, 3, 3) has turned."""
    found: Array = (turn.swapaxes(1, 2) @ of[..., None])[..., 0]
    return found
