"""Test the uncertainty on random linear systems with a closed form, in every engine.

Run as a script for more of them: `python -m tests.engines.random_linear --count 2000 --seed 7`.
"""

import argparse
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
from sympy import Heaviside, exp, sin

from physics_crosscheck import Constant, Coordinate, Equilibrium, Input, Output, Scenario, System, t
from physics_crosscheck.harness.checks.verdict import component_scale, judge
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.harness.numerics.coordinates import coordinate_map
from physics_crosscheck.harness.numerics.segments import extrapolate
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.solving import solve as reference_solve

PAIRINGS = ("mujoco mjcf", "mujoco urdf", "pybullet urdf", "pymunk python")
INTEGRATORS = ("Euler", "implicit", "implicitfast", "RK4")
SIGNALS = ("none", "step", "ramp", "exponential", "harmonic", "sum")
REGIMES = ("undamped", "light", "damped", "near critical", "overdamped")
GAP = 3.0
"""Metres between the masses, and between each and its wall: pymunk's springs have a length."""


@dataclass(frozen=True)
class Drawn:
    """A random mechanism: masses on a line, ground springs and dampers, one coupling.

    `k`, `c` belong to each mass and its wall; `kc`, `cc` to the pair. Names and values alone, so
    that each format is written from the same numbers.
    """

    pairing: str
    integrator: str
    regime: str
    signal: str
    m: tuple[float, ...]
    k: tuple[float, ...]
    c: tuple[float, ...]
    kc: float
    cc: float
    system: System

    @property
    def label(self) -> str:
        """Identify this mechanism in a report."""
        kind = "free pair" if not any(self.k) else f"{len(self.m)} masses"
        return f"{self.pairing} {self.integrator}, {kind}, {self.regime}, {self.signal}"


def draw(rng: np.random.Generator, pairing: str) -> Drawn:
    """Draw a mechanism with its scenario: three of its slowest periods, or six of its fastest."""
    size = int(rng.integers(1, 3))
    regime, signal = str(rng.choice(REGIMES)), str(rng.choice(SIGNALS))

    def number(low: float, high: float) -> float:
        return float(f"{np.exp(rng.uniform(np.log(low), np.log(high))):.4g}")

    m = tuple(number(0.3, 3) for _ in range(size))
    grounded = [True] if size == 1 else list(rng.choice([True, False], 2))
    k = tuple(number(10, 100) if g else 0.0 for g in grounded)
    kc = number(10, 100) if size == 2 else 0.0
    share = {
        "undamped": (0.0, 0.0),
        "light": (0.003, 0.05),
        "damped": (0.05, 0.6),
        "near critical": (0.97, 1.03),
        "overdamped": (1.2, 3.0),
    }[regime]

    def damper(stiffness: float, mass: float) -> float:
        zeta = rng.uniform(*share)
        return float(f"{2 * zeta * np.sqrt(stiffness * mass):.4g}") if stiffness else 0.0

    c = tuple(damper(ki, mi) for ki, mi in zip(k, m, strict=True))
    cc = damper(kc, m[0] * m[-1] / (m[0] + m[-1]))
    mass, stiff = np.diag(m), np.diag(k)
    if size == 2:
        stiff = stiff + kc * np.array([[1, -1], [-1, 1]])
        damp = np.diag(c) + cc * np.array([[1, -1], [-1, 1]])
    else:
        damp = np.diag(c)
    rates = np.sqrt(np.abs(np.linalg.eigvals(np.linalg.solve(mass, stiff))))
    slow = float(np.min(rates[rates > 1e-3 * np.max(rates)]))
    lower = np.linalg.solve(mass, np.hstack([-stiff, -damp]))
    full = np.vstack([np.eye(2 * size)[size:], lower])
    fast = float(np.max(np.abs(np.linalg.eigvals(full))))
    duration = float(f"{2 * np.pi * min(3 / slow, 6 / fast):.3g}")
    integrator = str(rng.choice(INTEGRATORS)) if pairing.startswith("mujoco") else ""
    system = _system(rng, m, k, c, kc, cc, signal, slow, duration)
    return Drawn(pairing, integrator, regime, signal, m, k, c, kc, cc, system)


