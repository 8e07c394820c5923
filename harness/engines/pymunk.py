"""pymunk (Munk2D), on a Python file that builds a Space."""

from __future__ import annotations

import hashlib
import importlib.metadata
import importlib.util
import sys
import traceback
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.engine import Array, EngineError, Force, ModelSpec, StateForce

_KINDS = ("x", "y", "angle")


@dataclass(frozen=True)
class PymunkEngine:
    """Adapter of pymunk (Blomqvist), a Python library on Munk2D, formerly Chipmunk (Lembcke)."""

    name: str = "pymunk"
    formats: tuple[str, ...] = (".py",)
    capabilities: tuple[str, ...] = (
        "Python files with `build() -> (Space, {name: Body})`", "planar bodies and constraints",
        "springs and dampers",
    )  # fmt: skip

    def version(self) -> str | None:
        """Version of the installed package, or None."""
        if importlib.util.find_spec("pymunk") is None:
            return None
        return importlib.metadata.version("pymunk")

    def load(self, spec: ModelSpec) -> PymunkModel:
        """Run the file, and call its `build`."""
        unknown = set(spec.settings) - {"step"}
        if unknown:
            raise EngineError(f"{spec.path}.toml: pymunk has no setting {', '.join(unknown)}")
        if "step" not in spec.settings:
            raise EngineError(f"{spec.path}.toml: [settings] must state step: a Space has none")
        return PymunkModel(spec)


class PymunkModel:
    """The bodies that `build` returns; coordinates are `name.x`, `name.y` and `name.angle`."""

    integrator = "semi-implicit euler, positions first"

    def __init__(self, spec: ModelSpec) -> None:
        self.path = str(spec.path)
        self.step = float(spec.settings["step"])  # type: ignore[arg-type]  # checked by the sidecar
        self._module = _run_file(spec)
        self._build()

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """Order 1 throughout: a step moves positions with the old velocity, then updates it."""
        return 1, 1

    def _build(self) -> None:
        import pymunk

        try:
            space, bodies = self._module.build()
        except Exception as error:
            raise EngineError(f"{self.path}:{_line(error, self.path)}: build() fails: {error}") from None
        if not isinstance(space, pymunk.Space) or not isinstance(bodies, dict):
            raise EngineError(f"{self.path}: build() must return (Space, {{name: Body}})")
        if not bodies or not all(isinstance(body, pymunk.Body) for body in bodies.values()):
            raise EngineError(f"{self.path}: build() must name at least one Body")
        self._space = space
        self._bodies = list(bodies.values())
        self.coordinates = tuple(f"{name}.{kind}" for name in bodies for kind in _KINDS)

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """Step the Space; forces act for one step, as pymunk clears them after each."""
        out_q = np.empty((len(q), n // every, q.shape[1]))
        out_v = np.empty_like(out_q)
        for b in range(len(q)):
            # A Space keeps impulses from step to step; a new one starts without.
            self._build()
            self._set(q[b], v[b])
            self._run(b, h, n, force, every, out_q[b], out_v[b])
        return out_q, out_v

    def _set(self, q: Array, v: Array) -> None:
        values, rates = q.tolist(), v.tolist()
        for i, body in enumerate(self._bodies):
            body.position = (values[3 * i], values[3 * i + 1])
            body.angle = values[3 * i + 2]
            body.velocity = (rates[3 * i], rates[3 * i + 1])
            body.angular_velocity = rates[3 * i + 2]

    def _run(
        self, b: int, h: float, n: int, force: Force, every: int, out_q: Array, out_v: Array
    ) -> None:
        bodies, step = self._bodies, self._space.step
        by_state = force if isinstance(force, StateForce) else None
        held: Any = force[b].tolist() if isinstance(force, np.ndarray) else None
        for i in range(n):
            if by_state is not None:
                held_now = by_state.at(np.array(self._positions()), by_state.inputs[b, i]).tolist()
                self._push(held_now)
            elif held is not None:
                self._push(held[i])
            step(h)
            if (i + 1) % every == 0:
                row = i // every
                out_q[row] = self._positions()
                out_v[row] = [
                    rate
                    for body in bodies
                    for rate in (body.velocity.x, body.velocity.y, body.angular_velocity)
                ]

    def _positions(self) -> list[float]:
        return [
            value
            for body in self._bodies
            for value in (body.position.x, body.position.y, body.angle)
        ]

    def _push(self, forces: list[float]) -> None:
        for i, body in enumerate(self._bodies):
            body.force = (forces[3 * i], forces[3 * i + 1])
            if forces[3 * i + 2]:
                body.torque = forces[3 * i + 2]


def _run_file(spec: ModelSpec) -> Any:
    digest = hashlib.sha256(str(spec.path.resolve()).encode()).hexdigest()[:12]
    name = f"_crosscheck_space_{digest}"
    loader = importlib.util.spec_from_file_location(name, spec.path)
    if loader is None or loader.loader is None or not spec.path.is_file():
        raise EngineError(f"{spec.path}: no such Python file")
    module = importlib.util.module_from_spec(loader)
    sys.modules[name] = module
    try:
        loader.loader.exec_module(module)
    except Exception as error:
        line = _line(error, str(spec.path))
        raise EngineError(f"{spec.path}:{line}: {type(error).__name__}: {error}") from None
    if not callable(getattr(module, "build", None)):
        raise EngineError(f"{spec.path}: it must define build() -> (Space, {{name: Body}})")
    return module


def _line(error: Exception, path: str) -> int:
    if isinstance(error, SyntaxError) and error.lineno:
        return error.lineno
    lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == path]
    return lines[-1] or 1 if lines else 1
