"""A mechanism with known solutions, and a Python engine that integrates it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from physics_crosscheck import (
    Constant,
    Coordinate,
    Equilibrium,
    Input,
    Output,
    Scenario,
    System,
)
from physics_crosscheck.harness.checks.prepare import scaled
from physics_crosscheck.harness.engines.protocol import Array, Force, LoadedModel, StateForce
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap, coordinate_map
from physics_crosscheck.reference.dynamics.derive import Equations, derive
from physics_crosscheck.reference.solving.segments import Motion
from physics_crosscheck.reference.solving.solve import solve

MASS, DAMPING, STIFFNESS = 1.3, 0.9, 47.0


def finite(value: float | None) -> float:
    assert value is not None
    return value


def oscillator(
    damping: float = DAMPING, drive: sp.Expr | float = 0.0, duration: float = 3.0
) -> System:
    """Return a mass on a spring as a declared system with one scenario."""
    x = Coordinate("x", "m", "displacement")
    m = Constant("m", MASS, "kg", "mass", "test")
    c = Constant("c", damping, "N*s/m", "damping", "test")
    k = Constant("k", STIFFNESS, "N/m", "stiffness", "test")
    f = Input("f", "N", "force", on={x: 1})
    return System(
        name="oscillator",
        title="Oscillator",
        source="test",
        coordinates=(x,),
        constants=(m, c, k),
        inputs=(f,),
        outputs=(Output("x", x.q, "m", "displacement"),),
        T=m * x.v**2 / 2,
        V=k * x.q**2 / 2,
        D=c * x.v**2 / 2,
        equilibria=(Equilibrium("rest", at={x: 0}, search=False, description="rest"),),
        scenarios=(
            Scenario(
                "only", "test", q={x: 0.25}, v={x: -0.4}, inputs={f: drive}, duration=duration
            ),
        ),
        published=(),
    )


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

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        assert not isinstance(force, StateForce)
        self.calls.append((h, n, len(q)))
        if len(q) == 1:
            return self._rollout_single(q.item(), v.item(), h, n, force, every)
        q, v = q.copy(), v.copy()
        out_q, out_v = [], []
        for i in range(n):
            push = np.zeros_like(q) if force is None else force[:, i]
            v = v + h * (push - self.stiffness * q - self.damping * v) / self.mass
            q = q + h * v
            if (i + 1) % every == 0:
                out_q.append(q)
                out_v.append(v)
        return np.stack(out_q, axis=1), np.stack(out_v, axis=1)

    def _rollout_single(
        self, q: float, v: float, h: float, n: int, force: Array | None, every: int
    ) -> tuple[Array, Array]:
        """Take the same steps from one state with floats, which are 20 times faster than arrays."""
        pushes = [0.0] * n if force is None else force[0, :n, 0].tolist()
        states = []
        for push in pushes:
            v = v + h * (push - self.stiffness * q - self.damping * v) / self.mass
            q = q + h * v
            states.append((q, v))
        sampled = np.array(states[every - 1 :: every]).reshape(1, -1, 2)
        return sampled[:, :, :1], sampled[:, :, 1:]


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
        system = oscillator(damping, drive, duration)
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
