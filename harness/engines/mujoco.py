"""MuJoCo, on MJCF and on URDF."""

from __future__ import annotations

import contextlib
import importlib.metadata
import importlib.util
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from harness.engines.protocol import Array, EngineError, Force, ModelSpec, StateForce, within
from harness.engines.urdf import joint_springs, read_urdf

_ORDERS = {"mjINT_EULER": 1, "mjINT_IMPLICIT": 1, "mjINT_IMPLICITFAST": 1, "mjINT_RK4": 4}


@dataclass(frozen=True)
class MujocoEngine:
    """Adapter of MuJoCo (Todorov, Erez and Tassa 2012)."""

    name: str = "mujoco"
    formats: tuple[str, ...] = (".xml", ".urdf")
    capabilities: tuple[str, ...] = (
        "MJCF and URDF", "slides and hinges", "joint springs and dampers",
        "springs on joint combinations", "armature", "joint equalities (soft), URDF mimic",
        "batched rollouts in C",
    )  # fmt: skip

    def version(self) -> str | None:
        """Version of the installed package, or None."""
        if importlib.util.find_spec("mujoco") is None:
            return None
        return importlib.metadata.version("mujoco")

    def load(self, spec: ModelSpec) -> MujocoModel:
        """Load an MJCF or URDF file."""
        import mujoco

        try:
            text = spec.path.read_text(encoding="utf-8")
            tree = mujoco.MjSpec.from_file(str(spec.path))
            if spec.path.suffix == ".urdf":
                _complete_urdf(tree, spec, text)
            _apply_settings(tree, spec)
            model = tree.compile()
        except (ValueError, OSError, UnicodeDecodeError, mujoco.FatalError) as error:
            raise EngineError(f"{spec.path}: MuJoCo can't load it: {error}") from None
        for joint in range(model.njnt):
            kind = mujoco.mjtJoint(model.jnt_type[joint])
            if kind not in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
                raise EngineError(
                    f"{spec.path}: joint {model.joint(joint).name!r} is a"
                    f" {kind.name[6:].lower()} joint; only slides and hinges are supported so far"
                )
        if not model.njnt:
            raise EngineError(f"{spec.path}: it has no moving joint")
        if model.nu or model.na:
            raise EngineError(f"{spec.path}: it has actuators; inputs are applied to joints here")
        # A run that blows up must stay blown up: the automatic reset would return zeros, and every
        # rung would agree with itself.
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        # The step is read now: every rollout sets another.
        return MujocoModel(model, str(spec.path), float(model.opt.timestep))


def _complete_urdf(tree: Any, spec: ModelSpec, text: str) -> None:
    """Add what a URDF cannot say to MuJoCo: Gazebo's joint springs, and the sidecar's springs."""
    robot = read_urdf(text, spec.path)
    for joint, (stiffness, rest) in joint_springs(robot, spec.path).items():
        element = tree.joint(joint)
        if element is None:
            raise EngineError(f"{spec.path}: <gazebo reference={joint!r}> names no moving joint")
        element.stiffness = _spring_terms(stiffness)
        element.springref = rest
    for index, spring in enumerate(spec.springs):
        tendon = tree.add_tendon(name=f"crosscheck_spring_{index}")
        for joint, coefficient in spring.joints.items():
            tendon.wrap_joint(joint, coefficient)
        tendon.stiffness = _spring_terms(spring.stiffness)
        tendon.damping = _spring_terms(spring.damping)
        tendon.springlength = [spring.rest, spring.rest]


def _spring_terms(value: float) -> Any:
    """MuJoCo 4 takes a polynomial for stiffness and damping, 3 a number."""
    import mujoco

    if int(mujoco.__version__.split(".")[0]) >= 4:
        return [value, 0.0, 0.0]
    return value


def _apply_settings(tree: Any, spec: ModelSpec) -> None:
    settings = dict(spec.settings)
    if "step" in settings:
        tree.option.timestep = settings.pop("step")
    if "gravity" in settings:
        tree.option.gravity = settings.pop("gravity")
    if "integrator" in settings:
        import mujoco

        name = f"mjINT_{str(settings.pop('integrator')).upper()}"
        if not hasattr(mujoco.mjtIntegrator, name):
            raise EngineError(f"{spec.path}.toml: MuJoCo has no integrator {name[6:].lower()!r}")
        tree.option.integrator = getattr(mujoco.mjtIntegrator, name)
    for key in ("solref", "solimp"):
        if key in settings:
            value = settings.pop(key)
            for equality in tree.equalities:
                setattr(equality, key, value)
    if settings:
        names = ", ".join(sorted(settings))
        raise EngineError(f"{spec.path}.toml: MuJoCo has no setting {names}")