def _system(
    rng: np.random.Generator,
    m: tuple[float, ...],
    k: tuple[float, ...],
    c: tuple[float, ...],
    kc: float,
    cc: float,
    signal: str,
    slow: float,
    duration: float,
) -> System:
    size = len(m)
    x = [Coordinate(f"x{i + 1}", "m", "displacement") for i in range(size)]

    def constant(name: str, value: float, unit: str) -> Constant:
        return Constant(name, value, unit, name, "drawn at random")

    ms = [constant(f"m{i + 1}", m[i], "kg") for i in range(size)]
    ks = [constant(f"k{i + 1}", k[i], "N/m") for i in range(size)]
    cs = [constant(f"c{i + 1}", c[i], "N*s/m") for i in range(size)]
    pair = [constant("kc", kc, "N/m"), constant("cc", cc, "N*s/m")] if size == 2 else []
    T = sum(mi * xi.v**2 for mi, xi in zip(ms, x, strict=True)) / 2
    V = sum(ki * xi.q**2 for ki, xi in zip(ks, x, strict=True)) / 2
    D = sum(ci * xi.v**2 for ci, xi in zip(cs, x, strict=True)) / 2
    if size == 2:
        V += pair[0] * (x[1].q - x[0].q) ** 2 / 2
        D += pair[1] * (x[1].v - x[0].v) ** 2 / 2
    force = Input("f", "N", "force", on={x[int(rng.integers(0, size))]: 1})
    size_of_force = float(f"{0.1 * max(*k, kc) * rng.uniform(0.2, 1):.3g}")
    a, b = (float(f"{r:.3g}") for r in slow * rng.uniform(0.3, 2.5, 2))
    waveforms = {
        "step": Heaviside(t - float(f"{duration * rng.uniform(0.1, 0.6):.3g}")),
        "ramp": t / duration,
        "exponential": exp(-a * t),
        "harmonic": sin(b * t + float(f"{rng.uniform(0, 6):.2g}")),
    }
    chosen = rng.choice(list(waveforms), int(rng.integers(2, 4)), replace=False)
    value = sum(waveforms[name] for name in chosen) if signal == "sum" else waveforms.get(signal, 0)
    start = [float(f"{v:.3g}") for v in rng.uniform(-0.4, 0.4, size)]
    speed = [float(f"{v:.3g}") for v in slow * rng.uniform(-0.3, 0.3, size)]
    scenario = Scenario(
        "drawn",
        "drawn",
        q=dict(zip(x, start, strict=True)),
        v=dict(zip(x, speed, strict=True)),
        inputs={force: size_of_force * value},
        duration=duration,
    )
    return System(
        name="drawn",
        title="Drawn at random",
        source="a test",
        coordinates=tuple(x),
        constants=(*ms, *ks, *cs, *pair),
        inputs=(force,),
        outputs=(Output("x1", x[0].q, "m", "displacement"),),
        T=T,
        V=V,
        D=D,
        equilibria=(Equilibrium("rest", dict.fromkeys(x, 0), False, "relaxed"),),
        scenarios=(scenario,),
        published=(),
    )


def write(drawn: Drawn, folder: Path) -> Path:
    """Write model file and sidecar; returns the sidecar's path."""
    writer = {"mjcf": _mjcf, "urdf": _urdf, "python": _python}[drawn.pairing.split()[1]]
    name, model, sidecar = writer(drawn)
    (folder / name).write_text(model)
    path = folder / f"{name}.toml"
    path.write_text(sidecar)
    return path


