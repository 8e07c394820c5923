"""Benchmarks, as ratios within one run: `make bench`.

1. The harness's time for a scenario's ladder against a hand-written loop of the same engine that
   does the same steps from the same states.
2. Engine steps to certify a trajectory to 1e-9 against the steps that plain refinement would need.
3. The whole matrix with two workers against one.
4. The report of it, and one of two thousand cases: size, time to draw it up, and in a headless
   Chromium until it can be used, and until a case's first plots are drawn.
5. Two files of an arm of seven joints held against each other: processor time, and discrepancies.
6. Each engine that is installed: microseconds a step and a state, beside a bare loop.
"""

from __future__ import annotations

import importlib.util
import math
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from msgspec.structs import replace
from rich.console import Console
from rich.table import Table

from benchmarks.bench_engines import costs_of_engines
from benchmarks.bench_robots import robots
from harness.cases.case import load
from harness.cases.prepare import prepare
from harness.compare.candidate import candidate
from harness.compare.compare import CompareOptions, compare
from harness.compare.executor import at_once
from harness.engines.protocol import Array
from harness.engines.registry import engines
from harness.files.folders import builtin, system_folders
from harness.files.model_files import model_files
from harness.files.sidecar import Sidecar
from harness.numerics.coordinates import CoordinateMap
from harness.numerics.full_run import FullRun, full_run
from harness.numerics.segments import Batch, Extrapolated, extrapolate
from harness.records.case import Case
from harness.records.model import Model
from harness.records.results import Results
from harness.records.system import System
from harness.report import write_report
from harness.run import Options, run
from reference.motion import Motion
from tests.report.chromium import CHROMIUM, running

REPEATS = 5
Rollout = tuple[float, int, list[list[float]], list[list[float]], Array | None]
"""Step, number of steps, states z and w, and forces (spans, steps, nz) if any act."""
MODELS = {"mujoco": "mujoco.xml", "pybullet": "robot.urdf", "pymunk": "space.py"}
TARGET, MEASURED = 1e-9, 1e-5


def sidecar_of(folder: Path, name: str) -> Sidecar:
    return next(s for s in model_files(folder) if isinstance(s, Sidecar) and s.model.name == name)


def segments(motion: Motion, coordinates: CoordinateMap, rungs: Iterable[int]) -> Iterator[Rollout]:
    """(h, n, states z and w, forces or None) of every rollout that a ladder takes."""
    z, w = coordinates.to_engine(motion.start)
    for rung in rungs:
        first = 0
        for span in motion.spans:
            chosen = slice(first, first + span.count)
            first += span.count
            h = span.length / rung
            times = motion.t[chosen, None] + h * np.arange(rung)
            u = motion.inputs(times.ravel()).reshape(span.count, rung, -1)
            push = coordinates.push_matrix if u.any() else None
            force = None if push is None else u @ push.T
            yield h, rung, z[chosen].tolist(), w[chosen].tolist(), force


def bare_mujoco(sidecar: Sidecar, work: Iterable[Rollout]) -> None:
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(sidecar.model))
    data = mujoco.MjData(model)
    for h, n, z, w, force in work:
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


def bare_pybullet(sidecar: Sidecar, work: Iterable[Rollout], springs: Sequence[float]) -> None:
    import pybullet as p

    p.resetSimulation()
    p.setPhysicsEngineParameter(enableFileCaching=0, numSubSteps=0)
    p.setGravity(*sidecar.settings["gravity"])  # type: ignore[misc]  # checked by the sidecar
    body = p.loadURDF(str(sidecar.model), useFixedBase=1, flags=p.URDF_USE_INERTIA_FROM_FILE)
    joints = [j for j in range(p.getNumJoints(body)) if p.getJointInfo(body, j)[2] != p.JOINT_FIXED]
    for link in range(-1, p.getNumJoints(body)):
        p.changeDynamics(body, link, linearDamping=0, angularDamping=0)
    p.setJointMotorControlArray(body, joints, p.VELOCITY_CONTROL, forces=[0.0] * len(joints))
    for h, n, z, w, force in work:
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


def bare_pymunk(build: Callable[[], Any], work: Iterable[Rollout]) -> None:
    space, bodies = build()
    bodies = list(bodies.values())
    for h, n, z, w, force in work:
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


def paired(ours: Callable[[], object], theirs: Callable[[], object]) -> tuple[float, float, float]:
    """Median ratio and the two median times of calls taken in turn."""
    first: list[float] = []
    second: list[float] = []
    for _ in range(REPEATS):
        for call, times in ((ours, first), (theirs, second)):
            began = time.perf_counter()
            call()
            times.append(time.perf_counter() - began)
    ratios = [a / b for a, b in zip(first, second, strict=True)]
    return statistics.median(ratios), statistics.median(first), statistics.median(second)


