"""An engine with a known answer and faults on demand; an example for authors of adapters.

It is complete: a file format, a model with all that `LoadedModel` requires, and an adapter.
Everything else in the protocol has a default. Override `home` and `reach` if coordinates don't
start at 0, `gravity` if the engine applies one, `corrective_settings` and `usual_mistakes` for the
engine's own defaults, and `remarks` for parts of a file that the engine reads differently. An
adapter is found by an entry point of its distribution, in the group `crosscheck.engines`. The tests
declare this one: `known = "physics_crosscheck.harness.engines.known_answer:KnownEngine"`.

A `.known` file is TOML: names, M, C, K and the weights W of M a = F - C v - K q - W sin q, the
step, the method and the order that it claims, 32 or 64 `bits` of its numbers, and under [fault] the
faults.
"""

from __future__ import annotations

import os
import signal
import sys
import time
import tomllib
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from .protocol import (
    Array,
    Engine,
    EngineError,
    Force,
    LoadedModel,
    ModelSpec,
    Sample,
    StateForce,
    StepRule,
)

_SAMPLE = """
names = ["x", "theta"]
M = [[1.3, 0.2], [0.2, 0.8]]
C = [[0.9, 0.0], [0.0, 0.1]]
K = [[47.0, -3.0], [-3.0, 3.0]]
W = [0.0, 2.5]
step = 0.005
method = "{}"
claims = {}
"""


class OddError(Exception):
    """An error that can't be rebuilt from its arguments or pickled, like some of third parties."""

    def __init__(self, first: str, second: str) -> None:
        super().__init__(f"{first} {second}")
        self.unsendable = lambda: None


class KnownEngine(Engine):
    """The adapter that an entry point names."""

    name = "known"
    title = "the known-answer engine"
    formats = (".known",)
    syntax = MappingProxyType({".known": ".toml"})
    capabilities = ("answers that are known",)

    def version(self) -> str | None:
        """Return a version: this engine is always installed."""
        return "1.0"

    def load(self, spec: ModelSpec) -> KnownModel:
        """Read the file; errors name it and a remedy."""
        if spec.settings:
            raise EngineError(f"{spec.path}.toml: unknown settings: {', '.join(spec.settings)}")
        try:
            return KnownModel(tomllib.loads(spec.path.read_text(encoding="utf-8")))
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise EngineError(
                f"{spec.path}: can't be read: {error}; known_answer.py describes the format"
            ) from None
        except (KeyError, TypeError, ValueError) as error:
            raise EngineError(
                f"{spec.path}: it is not a model: {error!r}; known_answer.py describes its keys"
            ) from None

    def samples(self) -> tuple[Sample, ...]:
        """Return a sample of each method, and one with 32-bit numbers."""
        euler, heun = _SAMPLE.format("euler", 1), _SAMPLE.format("heun", 2)
        texts = {"euler.known": euler, "heun.known": heun, "single.known": f"{euler}bits = 32\n"}
        return tuple(Sample(file=file, text=text) for file, text in texts.items())


