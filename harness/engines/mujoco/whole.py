"""MuJoCo with all its forces, for single steps from given states."""

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from physics_crosscheck.reference.mechanism.laws import ContactPoint
from ..protocol import Array, EngineStep, WholeModel, WholeState
from .smooth import Warnings
from .state import States

_EXACT: Mapping[str, float] = MappingProxyType({
    "solver": 2, "tolerance": 0.0, "iterations": 200, "ls_iterations": 200,
    "ls_tolerance": 1e-12, "noslip_iterations": 0, "jacobian": 0,
})  # fmt: skip
"""Options of an exact solver: Newton's, with dense matrices (4.0.0 has a wrong sparse Hessian)."""

_ONE_STAGE = ("mjINT_EULER", "mjINT_IMPLICIT", "mjINT_IMPLICITFAST")
"""Integrators whose step leaves the accelerations and forces at its start in place."""

_VALUE_NAMES = {"solver": "Newton", "jacobian": "dense"}

_EDITS = (
    *(f"{name}={_VALUE_NAMES.get(name, f'{value:g}')}" for name, value in _EXACT.items()),
    "warmstart=disable",
    "island=disable",
)


def _uncovered(model: Any) -> Iterator[str]:
    """Yield features of the engine that no law here describes, and that are switched off."""
    import mujoco

    if model.opt.noslip_iterations:
        yield "noslip iterations"
    if model.opt.solver != mujoco.mjtSolver.mjSOL_NEWTON:
        yield "the error of its own solver"


def _frame_errors(m: Any) -> tuple[float, float]:
    """Return how far geoms are from the frames that MuJoCo takes for theirs, m and rad.

    It replaces frames by those of bodies or their inertias within 1e-6 (`geom_sameframe`).
    """
    body, same = np.array(m.geom_bodyid), np.array(m.geom_sameframe).astype(int)
    inertial = np.isin(same, (2, 4))[:, None]
    place = np.where(inertial, np.array(m.body_ipos)[body], 0.0)
    turn = np.where(inertial, np.array(m.body_iquat)[body], [1.0, 0.0, 0.0, 0.0])
    off = np.linalg.norm(m.geom_pos - place, axis=1)[np.isin(same, (1, 2))]
    sign = np.sign(np.sum(m.geom_quat * turn, axis=1, keepdims=True))
    turned = np.linalg.norm(m.geom_quat - sign * turn, axis=1)
    return float(np.max(off, initial=0.0)), float(np.max(2 * turned[same > 0], initial=0.0))


class MujocoWhole(WholeModel):
    """A compiled model as its file states it, with an exact solver.

    Attributes:
        solver: options of the solver of `evaluate`, by name; the file's are `shipped`.
    """

    point_share = 0.5

    def __init__(self, model: Any) -> None:
        import mujoco

        self.uncovered = tuple(_uncovered(model))
        self.solver: Mapping[str, object] = _EXACT
        self.shipped = {name: getattr(model.opt, name) for name in _EXACT}
        flags = mujoco.mjtDisableBit
        model.opt.disableflags |= int(flags.mjDSBL_WARMSTART) | int(flags.mjDSBL_AUTORESET)
        model.opt.disableflags |= int(getattr(flags, "mjDSBL_ISLAND", 0))
        model.opt.enableflags &= ~int(getattr(mujoco.mjtEnableBit, "mjENBL_SLEEP", 0))
        self.edits = _EDITS
        self._model, self._data, self._states = model, mujoco.MjData(model), States(model)
        self.coordinates, self.step = self._states.names, float(model.opt.timestep)
        self.controls, self.activations = int(getattr(model, "nctrl", model.nu)), int(model.na)
        self.frame_errors = _frame_errors(model)

    @property
    def starts(self) -> Iterator[WholeState]:
        """The drawn configuration and all keyframes."""
        m = self._model
        rows = [(m.qpos0, np.zeros(self.controls), np.zeros(m.na))]
        rows += [(m.key_qpos[k], m.key_ctrl[k], m.key_act[k]) for k in range(m.nkey)]
        for qpos, controls, activations in rows:
            z = np.array(self._states.coordinates_of(np.array(qpos, dtype=float), None))
            yield WholeState(z, np.zeros(m.nv), np.array(controls), np.array(activations))

    def moved(self, state: WholeState, steps: int) -> WholeState:
        """Return the state after some steps."""
        import mujoco

        self._set(state, self.shipped)  # an exact solver would take most of the time
        # Without a callback, MuJoCo writes a log into the user's folder.
        with Warnings().collecting():
            for _ in range(steps):
                mujoco.mj_step(self._model, self._data)
        z, m, activations = self._read(state.z)
        return WholeState(z, m, state.controls, activations)

    def evaluate(self, state: WholeState) -> EngineStep:
        """Return the accelerations, contacts and the next state."""
        with Warnings().collecting():
            return self._evaluated(state)

    def set_step(self, h: float) -> bool:
        """Set the option."""
        self._model.opt.timestep = self.step = h
        return True

    def contacts(self, state: WholeState) -> tuple[ContactPoint, ...]:
        """Return the contacts at a state, without solving for their forces."""
        import mujoco

        with Warnings().collecting():
            self._set(state, self.solver)
            mujoco.mj_fwdPosition(self._model, self._data)
        return tuple(self._contacts())

    def _evaluated(self, state: WholeState) -> EngineStep:
        import mujoco

        m, d = self._model, self._data
        self._set(state, self.solver)
        one_stage = mujoco.mjtIntegrator(m.opt.integrator).name in _ONE_STAGE
        (mujoco.mj_step if one_stage else mujoco.mj_forward)(m, d)
        moved = np.zeros(m.nv)
        mujoco.mj_mulM(m, d, moved, d.qacc)
        acceleration, contacts = d.qacc.copy(), tuple(self._contacts())
        unbalanced = d.qfrc_smooth + d.qfrc_constraint - moved
        if not one_stage:
            self._set(state, self.solver)
            mujoco.mj_step(m, d)
        z, velocity, activations = self._read(state.z)
        return EngineStep(
            acceleration=acceleration,
            unbalanced=unbalanced,
            contacts=contacts,
            after=WholeState(z, velocity, state.controls, activations),
        )

    def _contacts(self) -> Iterator[ContactPoint]:
        for contact in self._data.contact:
            first, other = map(int, contact.geom)
            yield ContactPoint(
                surfaces=(first, other),
                distance=float(contact.dist),
                position=np.array(contact.pos),
                frame=np.array(contact.frame).reshape(3, 3),
            )

    def _set(self, state: WholeState, options: Mapping[str, object]) -> None:
        import mujoco

        for name, value in options.items():
            setattr(self._model.opt, name, value)
        mujoco.mj_resetData(self._model, self._data)
        self._data.qpos[:], self._data.qvel[:] = self._states.qpos(state.z), state.m
        self._data.ctrl[:], self._data.act[:] = state.controls, state.activations

    def _read(self, near: Array) -> tuple[Array, Array, Array]:
        """Return coordinates near to others, velocities and activations."""
        qpos = np.array(self._data.qpos)
        z = np.array(self._states.coordinates_of(qpos, near))
        return z, self._data.qvel.copy(), self._data.act.copy()