def loaded_ladder(
    sidecar: Sidecar, engine: str, coordinates: CoordinateMap, batch: Batch
) -> Extrapolated:
    """A ladder with the loading of its model, which the bare loop has as well."""
    model = engines()[engine].load(sidecar.spec(engine))
    return extrapolate(model, coordinates, batch, resolution=1e-9)


def overhead(console: Console) -> None:
    table = Table("engine", "case", "steps", "harness", "bare loop", "ratio", title="harness time")
    cases = [("torsional_disc", "free"), ("torsional_disc", "beat"), ("mass_spring_damper", "free")]
    cases += [("drum_pendulum", "free")]
    for name, scenario in cases:
        prepared = prepare(builtin() / name)
        motion, scale = prepared.motions[scenario], prepared.scales[scenario]
        for engine, file in MODELS.items():
            if engine == "pybullet" and name == "drum_pendulum":
                file = "robot_folded.urdf"
            sidecar = sidecar_of(prepared.folder, file)
            model, coordinates = load(prepared.system, sidecar, engine)
            batch = Batch.of(motion, scale)
            found = extrapolate(model, coordinates, batch, resolution=1e-9)
            work = list(segments(motion, coordinates, found.rungs))
            if engine == "mujoco":
                bare = partial(bare_mujoco, sidecar, work)
            elif engine == "pybullet":
                stiffness = {"torsional_disc": [0.85], "mass_spring_damper": [47.0]}
                springs = stiffness.get(name, [65.0, 0.0])
                bare = partial(bare_pybullet, sidecar, work, springs)
            else:
                build = model._module.build  # type: ignore[attr-defined]  # pymunk's model alone
                bare = partial(bare_pymunk, build, work)
            ladder = partial(extrapolate, model, coordinates, batch, resolution=1e-9)
            ours = partial(loaded_ladder, sidecar, engine, coordinates, batch)
            ratio, t_ours, t_bare = paired(ours if engine == "pybullet" else ladder, bare)
            table.add_row(
                engine,
                f"{name}/{scenario}",
                f"{found.steps}",
                f"{t_ours:.3f} s",
                f"{t_bare:.3f} s",
                f"{ratio:.2f}",
            )
    console.print(table)


def largest_error(outcome: FullRun, size: Array) -> float:
    """Of the first coordinate, as a share of its size."""
    return float(np.max(np.abs(outcome.error[:, :1]) / size))


def certification(console: Console) -> None:
    table = Table(
        "engine",
        "segments: steps",
        "certified to",
        "plain: steps to 1e-5",
        "order",
        "plain: steps to 1e-9 (extrapolated)",
        "ratio",
        title="steps to certify to 1e-9",
    )
    prepared = prepare(builtin() / "mass_spring_damper")
    motion, scale = prepared.motions["free"], prepared.scales["free"]
    for engine, file in MODELS.items():
        model, coordinates = load(prepared.system, sidecar_of(prepared.folder, file), engine)
        found = extrapolate(model, coordinates, Batch.of(motion, scale), resolution=1e-9)
        certified = float(np.max((found.limit.uncertainty + motion.bound) / scale))
        size = motion.amplitude[:1]

        run_at = partial(full_run, model, coordinates, motion, prepared.power)
        h = model.step
        h *= 1.2 * MEASURED / largest_error(run_at(h), size)
        fine, finer = largest_error(run_at(h), size), largest_error(run_at(h / 1.25), size)
        order = math.log(fine / finer) / math.log(1.25)
        measured = motion.duration / h * 1.25 * (finer / MEASURED) ** (1 / order)
        needed = measured * (MEASURED / TARGET) ** (1 / order)
        table.add_row(
            engine,
            f"{found.steps}",
            f"{certified:.0e}",
            f"{measured:.3g}",
            f"{order:.3f}",
            f"{needed:.2g}",
            f"{needed / found.steps:.2g}",
        )
    console.print(table)


def multiplied(found: Results, times: int) -> Results:
    """The same results with each system several times, under other names."""
    systems: list[System] = []
    models: list[Model] = []
    cases: list[Case] = []
    for i in range(times):
        systems += [
            replace(one, folder=f"{one.folder}_{i}", name=f"{one.name}_{i}")
            for one in found.systems
        ]
        models += [replace(one, **renamed(one, i)) for one in found.models]
        cases += [replace(one, **renamed(one, i)) for one in found.cases]
    return replace(found, systems=tuple(systems), models=tuple(models), cases=tuple(cases))