class KnownModel(LoadedModel):
    """A linear system, or pendulums, stepped by semi-implicit Euler or Heun's method."""

    def __init__(self, file: Mapping[str, Any]) -> None:
        self.coordinates = tuple(file["names"])
        self.step, self.integrator = float(file["step"]), str(file["method"])
        self._claims, self._fault = int(file["claims"]), _Fault(file.get("fault", {}))
        self._number = np.dtype(f"float{int(file.get('bits', 64))}")
        self.epsilon = float(np.finfo(self._number).eps)
        parts = (np.array(file[name], dtype=self._number) for name in ("M", "C", "K", "W"))
        self._mass, self._damper, self._spring, self._weight = parts
        self._inverse = np.linalg.inv(self._mass)
        self._spring = self._spring * (1 + self._fault.number("off", 0.0))

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """Return the claimed order; Heun's method has order 1 if an input is held while it
        varies.
        """
        return (1 if varying_input and self.integrator == "heun" else self._claims), 1

    @property
    def step_rule(self) -> StepRule | None:
        """The rule of semi-implicit Euler; the harness has no rule for two stages."""
        return StepRule(scheme="semi-implicit Euler") if self.integrator == "euler" else None

    @np.errstate(all="ignore")
    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """Step all states at once, with the force held over each step."""
        self._fault.misbehave()
        q, v = (a.astype(self._number) for a in (q + self._fault.remembered, v))
        qs: list[Array] = []
        vs: list[Array] = []
        for i in range(n):
            held = self._held(force, q, i)
            a = self._acceleration(q, v, held)
            if self.integrator == "heun":
                later = self._acceleration(q + h * v, v + h * a, held)
                q, v = q + h * v + h * h * a / 2, v + h * (a + later) / 2
            else:
                v = v + h * a
                q = q + h * v
            q, v = self._fault.disturb(q, v, h, i + 1, self._mass)
            if (i + 1) % every == 0:
                qs.append(q)
                vs.append(v)
        return np.stack(qs, axis=1).astype(np.float64), np.stack(vs, axis=1).astype(np.float64)

    def _acceleration(self, q: Array, v: Array, force: Array) -> Array:
        total = force - _times(self._damper, v) - _times(self._spring, q) - np.sin(q) * self._weight
        return _times(self._inverse, total)

    def _held(self, force: Force, q: Array, i: int) -> Array:
        """Return the force of a step, (B, nz), evaluated at the state at its start."""
        if force is None:
            return np.zeros_like(q)
        if isinstance(force, StateForce):
            rows = zip(q.tolist(), force.inputs[:, i].tolist(), strict=True)
            return np.array([force.evaluate(z, u) for z, u in rows], dtype=self._number)
        return force[:, i].astype(self._number)


def _times(matrix: Array, rows: Array) -> Array:
    """Multiply a matrix by each row, with the same order of sums for one row and for many."""
    product = rows[:, :1] * matrix[:, 0]
    for k in range(1, len(matrix)):
        product = product + rows[:, k : k + 1] * matrix[:, k]
    return product


class _Fault:
    """Faults on demand; not part of an adapter."""

    def __init__(self, wanted: Mapping[str, Any]) -> None:
        self._wanted, self._calls = wanted, 0

    def number(self, name: str, default: float) -> float:
        """Return the number of a fault in the file."""
        return float(self._wanted.get(name, default))

    def misbehave(self) -> None:
        """Hang, crash, exit or raise, as the file demands."""
        self._calls += 1
        if "hang" in self._wanted:
            end = time.process_time() + self._wanted["hang"]
            while time.process_time() < end:
                pass
        if "segfault" in self._wanted:
            os.kill(os.getpid(), signal.SIGSEGV)
        if "exits" in self._wanted:
            sys.exit(self._wanted["exits"])
        if "odd" in self._wanted:
            raise OddError("two", "arguments")
        if "raises" in self._wanted:
            raise RuntimeError(self._wanted["raises"])

    @property
    def remembered(self) -> float:
        """Offset of positions, which grows from call to call."""
        return self.number("remembers", 0.0) * self._calls

    def disturb(self, q: Array, v: Array, h: float, steps: int, mass: Array) -> tuple[Array, Array]:
        """Return the state with faults that a step adds to the equations."""
        if steps > self.number("drags_after_steps", np.inf):
            v = v * (1 - self.number("drag", 0.05) * h)
        if "limit" in self._wanted:
            limit = self.number("limit", np.inf)
            v = np.where(np.abs(q) > limit, 0.0, v)
            q = np.clip(q, -limit, limit)
        if "friction" in self._wanted:
            lost = h * self.number("friction", 0.0) / np.diag(mass)
            v = np.sign(v) * np.maximum(np.abs(v) - lost, 0.0)
        if steps * h > self.number("nan_after_seconds", np.inf):
            v = v * np.nan
        return q, v
