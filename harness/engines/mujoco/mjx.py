"""MJX, MuJoCo's dynamics in JAX: all that MuJoCo compiles, stepped by compiled loops.

A file is loaded as MuJoCo loads it, with the same settings, remarks, rules and coordinates; what is
stepped is a batch. Batches are filled up to a few sizes and steps are counted while it runs, so
that one compilation serves all step counts, steps and forces of a size.
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

from physics_crosscheck.harness.engines.mistake import DefaultLeftOn, LeftOut
from physics_crosscheck.harness.engines.mujoco.adapter import MujocoEngine, MujocoModel
from physics_crosscheck.harness.engines.mujoco.pulls import powers
from physics_crosscheck.harness.engines.protocol import (
    Array,
    EngineError,
    Force,
    ModelSpec,
    Sample,
    StateForce,
)
from physics_crosscheck.harness.engines.source import engine_errors

BITS = 64
"""Of its numbers; the setting `bits = 32` makes them those that JAX has unless told."""

HELD = 512
"""Steps of which forces are handed over at once."""

FILLED = 4
"""Batches are of 1, 4, 16, ... states."""


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
    )
    compiles: tuple[str, ...] = ()
    usual_mistakes: tuple[DefaultLeftOn | LeftOut, ...] = ()

    def version(self) -> str | None:
        """Version of the installed package, or None."""
        try:
            found = importlib.metadata.version("mujoco-mjx")  # nothing is imported for it
        except importlib.metadata.PackageNotFoundError:
            return None
        return found if super().version() is not None else None

    def load(self, spec: ModelSpec) -> MujocoModel:
        """Load an MJCF or URDF file."""
        bits = spec.settings.get("bits", BITS)
        if bits not in (32, 64):
            told = f"[settings] bits is {bits!r}; expected 32 or 64"
            raise EngineError(f"{spec.path}.toml: {told}")
        rest = {key: value for key, value in spec.settings.items() if key != "bits"}
        model = super().load(replace(spec, settings=rest))
        assert isinstance(model, MjxModel)
        with engine_errors(spec.path, self.title):
            model.put(bits)
        return model

    def samples(self) -> tuple[Sample, ...]:
        """MuJoCo's, but for the integrator that MJX hasn't."""
        return tuple(one for one in super().samples() if one.file != "implicit.xml")

    def model_of(self, *compiled: Any) -> MujocoModel:
        """A model that JAX steps."""
        return MjxModel(*compiled)


@cache
def _keep_compiled() -> None:
    """Have JAX keep on disk what it compiles, unless it was told where: seconds a batch's size."""
    import jax

    if jax.config.jax_compilation_cache_dir is None:
        place = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        jax.config.update("jax_compilation_cache_dir", str(place / "physics-crosscheck" / "jax"))


@cache
def _advance(make: Any) -> Any:
    """Compiled: (q, v, act, warm start) of states along `count` steps of h, under forces.

    Models of one make share it: what differs in numbers alone is an argument, as plain arrays,
    since to take a model apart costs more than its step.
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
    """Compiled: accelerations of states (q, v, act) under forces; arguments as of `_advance`."""
    import jax
    from mujoco import mjx

    def forward(parts: Any, ctrl: Any, states: Any, force: Any) -> Any:
        model, empty = jax.tree_util.tree_unflatten(make, parts)
        empty = empty.replace(ctrl=ctrl)

        def one(q: Any, v: Any, act: Any, f: Any) -> Any:
            at = empty.replace(qpos=q, qvel=v, act=act, qfrc_applied=f)
            return mjx.forward(model, at).qacc

        return jax.vmap(one)(*states, force)

    return jax.jit(forward)


class MjxModel(MujocoModel):
    """A compiled model, stepped by JAX."""

    def put(self, bits: int) -> None:
        """Hand the model over to JAX, in numbers of so many bits.

        Raises:
            EngineError: for what MJX reads over.
            NotImplementedError: for what it says itself that it hasn't.
        """
        import jax
        from mujoco import mjx

        for reason in _unread(self.model):
            raise EngineError(f"{self._spec.path}: it has {reason}, which MJX ignores")
        _keep_compiled()
        self._bits = bits
        self.epsilon = float(np.finfo(f"float{bits}").eps)
        with self._numbers():
            put = mjx.put_model(self.model)
            parts, make = jax.tree_util.tree_flatten((put, mjx.make_data(put)))
            self._parts, self._advance = tuple(parts), _advance(make)
            self._forward = _forward(make)

    def _numbers(self) -> Any:
        """Within which JAX has numbers of these bits."""
        import jax

        return jax.enable_x64(self._bits == BITS)

    def accelerations(self, z: Array, w: Array, force: Array) -> Array | None:
        """By `mjx.forward`, at states where MuJoCo has no constraint act."""
        told = super().accelerations(z, w, force)
        if told is None:
            return None
        with engine_errors(self._spec.path, "MJX"), np.errstate(all="ignore"), self._numbers():
            *states, _ = self._filled(self._states.qpos(z), self._states.qvel(z, w))
            held = np.pad(force, ((0, len(states[0]) - len(z)), (0, 0)))
            found = np.array(self._forward(self._parts, self._controls, states, held), dtype=float)
        own: Array = np.where(np.isnan(told), np.nan, found[: len(z)])
        return own

    def _filled(self, qpos: Array, qvel: Array) -> tuple[Array, ...]:
        """Positions, velocities, activations and warm starts of as many states as fill a batch."""
        size = FILLED ** math.ceil(math.log(len(qpos), FILLED))
        q, v = (np.pad(one, ((0, size - len(one)), (0, 0)), mode="edge") for one in (qpos, qvel))
        return q, v, np.tile(self._activations, (size, 1)), np.zeros_like(v)

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """All states at once, as many more as fill a batch."""
        quiet = np.errstate(all="ignore")
        with engine_errors(self._spec.path, "MJX"), quiet, self._numbers():
            return self._rolled(q, v, h, n, force, every)

    def _rolled(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        import jax

        start, near, count = self._states.qpos(q), q, len(q)
        states = tuple(map(jax.numpy.asarray, self._filled(start, self._states.qvel(q, v))))
        size = len(states[0])
        length = 1 if isinstance(force, StateForce) else HELD
        held = np.zeros((length, size, self.model.nv))
        out_q, out_v = (np.empty((count, n // every, k)) for k in (self.model.nq, self.model.nv))
        for done in range(0, n, length):
            more = min(length, n - done)
            if isinstance(force, StateForce):
                at = np.asarray(states[0][:count], dtype=float)
                near = np.array([self._states.at(*row) for row in zip(at, near, strict=True)])
                rows = zip(near.tolist(), force.inputs[:, done].tolist(), strict=True)
                held[0, :count] = [force.at(z, u) for z, u in rows]
            elif force is not None:
                held[:more, :count] = force[:, done : done + more].swapaxes(0, 1)
            arguments = self._parts, self._controls, states, held, h, more
            states, along = self._advance(*arguments)
            kept = np.arange(done + 1, done + more + 1)
            kept = kept[kept % every == 0]
            for out, one in zip((out_q, out_v), along, strict=True):
                out[:, kept // every - 1] = np.asarray(one)[kept - done - 1, :count].swapaxes(0, 1)
        return self._states.taken(out_q, out_v, start)


def _unread(m: Any) -> Iterator[str]:
    """What MuJoCo 4 has and MJX takes no account of."""
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
