"""MJX, MuJoCo's dynamics in JAX: models that MuJoCo compiles, in compiled loops.

MuJoCo loads the file, with the same settings, remarks, rules and coordinates. Steps are batched.
Batches are padded to a few sizes, and the number of steps is an argument, so that one compilation
serves all step counts, step sizes and forces of a batch size.
"""

from __future__ import annotations

import importlib.metadata
import math
import os
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.mujoco.adapter import MujocoEngine, MujocoModel
from physics_crosscheck.harness.engines.mujoco.mjx_whole import MjxWhole
from physics_crosscheck.harness.engines.mujoco.pulls import powers
from physics_crosscheck.harness.engines.mujoco.settings import states_move
from physics_crosscheck.harness.engines.protocol import (
    Array,
    DefaultLeftOn,
    EngineError,
    Force,
    LeftOut,
    ModelSpec,
    Sample,
    StateForce,
)
from physics_crosscheck.harness.engines.source import engine_errors

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
