"""MJX, MuJoCo's dynamics in JAX: models that MuJoCo compiles, in compiled loops.

MuJoCo loads the file, with the same settings, remarks, rules and coordinates. Steps are batched.
Batches are padded to a few sizes, and the number of steps is an argument, so that one compilation
serves all step counts, step sizes and forces of a batch size.

MJX documents MuJoCo's law (MuJoCo's documentation, MJX, Feature parity). It chooses otherwise:

- `implicitfast` has the dampers of all joints, tendons and drives, also across branches and at
  limits, and no derivative of inertial forces (`derivative.py`);
- `connect` and `weld` lack the term J-dot v (`constraint.py`);
- friction coefficients of geoms have no lower bound (`collision_driver.py`);
- it detects contacts by functions of its own, and holds a slot for each that may occur.
"""

import importlib.metadata
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from physics_crosscheck.reference.mechanism.laws import ContactPoint, Laws
from ..protocol import (
    Array,
    DefaultLeftOn,
    EngineError,
    EngineStep,
    Force,
    LeftOut,
    ModelSpec,
    Sample,
    StateForce,
    WholeState,
)
from ..source import engine_errors
from .adapter import MujocoEngine, MujocoModel
from .pulls import powers
from .smooth import states_move
from .whole import MujocoWhole

_EXACT: Mapping[str, float] = MappingProxyType({
    "solver": 2, "tolerance": 0.0, "iterations": 100, "ls_iterations": 50, "jacobian": 0,
})  # fmt: skip
"""Options of an exact solver: Newton's, with dense matrices."""

_EDITS = (
    "solver=Newton", "tolerance=0", "iterations=100", "ls_iterations=50", "jacobian=dense",
    "warmstart=disable",
)  # fmt: skip


class MjxWhole(MujocoWhole):
    """A compiled model that JAX steps in 64 bits; MuJoCo draws its states."""

    peer = "MuJoCo"

    def __init__(self, model: Any) -> None:
        import jax
        from mujoco import mjx

        super().__init__(model)
        self.edits = _EDITS
        for name, value in _EXACT.items():
            setattr(model.opt, name, value)
        with jax.enable_x64(True):
            device = mjx.put_model(model)
            parts, make = jax.tree_util.tree_flatten((device, mjx.make_data(device)))
            self._parts, self._step = tuple(parts), _stepper(make)

    def finds_exactly(self, first: str, other: str) -> bool:
        """Return False for axes of capsules, which are longer, and boxes, which keep four corners.

        Source: `closest_segment_point` in `math.py`, `plane_convex` in `collision_convex.py`.
        """
        kinds = {first, other}
        return kinds <= {"plane", "sphere"} or kinds == {"plane", "capsule"}

    def peer_contacts(self, state: WholeState) -> tuple[ContactPoint, ...]:
        """Return the contacts by MuJoCo's own functions."""
        return super().contacts(state)

    def contacts(self, state: WholeState) -> tuple[ContactPoint, ...]:
        """Return the contacts by MJX."""
        return self.evaluate(state).contacts

    def applied(self, laws: Laws) -> Laws:
        """Return the laws with the choices of MJX."""
        fast = laws.integrator == "implicitfast"
        integrator = "implicit dampers" if fast else laws.integrator
        return replace(laws, integrator=integrator, least_friction=0.0, drift=False)

    def evaluate(self, state: WholeState) -> EngineStep:
        """Return the accelerations, contacts and the next state by MJX."""
        import jax

        start = self._states.qpos(state.z), state.m, state.controls, state.activations
        with jax.enable_x64(True):
            values, touches = jax.device_get(self._step(self._parts, start))
        qpos, velocity, activations, acceleration, unbalanced = map(np.array, values)
        z = np.array(self._states.coordinates_of(qpos, state.z))
        return EngineStep(
            acceleration=acceleration,
            unbalanced=unbalanced,
            contacts=tuple(_contacts(touches)),
            after=WholeState(z, velocity, state.controls, activations),
        )


@cache
def _stepper(make: Any) -> Any:
    """Compile a function that takes a step: the state, accelerations, unbalanced force, contacts.

    Models of the same structure share it. A step keeps the forces of its start, except for RK4,
    whose next state has no rule.
    """
    import jax
    from mujoco import mjx

    def step(parts: Any, start: Any) -> tuple[Any, Any]:
        model, empty = jax.tree_util.tree_unflatten(make, parts)
        qpos, qvel, controls, activations = start
        data = empty.replace(qpos=qpos, qvel=qvel, ctrl=controls, act=activations)
        once = mjx.forward if model.opt.integrator == mjx.IntegratorType.RK4 else mjx.step
        after = once(model, data)
        balance = after.qfrc_smooth + after.qfrc_constraint
        unbalanced = balance - mjx.mul_m(model, after, after.qacc)
        contact = after._impl.contact  # of its own backend, as its tests read it
        touches = contact.geom, contact.dist, contact.includemargin, contact.pos, contact.frame
        return (after.qpos, after.qvel, after.act, after.qacc, unbalanced), touches

    return jax.jit(step)


