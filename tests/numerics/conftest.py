"""A mechanism small enough to know everything about, and a Python engine that integrates it."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from harness.files.sidecar import Sidecar
from harness.numerics.coordinates import coordinate_map
from reference import Constant, Coordinate, Equilibrium, Input, Output, Scenario, System
from reference.derive import derive
from reference.solve import solve

MASS, DAMPING, STIFFNESS = 1.3, 0.9, 47.0


def oscillator(damping=DAMPING, drive=0.0, duration=3.0):
    """The mass on a spring, as a declared system with one scenario."""
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
class SymplecticEuler:
    """v += h a(q, v); q += h v, of the oscillator in plain Python."""

    mass: float = MASS
    damping: float = DAMPING
    stiffness: float = STIFFNESS
    step: float = 0.002
    integrator: str = "symplectic euler"
    coordinates: tuple[str, ...] = ("x",)
    calls: list = field(default_factory=list)

    def exponents(self, varying_input):
        return 1, 1

    def rollout(self, q, v, h, n, force, every):
        self.calls.append((h, n, len(q)))
        q, v = q.copy(), v.copy()
        out_q, out_v = [], []
        for i in range(n):
            push = 0.0 if force is None else force[:, i]
            v = v + h * (push - self.stiffness * q - self.damping * v) / self.mass
            q = q + h * v
            if (i + 1) % every == 0:
                out_q.append(q)
                out_v.append(v)
        return np.stack(out_q, axis=1), np.stack(out_v, axis=1)


@dataclass(frozen=True)
class Bench:
    """A solved oscillator with the engine and map to run it."""

    system: System
    equations: object
    motion: object
    model: SymplecticEuler
    coordinates: object


@pytest.fixture
def bench():
    """A function from options to a `Bench`."""

    def make(model=None, **options):
        system = oscillator(**options)
        equations = derive(system)
        sidecar = Sidecar(Path("test.model"), ("test",), {}, {}, {}, {}, ())
        model = model or SymplecticEuler(damping=options.get("damping", DAMPING))
        return Bench(
            system,
            equations,
            solve(equations, system.scenarios[0]),
            model,
            coordinate_map(system, sidecar, ("x",)),
        )

    return make
