"""Cost of each engine: `python -m benchmarks.bench_engines`, and in `make bench`.

Microseconds of a step through the adapter and in a bare loop of the engine's calls, with their
ratio; and microseconds of a state, if the engine returns accelerations. A pendulum shows the cost
of a call, an arm of seven joints the cost of the dynamics.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pybullet_data
from rich.console import Console
from rich.table import Table

from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.engines.protocol import LoadedModel
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.model_files import model_files
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar

STEPS, STATES, REPEATS = 2000, 400, 7
ARM = Path(pybullet_data.getDataPath()) / "kuka_iiwa" / "model.urdf"

Loop = Callable[[], object]


def bare_mujoco(model: Any) -> Loop:
    import mujoco

    compiled = model.model
    data = mujoco.MjData(compiled)

    def loop() -> None:
        compiled.opt.timestep = model.step
        mujoco.mj_resetData(compiled, data)
        data.qpos[:] = model.home
        mujoco.mj_step(compiled, data, nstep=STEPS)

    return loop


def bare_pybullet(model: Any) -> Loop:
    import pybullet as p

    body, joints = model._body, model._joints

    def loop() -> None:
        p.setPhysicsEngineParameter(fixedTimeStep=model.step)
        for joint in joints:
            p.resetJointState(body, joint, 0.0, 0.0)
        for _ in range(STEPS):
            p.stepSimulation()
        p.getJointStates(body, joints)

    return loop


def bare_pymunk(model: Any) -> Loop:
    space, _ = model._module.build()

    def loop() -> None:
        for _ in range(STEPS):
            space.step(model.step)

    return loop


def bare_pinocchio(model: Any) -> Loop:
    import pinocchio as pin

    compiled = model._model
    data, damping = compiled.createData(), np.array(compiled.damping)

    def acceleration(q: Any, v: Any) -> Any:
        return pin.aba(compiled, data, q, v, -damping * v)  # dampers, which it leaves out

    def after(q: Any, move: Any) -> Any:
        return pin.integrate(compiled, q, move)

    return _runge_kutta(acceleration, after, pin.neutral(compiled), compiled.nv, model.step)


def bare_idyntree(model: Any) -> Loop:
    computed, mass, bias = model._computed, model._mass, model._bias
    (_, damping), n = model._joints(), len(model.coordinates)
    down = np.array(model.gravity)

    def acceleration(q: Any, v: Any) -> Any:
        computed.setRobotState(q, v, down)
        computed.getFreeFloatingMassMatrix(mass)
        computed.generalizedBiasForces(bias)
        forces = -damping * v - bias.jointTorques().toNumPy()
        return np.linalg.solve(mass.toNumPy()[6:, 6:], forces)

    return _runge_kutta(acceleration, np.add, np.zeros(n), n, model.step)


def _runge_kutta(acceleration: Any, after: Any, start: Any, n: int, h: float) -> Loop:
    def loop() -> None:
        q, v = start, np.zeros(n)
        for _ in range(STEPS):
            a = acceleration(q, v)
            v2 = v + h / 2 * a
            b = acceleration(after(q, h / 2 * v), v2)
            v3 = v + h / 2 * b
            c = acceleration(after(q, h / 2 * v2), v3)
            v4 = v + h * c
            d = acceleration(after(q, h * v3), v4)
            q = after(q, h / 6 * (v + 2 * v2 + 2 * v3 + v4))
            v = v + h / 6 * (a + 2 * b + 2 * c + d)

    return loop


def bare_drake(model: Any) -> Loop:
    plant = model._plant
    context = plant.CreateDefaultContext()
    plant.get_applied_generalized_force_input_port().FixValue(
        context, np.zeros(plant.num_velocities())
    )

    def loop() -> None:
        plant.SetPositions(context, np.zeros(plant.num_positions()))
        plant.SetVelocities(context, np.zeros(plant.num_velocities()))
        for _ in range(STEPS):
            context.SetDiscreteState(plant.EvalUniquePeriodicDiscreteUpdate(context))

    return loop


def bare_dart(model: Any) -> Loop:
    world, body = model._world, model._body

    def loop() -> None:
        world.setTimeStep(model.step)
        body.setPositions(np.zeros(body.getNumDofs()))
        body.setVelocities(np.zeros(body.getNumDofs()))
        for _ in range(STEPS):
            world.step()

    return loop


def bare_sapien(model: Any) -> Loop:
    body, system = model._body, model._scene.physx_system
    none = np.zeros(body.dof)

    def loop() -> None:
        body.qpos, body.qvel, body.qf = none, none, none
        system.timestep = model.step
        for _ in range(STEPS):
            system.step()

    return loop


BARE: dict[str, Callable[[Any], Loop]] = {
    "mujoco": bare_mujoco,
    "pybullet": bare_pybullet,
    "pymunk": bare_pymunk,
    "pinocchio": bare_pinocchio,
    "idyntree": bare_idyntree,
    "drake": bare_drake,
    "dart": bare_dart,
    "sapien": bare_sapien,
}


def best(loop: Loop) -> float:
    """Return the least processor time of some calls, seconds."""
    times = []
    for _ in range(REPEATS):
        began = time.process_time()
        loop()
        times.append(time.process_time() - began)
    return min(times)


def pendulums() -> Iterator[tuple[str, LoadedModel]]:
    """Yield the simple pendulum, in the file that each engine prefers."""
    folder = builtin() / "simple_pendulum"
    sidecars = [file for file in model_files(folder) if isinstance(file, Sidecar)]
    for name, engine in engines().items():
        if engine.version() is None:
            continue
        read = [sidecar for sidecar in sidecars if name in sidecar.engines]
        if read:
            best_format = min(read, key=lambda one: one.model.suffix not in engine.preferred)
            yield name, engine.load(best_format.spec(name))


def arms() -> Iterator[tuple[str, LoadedModel]]:
    """Yield an arm of seven joints in each engine."""
    robot = prepare_tree(ARM)
    for name, engine in engines().items():
        if engine.version() is not None and ".urdf" in engine.formats:
            yield name, model_task(robot, name).load()[0]


def costs(name: str, model: LoadedModel) -> tuple[str, ...]:
    """Return a row: a step through the adapter, bare, their ratio, and a state."""
    q = np.array(model.home)[None]

    def rollout() -> object:
        return model.rollout(q, 0 * q, model.step, STEPS, None, STEPS)

    rollout()
    step = best(rollout) / STEPS
    bare = ratio = state = "-"
    if name in BARE:
        loop = BARE[name](model)
        loop()
        ratios, least = [], []
        for _ in range(3):  # in turn, so that both see the same machine
            adapter, bare_loop = best(rollout), best(loop)
            ratios.append(adapter / bare_loop)
            least.append(bare_loop)
        bare, ratio = f"{1e6 * min(least) / STEPS:.2f}", f"{statistics.median(ratios):.2f}"
    random = np.random.default_rng(0)
    z = model.home + 0.1 * random.uniform(-1, 1, (STATES, q.shape[1]))
    if model.accelerations(z, z, 0 * z) is not None:
        state = f"{1e6 * best(lambda: model.accelerations(z, z, 0 * z)) / STATES:.1f}"
    return f"{1e6 * step:.2f}", bare, ratio, state


def costs_of_engines(console: Console) -> None:
    """Print the cost of each engine."""
    for title, models in (("a pendulum", pendulums), ("an arm of 7 joints", arms)):
        table = Table(
            "engine", "step, us", "bare, us", "ratio", "state, us", title=f"engines: {title}"
        )
        for name, model in models():
            table.add_row(name, *costs(name, model))
        console.print(table)


if __name__ == "__main__":
    costs_of_engines(Console(width=100))