def _contacts(touches: Any) -> Iterator[ContactPoint]:
    """Yield the contacts within their margins."""
    for geoms, distance, margin, position, frame in zip(*touches, strict=True):
        if distance < margin:
            first, other = map(int, geoms)
            yield ContactPoint(
                surfaces=(first, other),
                distance=float(distance),
                position=np.array(position),
                frame=np.array(frame).reshape(3, 3),
            )


BITS = 64
"""Bits of its numbers; `bits = 32` selects JAX's default precision."""

HELD = 512
"""Steps whose forces are passed at once."""

BATCH_GROWTH = 4
"""Batches have 1, 4, 16, ... states."""


class MjxEngine(MujocoEngine):
    """Adapter of MJX (Google DeepMind)."""

    name = "mjx"
    title = "MJX"
    extra = "mjx"
    on_request = True
    capabilities: tuple[str, ...] = (
        "joints: slide, hinge, ball, free",
        "springs: joint, tendon, combination (URDF)",
        "mimic: soft equality",
        "next state: yes",
        "accelerations: yes",
        "linearization: from steps",
        "steps: Euler, implicitfast: order 1; RK4: order 4",
        "whole step: by MuJoCo's law, of MJCF",
    )
    compiles: tuple[str, ...] = ()
    usual_mistakes: tuple[DefaultLeftOn | LeftOut, ...] = ()

    def version(self) -> str | None:
        """Return the version of the installed package, or None."""
        try:
            version = importlib.metadata.version("mujoco-mjx")  # without an import
        except importlib.metadata.PackageNotFoundError:
            return None
        return version if super().version() is not None else None

    def load(self, spec: ModelSpec) -> MujocoModel:
        """Load an MJCF or URDF file."""
        bits = spec.settings.get("bits", BITS)
        if bits not in (32, 64):
            problem = f"[settings] bits is {bits!r}; expected 32 or 64"
            raise EngineError(f"{spec.path}.toml: {problem}")
        rest = {key: value for key, value in spec.settings.items() if key != "bits"}
        model = super().load(replace(spec, settings=rest))
        assert isinstance(model, MjxModel)
        if states_move(model.model, spec):
            raise EngineError(f"{spec.path}: it has actuators with states, which MJX holds here")
        with engine_errors(spec.path, self.title):
            model.transfer(bits)
        return model

    def whole_of(self, compiled: Any) -> MjxWhole:
        """Return the model of whole steps, which JAX takes."""
        return MjxWhole(compiled)

    def samples(self) -> tuple[Sample, ...]:
        """Return MuJoCo's samples, except the integrator that MJX lacks."""
        return tuple(one for one in super().samples() if one.file != "implicit.xml")

    def model_of(self, *compiled: Any) -> MujocoModel:
        """Return a model that JAX steps."""
        return MjxModel(*compiled)


@cache
def _keep_compiled() -> None:
    """Let JAX store compiled code on disk unless it is configured: compilation takes seconds per
    batch size.
    """
    import jax

    if jax.config.jax_compilation_cache_dir is None:
        place = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        jax.config.update("jax_compilation_cache_dir", str(place / "physics-crosscheck" / "jax"))


@cache
def _advance(make: Any) -> Any:
    """Compile a function that advances states (q, v, act, warm start) by `count` steps of h, under
    forces.

    Models of the same structure share it. Numbers of the model are arguments, as plain arrays,
    since flattening a model takes longer than a step.
    """
    import jax
    from mujoco import mjx

    def advance(parts: Any, ctrl: Any, states: Any, force: Any, h: Any, count: Any) -> Any:
        model, empty = jax.tree_util.tree_unflatten(make, parts)
        model, empty = model.replace(opt=model.opt.replace(timestep=h)), empty.replace(ctrl=ctrl)

        def stepped(q: Any, v: Any, act: Any, warm: Any, f: Any) -> Any:
            start = empty.replace(qpos=q, qvel=v, act=act, qacc_warmstart=warm, qfrc_applied=f)
            end = mjx.step(model, start)
            return end.qpos, end.qvel, end.act, end.qacc_warmstart

        def once(i: Any, carried: Any) -> Any:
            states, (qs, vs) = carried
            states = jax.vmap(stepped)(*states, force[i])
            return states, (qs.at[i].set(states[0]), vs.at[i].set(states[1]))

        room = tuple(jax.numpy.zeros((len(force), *one.shape), one.dtype) for one in states[:2])
        return jax.lax.fori_loop(0, count, once, (states, room))

    return jax.jit(advance)


