"""Time of segments over a hand-written loop, and their steps over those of plain refinement."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from physics_crosscheck.harness.checks.prepare import prepare_system
from physics_crosscheck.harness.checks.task import load
from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.folders import builtin, system_folders
from physics_crosscheck.harness.modelfiles.model_files import model_files
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.full_run import CompleteRun, full_run
from physics_crosscheck.harness.numerics.ladder import weights
from physics_crosscheck.harness.numerics.rounding import with_companions
from physics_crosscheck.harness.numerics.segments import Extrapolated, extrapolate
from physics_crosscheck.reference.solving.segments import Motion, Segments

REPEATS = 5
Rollout = tuple[float, int, list[list[float]], list[list[float]], Array | None]
"""Step, number of steps, states z and w, and forces (spans, steps, nz) if any act."""
MODELS = {"mujoco": "mujoco.xml", "pybullet": "robot.urdf", "pymunk": "space.py"}
TARGET, MEASURED = 1e-9, 1e-4
"""Discrepancy to certify, and the error to which plain refinement runs; its order gives the rest.
To 1e-5 it takes minutes a case."""


def sidecar_of(folder: Path, name: str) -> Sidecar:
    return next(s for s in model_files(folder) if isinstance(s, Sidecar) and s.model.name == name)


def segments(
    batch: Segments, coordinates: CoordinateMap, rungs: Iterable[int], epsilon: float
) -> Iterator[Rollout]:
    """Yield every rollout of a ladder, with those of companions."""
    starts = with_companions(*coordinates.to_engine(batch.start), epsilon)
    lengths = batch.lengths[starts.rows]
    for rung in rungs:
        for length in np.unique(lengths):
            chosen = lengths == length
            u = batch.step_inputs(starts.rows[chosen], rung) * starts.gain[chosen, None, None]
            push = coordinates.push_matrix if u.any() else None
            force = None if push is None else u @ push.T
            h = float(length) / rung
            yield h, rung, starts.z[chosen].tolist(), starts.w[chosen].tolist(), force


def bare_mujoco(sidecar: Sidecar, rollouts: Iterable[Rollout]) -> None:
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(sidecar.model))
    data = mujoco.MjData(model)
    for h, n, z, w, force in rollouts:
        model.opt.timestep = h
        for b in range(len(z)):
            mujoco.mj_resetData(model, data)
            data.qpos[:], data.qvel[:] = z[b], w[b]
            if force is None:
                mujoco.mj_step(model, data, nstep=n)
            else:
                for i in range(n):
                    data.qfrc_applied[:] = force[b, i]
                    mujoco.mj_step(model, data)
            data.qpos.copy(), data.qvel.copy()


def bare_pybullet(sidecar: Sidecar, rollouts: Iterable[Rollout], springs: Sequence[float]) -> None:
    import pybullet as p

    p.resetSimulation()
    p.setPhysicsEngineParameter(enableFileCaching=0, numSubSteps=0)
    p.setGravity(*sidecar.settings["gravity"])  # type: ignore[misc]  # checked by the sidecar
    body = p.loadURDF(str(sidecar.model), useFixedBase=1, flags=p.URDF_USE_INERTIA_FROM_FILE)
    joints = [j for j in range(p.getNumJoints(body)) if p.getJointInfo(body, j)[2] != p.JOINT_FIXED]
    for link in range(-1, p.getNumJoints(body)):
        p.changeDynamics(body, link, linearDamping=0, angularDamping=0)
    p.setJointMotorControlArray(body, joints, p.VELOCITY_CONTROL, forces=[0.0] * len(joints))
    for h, n, z, w, force in rollouts:
        p.setTimeStep(h)
        for b in range(len(z)):
            for i, joint in enumerate(joints):
                p.resetJointState(body, joint, z[b][i], w[b][i])
            states = p.getJointStates(body, joints)
            for i in range(n):
                tau = [-k * s[0] for k, s in zip(springs, states, strict=True)]
                if force is not None:
                    tau = [a + f for a, f in zip(tau, force[b, i], strict=True)]
                p.setJointMotorControlArray(body, joints, p.TORQUE_CONTROL, forces=tau)
                p.stepSimulation()
                states = p.getJointStates(body, joints)


def bare_pymunk(build: Callable[[], Any], rollouts: Iterable[Rollout]) -> None:
    space, bodies = build()
    bodies = list(bodies.values())
    for h, n, z, w, force in rollouts:
        for b in range(len(z)):
            for j, body in enumerate(bodies):
                body.position = (z[b][3 * j], z[b][3 * j + 1])
                body.angle = z[b][3 * j + 2]
                body.velocity = (w[b][3 * j], w[b][3 * j + 1])
                body.angular_velocity = w[b][3 * j + 2]
            for i in range(n):
                if force is not None:
                    for j, body in enumerate(bodies):
                        fx, fy, torque = force[b, i, 3 * j : 3 * j + 3]
                        body.force = (fx, fy)
                        body.torque = torque
                space.step(h)
            [(body.position, body.angle, body.velocity, body.angular_velocity) for body in bodies]


def paired(harness: Callable[[], object], bare: Callable[[], object]) -> tuple[float, float, float]:
    """Return the median ratio and the median times of calls that run in turn."""
    first: list[float] = []
    second: list[float] = []
    for _ in range(REPEATS):
        for call, times in ((harness, first), (bare, second)):
            began = time.process_time()
            call()
            times.append(time.process_time() - began)
    ratios = [a / b for a, b in zip(first, second, strict=True)]
    return statistics.median(ratios), statistics.median(first), statistics.median(second)


def loaded_ladder(
    sidecar: Sidecar, engine: str, coordinates: CoordinateMap, batch: Segments
) -> Extrapolated:
    """Load a model and run its ladder, as the bare loop does."""
    model = engines()[engine].load(sidecar.spec(engine))
    return extrapolate(model, coordinates, batch, resolution=1e-9)


def overhead(console: Console) -> dict[str, float]:
    ratios = {}
    table = Table("engine", "case", "steps", "harness", "bare loop", "ratio", title="harness time")
    cases = [("torsional_disc", "free"), ("torsional_disc", "beat"), ("mass_spring_damper", "free")]
    cases += [("drum_pendulum", "free")]
    for name, scenario in cases:
        prepared = prepare_system(builtin() / name)
        batch = prepared.motions[scenario]
        for engine, file in MODELS.items():
            if engine == "pybullet" and name == "drum_pendulum":
                file = "robot_folded.urdf"
            sidecar = sidecar_of(prepared.place, file)
            model, coordinates = load(prepared.system, sidecar, engine)
            limits = extrapolate(model, coordinates, batch, resolution=1e-9)
            rollouts = list(segments(batch, coordinates, limits.rungs, model.epsilon))
            assert sum(n * len(z) for _, n, z, _, _ in rollouts) == limits.steps
            if engine == "mujoco":
                bare = partial(bare_mujoco, sidecar, rollouts)
            elif engine == "pybullet":
                stiffness = {"torsional_disc": [0.85], "mass_spring_damper": [47.0]}
                springs = stiffness.get(name, [65.0, 0.0])
                bare = partial(bare_pybullet, sidecar, rollouts, springs)
            else:
                build = model._module.build  # type: ignore[attr-defined]  # pymunk's model alone
                bare = partial(bare_pymunk, build, rollouts)
            ladder = partial(extrapolate, model, coordinates, batch, resolution=1e-9)
            loaded = partial(loaded_ladder, sidecar, engine, coordinates, batch)
            ratio, seconds, bare_seconds = paired(loaded if engine == "pybullet" else ladder, bare)
            table.add_row(
                engine,
                f"{name}/{scenario}",
                f"{limits.steps}",
                f"{seconds:.3f} s",
                f"{bare_seconds:.3f} s",
                f"{ratio:.2f}",
            )
            ratios[f"segments: harness / bare loop, {engine}, {name}/{scenario}"] = ratio
    console.print(table)
    return ratios


def largest_error(outcome: CompleteRun, size: Array) -> float:
    """Return the largest error of the first coordinate, relative to its size."""
    return float(np.max(np.abs(outcome.error[:, :1]) / size))


def fewest_steps(limits: Extrapolated, motion: Motion, exponents: tuple[int, int]) -> int:
    """Count the steps of the fewest rungs whose limit is right to the target, without companions.

    Only a known solution shows that they suffice; they give no uncertainty.
    """
    for count in range(1, len(limits.rungs) + 1):
        rungs = limits.rungs[:count]
        limit = np.tensordot(weights(rungs, exponents), limits.raw[:count], axes=1)
        if np.max(np.abs(limit - motion.end) / motion.unit) <= TARGET:
            break
    return len(motion.t) * sum(rungs)


def refined(
    motion: Motion, run_at: Callable[[float], CompleteRun], h: float
) -> tuple[float, float]:
    """Return the steps that plain refinement needs for the target, and its order, from two runs.

    Args:
        run_at: a run from start to end at a step.
        h: a step to begin with.
    """
    size = motion.amplitude[:1]
    # Shorten the step in stages, until the error is proportional to it.
    for _ in range(3):
        error = largest_error(run_at(h), size)
        if error < 1.5 * MEASURED:
            break
        h *= max(MEASURED / error, 1 / 50)
    fine, finer = largest_error(run_at(h), size), largest_error(run_at(h / 1.25), size)
    order = math.log(fine / finer) / math.log(1.25)
    return motion.duration / h * 1.25 * (finer / TARGET) ** (1 / order), order


def certification(console: Console) -> dict[str, float]:
    """Print the steps that certify the free motion of each built-in system, and return ratios."""
    steps = {}
    table = Table(
        "system",
        "engine",
        "segments: steps",
        "certified to",
        "least: steps",
        "ratio",
        "order",
        "plain: steps (extrapolated)",
        "ratio",
        title="steps to certify to 1e-9",
    )
    for folder in system_folders([]):
        prepared = prepare_system(folder)
        motion = prepared.motions["free"]
        for engine, file in MODELS.items():
            sidecar = sidecar_of(folder, file)
            model, coordinates = load(prepared.system, sidecar, engine)
            limits = extrapolate(model, coordinates, motion, resolution=TARGET)
            certified = float(np.max((limits.limit.uncertainty + motion.bound) / motion.unit))
            fewest = fewest_steps(limits, motion, model.exponents(motion.varying))
            run_at = partial(full_run, model, coordinates, motion, prepared.numeric_power)
            needed, order = refined(motion, run_at, model.step)
            table.add_row(
                prepared.system.name,
                engine,
                f"{limits.steps}",
                f"{certified:.0e}",
                f"{fewest}",
                f"{limits.steps / fewest:.1f}",
                f"{order:.3f}",
                f"{needed:.2g}",
                f"{needed / limits.steps:.2g}",
            )
            name = f"{prepared.system.name}/free, {engine}"
            steps[f"steps to certify 1e-9, {name}"] = float(limits.steps)
            steps[f"steps to certify 1e-9 / least, {name}"] = limits.steps / fewest
    console.print(table)
    return steps