def renamed(one: Model | Case, i: int) -> dict[str, str]:
    return {"folder": f"{one.folder}_{i}", "system": f"{one.system}_{i}"}


def report(console: Console, found: Results) -> None:
    table = Table(
        "cases",
        "HTML",
        "drawn up in",
        "usable after",
        "a case's first plots after",
        "filtered in",
        title="Report",
    )
    for times in (1, math.ceil(2000 / len(found.cases))):
        results = multiplied(found, times)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "index.html"
            began = time.perf_counter()
            write_report(path, results)
            drawn_up = time.perf_counter() - began
            size = f"{path.stat().st_size / 1e6:.1f} MB"
            seen = looked_at(path) if CHROMIUM else ("no browser",) * 3
        table.add_row(str(len(results.cases)), size, f"{drawn_up:.1f} s", *seen)
    console.print(table)


FILTER = """(() => {
  const began = performance.now();
  const field = document.getElementById("search");
  field.value = "pybullet";
  field.dispatchEvent(new Event("input"));
  document.body.offsetHeight;
  return (performance.now() - began) / 1000;
})()"""


def looked_at(path: Path) -> tuple[str, ...]:
    """Median times of a page in a browser: until usable, a case drawn, the list filtered."""
    usable, opened, filtered = [], [], []
    with running(path.parent) as browser:
        for _ in range(REPEATS):
            with browser.tab() as tab:
                began = time.perf_counter()
                tab.open(path.as_uri())
                usable.append(time.perf_counter() - began)
                began = time.perf_counter()
                tab.go(
                    tab.run("document.querySelector('[data-pack^=pack-case]').closest('.case').id")
                )
                tab.until("document.querySelector('.view.current [data-drawn]')")
                opened.append(time.perf_counter() - began)
                tab.go("overview")
                filtered.append(tab.run(FILTER))
    return tuple(f"{statistics.median(times):.2f} s" for times in (usable, opened, filtered))


def matrix(console: Console) -> Results:
    folders = system_folders([])
    times = {}
    for jobs in (1, 2):
        began = time.perf_counter()
        found = run(folders, Options(jobs=jobs), lambda *_: None).results
        times[jobs] = time.perf_counter() - began
    worked = {"derive, linearize, solve": sum(system.seconds for system in found.systems)}
    worked["run and judge cases"] = sum(case.seconds for case in found.cases)
    console.print(
        f"whole matrix, {len(found.cases)} cases: one worker {times[1]:.1f} s, two"
        f" {times[2]:.1f} s, ratio {times[2] / times[1]:.2f}"
    )
    for what, seconds in worked.items():
        console.print(f"  {what}: {seconds:.1f} s of worker time")
    by_engine: dict[str, float] = {}
    for case in found.cases:
        by_engine[case.engine] = by_engine.get(case.engine, 0.0) + case.seconds
    for engine, seconds in sorted(by_engine.items()):
        console.print(f"    {engine}: {seconds:.1f} s")
    return found


def comparisons(console: Console) -> None:
    """Of PyBullet's kuka: as it is in two engines, and with one mass off by a millionth."""
    data = importlib.util.find_spec("pybullet_data")
    if data is None or data.origin is None:
        console.print("no arm to compare: pybullet_data is not installed")
        return
    path = Path(data.origin).parent / "kuka_iiwa" / "model.urdf"
    table = Table("B", "outcome", "discrepancy", "uncertainty", "told", "work", title="compare")
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    code = "import harness.cli.compare"
    subprocess.run([sys.executable, "-c", code], check=True)  # this interpreter
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as folder:
        other = Path(folder) / "off.urdf"
        other.write_text(path.read_text().replace('"1.8"', '"1.8000018"', 1))
        for b, engine in ((path, "mujoco"), (other, "mujoco"), (other, "pybullet")):
            began = time.process_time()
            pair = CompareOptions(a=candidate("A", path, "pybullet"), b=candidate("B", b, engine))
            found = compare(pair, at_once)
            table.add_row(
                f"{b.name} in {engine}",
                str(found.judgement.outcome),
                f"{found.judgement.discrepancy:.1e}",
                f"{found.judgement.uncertainty:.1e}",
                "; ".join(one.message for one in found.properties) or "nothing",
                f"{time.process_time() - began:.2f} s",
            )
    console.print(table)
    start = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    console.print(f"beside the work the command and its worker start, {start:.2f} s each")


def main() -> None:
    console = Console(width=140)
    comparisons(console)
    costs_of_engines(console)
    robots(console)
    overhead(console)
    certification(console)
    report(console, matrix(console))


if __name__ == "__main__":
    main()