@cache
def _forward(make: Any) -> Any:
    """Compile a function that returns accelerations of states (q, v, act); arguments as in
    `_advance`.
    """
    import jax
    from mujoco import mjx

    def forward(parts: Any, ctrl: Any, states: Any, force: Any) -> Any:
        model, empty = jax.tree_util.tree_unflatten(make, parts)
        empty = empty.replace(ctrl=ctrl)

        def acceleration(q: Any, v: Any, act: Any, f: Any) -> Any:
            data = empty.replace(qpos=q, qvel=v, act=act, qfrc_applied=f)
            return mjx.forward(model, data).qacc

        return jax.vmap(acceleration)(*states, force)

    return jax.jit(forward)


class MjxModel(MujocoModel):
    """A compiled model, stepped by JAX."""

    def transfer(self, bits: int) -> None:
        """Transfer the model to JAX, in numbers of this many bits.

        Raises:
            EngineError: for elements that MJX ignores.
            NotImplementedError: for elements that MJX itself rejects.
        """
        import jax
        from mujoco import mjx

        for reason in _unread(self.model):
            raise EngineError(f"{self._spec.path}: it has {reason}, which MJX ignores")
        _keep_compiled()
        self._bits = bits
        self.epsilon = float(np.finfo(f"float{bits}").eps)
        with self._numbers():
            device_model = mjx.put_model(self.model)
            parts, make = jax.tree_util.tree_flatten((device_model, mjx.make_data(device_model)))
            self._parts, self._advance = tuple(parts), _advance(make)
            self._forward = _forward(make)

    def _numbers(self) -> Any:
        """Return a context in which JAX uses numbers of these bits."""
        import jax

        return jax.enable_x64(self._bits == BITS)

    def accelerations(self, z: Array, w: Array, force: Array) -> Array | None:
        """Return accelerations by `mjx.forward`, at states without active constraints in MuJoCo."""
        reference = super().accelerations(z, w, force)
        if reference is None:
            return None
        with engine_errors(self._spec.path, "MJX"), np.errstate(all="ignore"), self._numbers():
            *states, _ = self._padded(self._states.qpos(z), self._states.qvel(z, w))
            held = np.pad(force, ((0, len(states[0]) - len(z)), (0, 0)))
            raw = np.array(self._forward(self._parts, self._controls, states, held), dtype=float)
        result: Array = np.where(np.isnan(reference), np.nan, raw[: len(z)])
        return result

    def _padded(self, qpos: Array, qvel: Array) -> tuple[Array, ...]:
        """Return positions, velocities, activations and warm starts, padded to a batch size."""
        size = BATCH_GROWTH ** math.ceil(math.log(len(qpos), BATCH_GROWTH))
        q, v = (np.pad(one, ((0, size - len(one)), (0, 0)), mode="edge") for one in (qpos, qvel))
        return q, v, np.tile(self._activations, (size, 1)), np.zeros_like(v)

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """Step all states at once, padded to a batch size."""
        quiet = np.errstate(all="ignore")
        with engine_errors(self._spec.path, "MJX"), quiet, self._numbers():
            return self._rolled(q, v, h, n, force, every)

    def _rolled(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        import jax

        start, near, count = self._states.qpos(q), q, len(q)
        states = tuple(map(jax.numpy.asarray, self._padded(start, self._states.qvel(q, v))))
        size = len(states[0])
        length = 1 if isinstance(force, StateForce) else HELD
        held = np.zeros((length, size, self.model.nv))
        out_q, out_v = (np.empty((count, n // every, k)) for k in (self.model.nq, self.model.nv))
        for done in range(0, n, length):
            more = min(length, n - done)
            if isinstance(force, StateForce):
                positions = np.asarray(states[0][:count], dtype=float)
                near = np.array(
                    [self._states.coordinates_of(*row) for row in zip(positions, near, strict=True)]
                )
                rows = zip(near.tolist(), force.inputs[:, done].tolist(), strict=True)
                held[0, :count] = [force.evaluate(z, u) for z, u in rows]
            elif force is not None:
                held[:more, :count] = force[:, done : done + more].swapaxes(0, 1)
            arguments = self._parts, self._controls, states, held, h, more
            states, along = self._advance(*arguments)
            kept = np.arange(done + 1, done + more + 1)
            kept = kept[kept % every == 0]
            for out, values in zip((out_q, out_v), along, strict=True):
                out[:, kept // every - 1] = np.asarray(values)[kept - done - 1, :count].swapaxes(
                    0, 1
                )
        return self._states.motion_of(out_q, out_v, start)


def _unread(m: Any) -> Iterator[str]:
    """Yield elements of MuJoCo 4 that MJX ignores."""
    counts = {
        "dof_damping": m.nv, "jnt_stiffness": m.njnt,
        "tendon_damping": m.ntendon, "tendon_stiffness": m.ntendon,
    }  # fmt: skip
    for name, count in counts.items():
        if any(any(powers(m, name, i)[1:]) for i in range(count)):
            yield f"a polynomial of {name}"
    for name in ("actuator_armature", "actuator_damping"):
        if hasattr(m, name) and np.any(getattr(m, name)):
            yield f"{name} of its own"