def _mjcf(d: Drawn) -> tuple[str, str, str]:
    bodies = "".join(
        f'<body><joint name="x{i + 1}" type="slide" axis="1 0 0" stiffness="{k!r}"'
        f' damping="{c!r}"/><inertial pos="0 0 0" mass="{m!r}" diaginertia="1 1 1"/></body>'
        for i, (m, k, c) in enumerate(zip(d.m, d.k, d.c, strict=True))
    )
    tendon = (
        f'<tendon><fixed stiffness="{d.kc!r}" damping="{d.cc!r}" springlength="0">'
        '<joint joint="x1" coef="-1"/><joint joint="x2" coef="1"/></fixed></tendon>'
        if len(d.m) == 2
        else ""
    )
    model = (
        f'<mujoco><option integrator="{d.integrator}" jacobian="dense" timestep="0.002"/>'
        f"<worldbody>{bodies}</worldbody>{tendon}</mujoco>"
    )
    return "mujoco.xml", model, 'engines = ["mujoco"]\n'


def _urdf(d: Drawn) -> tuple[str, str, str]:
    inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    parts = [f'<link name="ground"><inertial><mass value="1"/>{inertia}</inertial></link>']
    for i, (m, k, c) in enumerate(zip(d.m, d.k, d.c, strict=True), start=1):
        parts.append(
            f'<link name="b{i}"><inertial><mass value="{m!r}"/>{inertia}</inertial></link>'
            f'<joint name="x{i}" type="prismatic"><parent link="ground"/><child link="b{i}"/>'
            '<axis xyz="1 0 0"/><limit lower="-1000" upper="1000" effort="0" velocity="0"/>'
            f'<dynamics damping="{c!r}"/></joint>'
            f'<gazebo reference="x{i}"><springStiffness>{k!r}</springStiffness></gazebo>'
        )
    sidecar = f'engines = ["{d.pairing.split()[0]}"]\n[settings]\nstep = 0.002\n'
    sidecar += "gravity = [0, 0, 0]\n"
    if d.integrator:
        sidecar += f'[settings.mujoco]\nintegrator = "{d.integrator}"\n'
    if len(d.m) == 2:
        sidecar += (
            f"[[spring]]\njoints = {{ x1 = -1, x2 = 1 }}\nstiffness = {d.kc!r}\n"
            f"damping = {d.cc!r}\nrest = 0\n"
        )
    return "robot.urdf", f'<robot name="drawn">{"".join(parts)}</robot>', sidecar


def _python(d: Drawn) -> tuple[str, str, str]:
    wall = f"(-{GAP}, 0)", f"({GAP * len(d.m)}, 0)"
    lines = ["import pymunk", "def build():", "    s = pymunk.Space()", "    g = s.static_body"]
    for i, (m, k, c) in enumerate(zip(d.m, d.k, d.c, strict=True)):
        lines += [
            f"    b{i} = pymunk.Body({m!r}, float('inf'))",
            f"    b{i}.position = ({GAP * i}, 0)",
            f"    s.add(b{i})",
            f"    s.add(pymunk.DampedSpring(g, b{i}, {wall[i]}, (0, 0), {GAP}, {k!r}, {c!r}))",
        ]
    if len(d.m) == 2:
        lines.append(
            f"    s.add(pymunk.DampedSpring(b0, b1, (0, 0), (0, 0), {GAP}, {d.kc!r}, {d.cc!r}))"
        )
    names = ", ".join(f"'b{i}': b{i}" for i in range(len(d.m)))
    lines.append(f"    return s, {{{names}}}\n")
    sidecar = 'engines = ["pymunk"]\n[settings]\nstep = 0.002\n[coordinates]\n'
    readback = "[readback]\n"
    for i in range(len(d.m)):
        sidecar += f'"b{i}.x" = "x{i + 1} + {GAP * i}"\n"b{i}.y" = 0\n"b{i}.angle" = 0\n'
        readback += f'x{i + 1} = "b{i}.x - {GAP * i}"\n'
    return "space.py", "\n".join(lines), sidecar + readback


