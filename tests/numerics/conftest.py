"""A mechanism with known solutions, and a Python engine that integrates it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

from physics_crosscheck import System
from physics_crosscheck.engine import Array, Force, LoadedModel, StateForce
from physics_crosscheck.harness.checks.prepare import scaled
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap, coordinate_map
from physics_crosscheck.reference.dynamics.derive import Equations, derive
from physics_crosscheck.reference.solving.segments import Motion
from physics_crosscheck.reference.solving.solve import solve
from tests.reference.mechanisms import oscillator

MASS, DAMPING, STIFFNESS = 1.3, 0.9, 47.0


def finite(value: float | None) -> float:
    assert value is not None
    return value


@dataclass
class SymplecticEuler(LoadedModel):
    """v += h a(q, v); q += h v, of the oscillator in plain Python."""

    mass: float = MASS
    damping: float = DAMPING
    stiffness: float = STIFFNESS
    step: float = 0.002
    integrator: str = "symplectic euler"
    coordinates: tuple[str, ...] = ("x",)
    calls: list[tuple[float, int, int]] = field(default_factory=list)

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        return 1, 1

    def stepped(self, q: Any, v: Any, push: Any, h: float) -> Any:
        """Return position and velocity one step later, of arrays or of floats."""
        v = v + h * (push - self.stiffness * q - self.damping * v) / self.mass
        return q + h * v, v

    def altered(self, z: Array, w: Array, q: Array, h: float) -> tuple[Array, Array]:
        """Return the samples as given out; q are the starts."""
        return z, w

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        assert not isinstance(force, StateForce)
        self.calls.append((h, n, len(q)))
        # One state as floats, which are 20 times faster than arrays.
        x, speed = (q.item(), v.item()) if len(q) == 1 else (q.copy(), v.copy())
        pushes = np.zeros((len(q), n, 1)) if force is None else force
        columns = pushes[0, :n, 0].tolist() if len(q) == 1 else pushes.swapaxes(0, 1)[:n]
        states = []
        for push in columns:
            x, speed = self.stepped(x, speed, push, h)
            states.append((x, speed))
        shape = 2, n // every, len(q)
        sampled = np.moveaxis(np.array(states[every - 1 :: every]), 1, 0).reshape(shape)
        z, w = sampled.swapaxes(1, 2)[..., None]
        return self.altered(z, w, q, h)


@dataclass
class Coarse(SymplecticEuler):
    """Rounds starts to fewer bits: the loss is the same on every rung, so no increment shows it.

    A double has 53 bits.
    """

    bits: int = 35

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        return super().rollout(self._short(q), self._short(v), h, n, force, every)

    def _short(self, values: Array) -> Array:
        mantissa, exponent = np.frexp(values)
        short: Array = np.ldexp(np.round(mantissa * 2**self.bits) / 2**self.bits, exponent)
        return short


@dataclass(frozen=True)
class Bench:
    """A solved oscillator with the engine and map to run it."""

    system: System
    equations: Equations
    motion: Motion
    model: SymplecticEuler
    coordinates: CoordinateMap


MakeBench = Callable[..., Bench]


@pytest.fixture
def bench() -> MakeBench:
    """Return a function that builds a `Bench` from a model and the options of `oscillator`."""

    def make(
        model: SymplecticEuler | None = None,
        damping: float = DAMPING,
        drive: sp.Expr | float = 0.0,
        duration: float = 3.0,
    ) -> Bench:
        system = oscillator(
            MASS, damping, STIFFNESS, force=drive, x=0.25, v=-0.4, duration=duration
        )
        equations = derive(system)
        sidecar = Sidecar(
            model=Path("test.model"),
            engines=("test",),
            settings={},
            engine_settings={},
            coordinates={},
            readback={},
            springs=(),
        )
        model = model or SymplecticEuler(damping=damping)
        return Bench(
            system,
            equations,
            scaled({"only": solve(equations, system.scenarios[0])})["only"],
            model,
            coordinate_map(system, sidecar, ("x",)),
        )

    return make
