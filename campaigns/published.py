"""Published contact tables, repeated: `python -m campaigns.canonical --published`.

`published.toml` has the figures and their sources. Scenes of one body are those of
`campaigns.canonical` with a source's numbers; SimBenchmark's rolling test has 26 bodies.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from campaigns.canonical import (
    ENGINES,
    CanonicalScene,
    Track,
    bullet_world,
    dart_body,
    dart_world,
    rebound,
    stop_error,
)

Velocities = NDArray[np.float64]
"""Velocities of the box and of the first ball before each step, m/s, (S, 6)."""

STEP, STEPS = 1e-3, 4000
"""Step, s, and number of steps of the rolling test."""

PUSH = {"xy": np.array([75, 150 * math.sqrt(0.75), 0]), "y": np.array([0, 150, 0])}
"""Force on the box, N. The page states xy; the code pushes 60 degrees off the x axis."""

BALLS = [(2.0 * i - 4, 2.0 * j - 4) for i in range(5) for j in range(5)]
"""Places of the balls on the box, m."""


def rolling_error(velocities: Velocities, push: str) -> float:
    """Return the mean over the steps of both bodies' squared velocity error, m^2/s^2."""
    drive = 150 - 0.4 * 35 * 9.81
    ball = drive / 10 / (3.5 + 25 / 10)  # acceleration by the friction of rolling, 1 kg
    exact = np.outer([(drive - 25 * ball) / 10, ball], PUSH[push] / 150).ravel()
    times = STEP * np.arange(len(velocities))
    return float(((velocities - times[:, None] * exact) ** 2).sum(axis=1).mean())


def rolling_mujoco(push: str) -> Velocities:
    """Run the rolling test in MuJoCo; the pair has the larger friction."""
    import mujoco

    ball = '<freejoint/><geom type="sphere" size=".5" mass="1" friction=".8 0 0"/></body>'
    balls = "".join(f'<body pos="{x} {y} 1.499998">{ball}' for x, y in BALLS)
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
    <option timestep="{STEP}" cone="elliptic" jacobian="dense" tolerance="1e-15"/>
    <default><geom friction=".4 0 0"/></default>
    <worldbody><geom type="plane" size="100 100 5"/><body pos="0 0 .499998"><freejoint/>
    <geom type="box" size="10 10 .5" mass="10"/></body>{balls}</worldbody></mujoco>""")
    data = mujoco.MjData(model)
    data.xfrc_applied[1, :3] = PUSH[push]
    rows = []
    for _ in range(STEPS):
        rows.append(np.concatenate([data.qvel[:3], data.qvel[6:9]]))
        mujoco.mj_step(model, data)
    return np.array(rows)


def rolling_pybullet(push: str) -> Velocities:
    """Run the rolling test in PyBullet; the friction of a pair is the product."""
    import pybullet as p

    client = bullet_world(p, (0, 0, -9.81), STEP)
    p.setPhysicsEngineParameter(erp=0, contactERP=0, frictionERP=0)
    p.setPhysicsEngineParameter(numSolverIterations=1000, solverResidualThreshold=1e-30)

    def add(mass: float, shape: int, place: Sequence[float], mu: float) -> int:
        body: int = p.createMultiBody(mass, shape, basePosition=place)
        p.changeDynamics(body, -1, lateralFriction=mu, linearDamping=0, angularDamping=0)
        return body

    add(0, p.createCollisionShape(p.GEOM_BOX, halfExtents=(25, 25, 5)), (0, 0, -5), 0.5)
    slab = p.createCollisionShape(p.GEOM_BOX, halfExtents=(10, 10, 0.5))
    sphere = p.createCollisionShape(p.GEOM_SPHERE, radius=0.5)
    box = add(10, slab, (0, 0, 0.5 - 2e-5), 0.8)
    balls = [add(1, sphere, (x, y, 1.5 - 6e-5), 1.0) for x, y in BALLS]
    rows = []
    for _ in range(STEPS):
        rows.append(np.concatenate([p.getBaseVelocity(body)[0] for body in (box, balls[0])]))
        place, _ = p.getBasePositionAndOrientation(box)
        p.applyExternalForce(box, -1, PUSH[push], place, p.WORLD_FRAME)
        p.stepSimulation()
    p.disconnect(client)
    return np.array(rows)


def rolling_dart(push: str) -> Velocities:
    """Run the rolling test in DART; the pair has the smaller friction."""
    import dartpy as dart

    world = dart_world((0, 0, -9.81), STEP)
    dart_body(world, dart.dynamics.BoxShape([100, 100, 1]), (0, 0, -0.5), 0, 0.4)
    box = dart_body(world, dart.dynamics.BoxShape([20, 20, 1]), (0, 0, 0.5 - 2e-5), 10, 0.8)
    ball = dart.dynamics.SphereShape(0.5)
    balls = [dart_body(world, ball, (x, y, 1.5 - 6e-5), 1, 0.8) for x, y in BALLS]
    rows = []
    for _ in range(STEPS):
        rows.append(np.concatenate([body.getLinearVelocity() for body in (box, balls[0])]))
        box.addExtForce(PUSH[push])
        world.step()
    return np.array(rows)


ROLLING = {"mujoco": rolling_mujoco, "pybullet": rolling_pybullet, "dart": rolling_dart}


def energy_error(track: Track, _h: float, scene: CanonicalScene) -> float:
    """Return the mean squared energy error of 49 equal balls before each step, J^2."""
    _x, z, vx, vz = track[:-1].T
    rise = z - scene.half - scene.gap
    energy = scene.mass * ((vx**2 + vz**2) / 2 + scene.g * rise)
    return float(((49 * energy) ** 2).sum() / len(track))


def rolling_speed(track: Track, _h: float, scene: CanonicalScene) -> float:
    """Return the relative error of a rolling ball's speed against its fall, in %."""
    x, z, vx, vz = track[-1]
    fall = x * math.sin(scene.slope) - (z - scene.half) * math.cos(scene.slope)
    return 100 * (math.hypot(vx, vz) / math.sqrt(10 / 7 * scene.g * fall) - 1)