@dataclass(frozen=True)
class DrawnResult:
    """The result of one drawn system."""

    label: str
    outcome: str
    discrepancy: float
    uncertainty: float
    order_confirmed: bool
    order: float
    misses: int
    values: int
    ratio: float
    reason: str

    def __str__(self) -> str:
        return (
            f"{self.outcome:<10} E {self.discrepancy:.1e} U {self.uncertainty:.1e} order"
            f" {self.order:.2f} misses {self.misses}/{self.values} {self.label}: {self.reason}"
        )


def judge_drawn(drawn: Drawn, folder: Path, resolution: float = 1e-9) -> DrawnResult:
    """Run one system through the segments and compare it with its closed form.

    Use 20 segments per period as usual, but at least 60 instead of 200, to draw more systems.
    """
    sidecar = read_sidecar(write(drawn, folder))
    name = drawn.pairing.split()[0]
    model = engines()[name].load(sidecar.spec(name))
    coordinates = coordinate_map(drawn.system, sidecar, model.coordinates)
    with patch.object(reference_solve, "SEGMENTS_AT_LEAST", 60):
        motion = reference_solve.solve(derive(drawn.system), drawn.system.scenarios[0])
    assert motion.method.startswith("matrix exponential")
    motion = replace(motion, scale=component_scale(motion, []))
    result = extrapolate(model, coordinates, motion, resolution=resolution)
    names = tuple(f"{p}{c.name}" for p in ("", "d") for c in drawn.system.coordinates)
    claimed = model.exponents(motion.varying)[0]
    verdict = judge(result.limit, motion, names, claimed, resolution)
    error = np.abs(result.limit.value - motion.end)
    bound = result.limit.uncertainty + motion.bound
    with np.errstate(divide="ignore"):
        ratio = float(np.median(bound / error))
    return DrawnResult(
        drawn.label,
        str(verdict.outcome),
        verdict.discrepancy,
        verdict.uncertainty,
        result.limit.order_confirmed,
        verdict.order,
        int(np.sum(error > bound)),
        error.size,
        ratio,
        verdict.reason,
    )


def sweep(seed: int, count: int, pairing: str) -> Iterator[DrawnResult]:
    rng = np.random.default_rng([seed, PAIRINGS.index(pairing)])
    with tempfile.TemporaryDirectory() as folder:
        for number in range(count):
            # Each system has a folder because engines may cache files by path.
            place = Path(folder) / str(number)
            place.mkdir()
            yield judge_drawn(draw(rng, pairing), place)


def summary(results: Sequence[DrawnResult]) -> str:
    """Summarize many systems in one line."""
    values, misses = sum(f.values for f in results), sum(f.misses for f in results)
    unresolved = sum(f.outcome == "UNRESOLVED" for f in results)
    differs = sum(f.outcome == "DIFFERS" for f in results)
    fine = sum(f.uncertainty <= 1e-9 for f in results)
    alarms = sum(not f.order_confirmed for f in results)
    ratio = float(np.median([f.ratio for f in results]))
    worst = max(f.uncertainty for f in results)
    return (
        f"{len(results)} systems, {values} limits: {misses} outside U, {differs} DIFFERS,"
        f" {unresolved} UNRESOLVED; {alarms} false alarms of the order test,"
        f" {fine} with U <= 1e-9, worst U {worst:.1e}, median U/error {ratio:.0f}"
    )


def main() -> None:
    """Sweep from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=400)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--pairing", choices=PAIRINGS, action="append")
    options = parser.parse_args()
    pairings = options.pairing or PAIRINGS
    everything = []
    for pairing in pairings:
        results = list(sweep(options.seed, options.count // len(pairings), pairing))
        for result in results:
            if result.outcome != "AGREES" or result.misses or not result.order_confirmed:
                print(result)
        print(f"{pairing}: {summary(results)}")
        everything += results
    print(summary(everything))


if __name__ == "__main__":
    main()