@dataclass(frozen=True)
class MujocoModel:
    """A compiled model of slides and hinges, whose state is (qpos, qvel)."""

    model: Any
    path: str
    step: float

    @cached_property
    def coordinates(self) -> tuple[str, ...]:
        """Joint names, in the order of qpos."""
        return tuple(self.model.joint(i).name for i in range(self.model.njnt))

    @property
    def home(self) -> Array:
        """Positions as the file draws the mechanism, (nz,)."""
        return np.array(self.model.qpos0, dtype=float)

    @property
    def reach(self) -> Array:
        """Where positions may be drawn, (nz, 2): limits, a turn of a hinge, 1 m of a slide."""
        import mujoco

        hinge = np.array(self.model.jnt_type) == mujoco.mjtJoint.mjJNT_HINGE
        half = np.where(hinge, np.pi, 1.0)
        free = np.stack([self.home - half, self.home + half], axis=1)
        limited = np.array(self.model.jnt_limited, dtype=bool)
        return within(free, np.where(limited[:, None], self.model.jnt_range, free))

    @property
    def gravity(self) -> tuple[float, ...]:
        """Gravity of the model, m/s^2."""
        return tuple(float(component) for component in self.model.opt.gravity)

    @property
    def remedies(self) -> dict[str, dict[str, object]]:
        """What stiffens equalities: as much as the step allows, and settled after one."""
        if not self.model.neq:
            return {}
        stiff = {"solref": [1e-6, 0.5], "solimp": [0.9999, 0.9999, 0.001, 0.5, 2]}
        return {"soft equality (solref, solimp)": {**stiff}}

    @cached_property
    def integrator(self) -> str:
        """Name of the integrator, without its prefix."""
        import mujoco

        name: str = mujoco.mjtIntegrator(self.model.opt.integrator).name
        return name.removeprefix("mjINT_").lower()

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """RK4 keeps order 4 until an input is held over the step; the others have order 1."""
        order = _ORDERS.get(f"mjINT_{self.integrator.upper()}", 1)
        return (1 if varying_input else order), 1

    @cached_property
    def _data(self) -> Any:
        import mujoco

        return mujoco.MjData(self.model)

    @cached_property
    def _rollout(self) -> Any:
        from mujoco import rollout

        return rollout.Rollout(nthread=0)

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """Batched in C (`mujoco.rollout`), each state with a fresh warm start."""
        import mujoco

        if isinstance(force, StateForce):
            return self._step_by_state(q, v, h, n, force, every)
        self.model.opt.timestep = h
        # A rollout without controls keeps the forces that an earlier one left in its data.
        mujoco.mj_resetData(self.model, self._data)
        batch, size = q.shape
        # The full physics state is (time, qpos, qvel) for slides and hinges without activations.
        state = np.zeros((batch, 1 + 2 * size))
        state[:, 1 : 1 + size], state[:, 1 + size :] = q, v
        with _quiet():
            states, _ = self._rollout.rollout(
                self.model,
                self._data,
                state,
                force,
                nstep=n,
                control_spec=int(mujoco.mjtState.mjSTATE_QFRC_APPLIED),
            )
        # A run that blows up ends early, and its last state fills the rest: its clock stands still.
        states[states[:, :, 0] < h * (np.arange(n) + 0.5)] = np.nan
        kept = states[:, every - 1 :: every]
        return kept[:, :, 1 : 1 + size].copy(), kept[:, :, 1 + size :].copy()

    def _step_by_state(
        self, q: Array, v: Array, h: float, n: int, force: StateForce, every: int
    ) -> tuple[Array, Array]:
        import mujoco

        self.model.opt.timestep = h
        data = self._data
        out_q = np.empty((len(q), n // every, q.shape[1]))
        out_v = np.empty_like(out_q)
        with _quiet():
            for b in range(len(q)):
                mujoco.mj_resetData(self.model, data)
                data.qpos[:], data.qvel[:] = q[b], v[b]
                held = force.inputs[b].tolist()
                for i in range(n):
                    data.qfrc_applied[:] = force.at(data.qpos.tolist(), held[i])
                    mujoco.mj_step(self.model, data)
                    if (i + 1) % every == 0:
                        out_q[b, i // every], out_v[b, i // every] = data.qpos, data.qvel
        return out_q, out_v


@contextlib.contextmanager
def _quiet() -> Any:
    """Overflow of a motion that blows up shows in the states; MuJoCo's log file is not wanted."""
    import mujoco

    mujoco.set_mju_user_warning(lambda _: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(None)