def slip(track: Track, _h: float, scene: CanonicalScene) -> float:
    """Return the relative error of a sliding ball's mean acceleration, in %."""
    exact = scene.g * (math.sin(scene.slope) - scene.mu * math.cos(scene.slope))
    return 100 * (float(track[-1, 2]) / scene.duration / exact - 1)


MEASURES: Mapping[str, Callable[[Track, float, CanonicalScene], float]] = {
    "energy": energy_error,
    "height": lambda track, h, scene: scene.gap * rebound(track, h, scene) ** 2,
    "stop": lambda track, h, scene: 100 * stop_error(track, h, scene),
    "shift": lambda track, h, _: 1e3 * float(track[-1, 0] - track[-1 - round(0.25 / h), 0]),
    "roll": rolling_speed,
    "place": lambda track, _h, _: float(track[-1, 0]),
    "slip": slip,
}
"""Measures of a scene of one body: name in `published.toml`."""


def tables() -> list[dict[str, Any]]:
    """Return the tables of `published.toml`."""
    read: list[dict[str, Any]]
    read = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))["tables"]
    return read


def figure(table: Mapping[str, Any], case: Mapping[str, Any]) -> float:
    """Run a case and return our figure."""
    if "push" in case:
        return rolling_error(ROLLING[case["engine"]](case["push"]), case["push"])
    numbers = table["scene"] | {k: case[k] for k in ("e", "mu", "settings") if k in case}
    scene = CanonicalScene(**numbers | {"slope": math.radians(numbers.get("slope", 0))})
    track = ENGINES[case["engine"]][0](scene, table["step"])
    return MEASURES[table["measure"]](track, table["step"], scene)


def print_table(engines: Sequence[str]) -> None:
    """Print the rows of the named engines as they finish."""
    print("| source | scene | engine | published | ours | exact |\n|---|---|---|---|---|---|")
    for table in tables():
        for case in table["cases"]:
            if case["engine"] in engines:
                cells = [table["source"], table["text"].format(**case), case["engine"]]
                ours = table["form"].format(figure(table, case))
                cells += [case["published"], ours, case["exact"]]
                print(f"| {' | '.join(cells)} |", flush=True)
