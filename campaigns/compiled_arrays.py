"""Faults planted in a loaded model: does the run differ, or is the number listed as not tested?

`python -m campaigns.compiled_arrays FILE...` changes one entry of each array of a compiled MJCF in
MuJoCo, or of each number of `changeDynamics` of a URDF in PyBullet, after loading, by 1e-4 and by
10 %, or a flag. It prints a table by array: faults planted, detected, listed (the file's numbers of
this kind are not counted as tested, or the file states none), without effect on any step from the
drawn states, and wrongly green. The exit code is 1 if any is wrongly green.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from campaigns.laws import spec_of
from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.law_states import KeptSteps
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import TreeTask, model_task
from physics_crosscheck.harness.diagnosis.coverage import SMOOTH, NumberEffect, counted_numbers
from physics_crosscheck.harness.documents.errors import FileError
from physics_crosscheck.harness.engines.protocol import EngineStep, WholeState
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.readers import robot_numbers
from physics_crosscheck.harness.records.outcome import Outcome

Plant = Callable[[Any], None]
"""Changes a loaded model."""

SHARES = (1e-4, 0.1)

STATES = 24
"""States at which steps with and without a fault are compared."""

PREFIXES = "body_", "jnt_", "dof_", "geom_", "site_", "tendon_", "actuator_", "eq_", "pair_", "qpos"
FLAGS = re.compile(
    r"\w+_(limited|contype|conaffinity|condim|priority|dim|active0|actgravcomp|actearly)"
)
OPTIONS = "timestep", "gravity", "wind", "density", "viscosity", "impratio", "integrator", "cone"
ATTRIBUTES: Mapping[str, str] = {
    "gap": "gap", "sameframe": "", "subtreemass": "", "invweight0": "", "rbound": "", "aabb": "",
    "margin": "margin", "solimp": "solimp.*", "solref": "solref.*", "friction": "friction",
    "key": "qpos", "cranklength": "cranklength", "lengthrange": "lengthrange", "group": "group",
    "user": "user", "rgba": "rgba", "size": "size", "pos": "pos", "quat": "quat",
    "frictionloss": "frictionloss", "range": "range", "fluid": "fluidcoef",
}  # fmt: skip
"""Pattern of the attribute that an array's last word stands for; others have their own name."""


def arrays(model: Any) -> Iterator[tuple[str, Any]]:
    """Yield the names of the arrays of a compiled model that a fault may change, with them."""
    for name in dir(model):
        if name.startswith(PREFIXES):
            values = getattr(model, name)
            usual = isinstance(values, np.ndarray) and values.size
            if usual and (values.dtype == np.float64 or FLAGS.fullmatch(name)):
                yield name, values
    for name in OPTIONS:
        yield f"opt.{name}", getattr(model.opt, name)


def array_faults(model: Any, rng: np.random.Generator) -> Iterator[tuple[str, Plant]]:
    """Yield the name of each array of a model with changes of one of its entries."""
    for name, values in arrays(model):
        size, place = np.size(values), int(rng.integers(np.size(values)))
        used = np.flatnonzero(np.asarray(values).ravel())
        place = int(rng.choice(used)) if len(used) else place
        whole = np.asarray(values).dtype.kind not in "f"
        for share in SHARES[:1] if whole else SHARES:
            yield name, _change(name, place, None if whole else share, scalar=size == 1)


def _change(name: str, place: int, share: float | None, *, scalar: bool) -> Plant:
    def plant(loaded: Any) -> None:
        model: Any = getattr(loaded, "_model", None) or loaded.model
        owner, _, key = name.rpartition(".")
        there = model.opt if owner else model
        values = np.array(getattr(there, key))
        flat = values.reshape(-1)
        if share is not None:
            flat[place] += share * (flat[place] or 1.0)
        else:
            flat[place] = 1 - min(flat[place], 1)
        setattr(there, key, values if values.ndim else values.item())

    return plant


def dynamics_faults(body: int, rng: np.random.Generator) -> Iterator[tuple[str, Plant]]:
    """Yield the names of numbers of PyBullet's `changeDynamics` with changes of one link."""
    import pybullet as p

    link = int(rng.integers(0, max(1, p.getNumJoints(body))))
    info = p.getDynamicsInfo(body, link)
    mass, friction, inertia, restitution, damping, stiffness = (info[k] for k in (0, 1, 2, 5, 8, 9))
    lower, upper = p.getJointInfo(body, link)[8:10]
    for share in SHARES:
        up = 1 + share
        changes: dict[str, dict[str, Any]] = {
            "mass": {"mass": up * mass},
            "localInertiaDiagonal": {"localInertiaDiagonal": [up * one for one in inertia]},
            "lateralFriction": {"lateralFriction": up * friction},
            "restitution": {"restitution": up * restitution or share},
            "linearDamping": {"linearDamping": share},
            "angularDamping": {"angularDamping": share},
            "jointDamping": {"jointDamping": share},
            "contactStiffness": {
                "contactStiffness": up * max(stiffness, 1e4), "contactDamping": max(damping, 10.0)
            },
            "jointLowerLimit": {
                "jointLowerLimit": lower - share, "jointUpperLimit": max(lower, upper)
            },
        }  # fmt: skip
        for name, values in changes.items():
            yield name, _set_dynamics(link, values)


def _set_dynamics(link: int, values: Mapping[str, Any]) -> Plant:
    def plant(loaded: Any) -> None:
        import pybullet as p

        p.changeDynamics(loaded._body, link, **values)

    return plant


def run_with(task: TreeTask, plant: Plant | None) -> Outcome:
    """Run a case whose engine changes each model after loading it."""
    engine = engines()[task.engine]
    task = task.with_target(steps=KeptSteps())

    def planted(load: Callable[[Any], Any]) -> Callable[[Any, Any], Any]:
        def changed(_: Any, spec: Any) -> Any:
            model = load(spec)
            if model is not None and plant is not None:
                plant(model)
            return model

        return changed

    kind = type(engine)
    with (
        patch.object(kind, "load", planted(engine.load)),
        patch.object(kind, "load_whole", planted(engine.load_whole)),
    ):
        return run_case(task).outcome


class PlantedRobot:
    """A file that agrees, with its steps and the coverage of each attribute."""

    def __init__(self, file: Path, rng: np.random.Generator) -> None:
        self.engine, spec = spec_of(file)
        self.task = model_task(prepare_tree(file, states=8), self.engine)
        self.task = self.task.with_settings(**spec.settings)
        self.agrees = run_with(self.task, None) is Outcome.AGREES
        self._spec = spec
        model = self._load()
        self.states = list(self._drawn(model, rng))
        self.steps = [model.evaluate(state) for state in self.states]
        self.faults = list(
            dynamics_faults(model._body, rng)
            if self.engine == "pybullet"
            else array_faults(model._model, rng)
        )
        counted = counted_numbers(self.task, robot_numbers(file, self.task.spec.settings))
        tested = (*SMOOTH, NumberEffect.SHAPES)
        self.tested = {
            one.path.rpartition("@")[2] for one in counted if one.bound or one.effect in tested
        }

    def _load(self) -> Any:
        return engines()[self.engine].load_whole(self._spec)

    def _drawn(self, model: Any, rng: np.random.Generator) -> Iterator[WholeState]:
        start = next(iter(model.starts))
        for k in range(STATES):
            moved = model.moved(start, int(rng.integers(1, 300))) if k % 2 else start
            sizes = (0.3 * rng.normal(size=len(one)) for one in (moved.z, moved.m))
            z, m = (one + more for one, more in zip((moved.z, moved.m), sizes, strict=True))
            controls = rng.uniform(-2, 2, len(moved.controls)) + 0 * moved.controls
            yield moved._replace(z=z if k % 4 > 1 else moved.z, m=m, controls=controls)

    def acts(self, plant: Plant) -> bool:
        """Return whether a fault changes a step from a state."""
        model = self._load()
        plant(model)
        return any(
            _apart(model.evaluate(state), step)
            for state, step in zip(self.states, self.steps, strict=True)
        )

    def verdict(self, name: str, plant: Plant) -> str:
        """Return what a fault leads to."""
        try:
            if run_with(self.task, plant) is not Outcome.AGREES:
                return "detected"
            if not self.acts(plant):
                return "no effect"
        except FileError:
            return "detected"
        word = name.rpartition("_")[2].rpartition(".")[2]
        pattern = ATTRIBUTES.get(word, word)
        tested = any(re.fullmatch(pattern, key) for key in self.tested if pattern)
        return "wrongly green" if tested else "listed"


def _apart(step: EngineStep, other: EngineStep) -> bool:
    """Return whether two steps differ by more than the resolution."""
    if len(step.contacts) != len(other.contacts):
        return True
    pairs = [(step.acceleration, other.acceleration), (step.after.z, other.after.z),
             (step.after.activations, other.after.activations)]  # fmt: skip
    return any(
        np.max(np.abs(a - b), initial=0.0) > 1e-9 * (1 + np.max(np.abs(b), initial=0.0))
        for a, b in pairs
    )


def plant_in(paths: Sequence[Path], seed: int, only: str = "") -> dict[str, Counter[str]]:
    """Plant faults in robots; return the counts of verdicts by array, and print wrong ones."""
    table: dict[str, Counter[str]] = {}
    for path in paths:
        rng = np.random.default_rng(seed)
        robot = PlantedRobot(path, rng)
        if not robot.agrees:
            print(f"{path.name}: skipped, since it does not agree", flush=True)
            continue
        for name, plant in robot.faults:
            if re.fullmatch(only or ".*", name):
                verdict = robot.verdict(name, plant)
                table.setdefault(name, Counter())[verdict] += 1
                if verdict == "wrongly green":
                    print(f"{path.parent.name}/{path.name}: {name} is wrongly green", flush=True)
    return table


def main() -> None:
    """Plant faults and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("paths", nargs="+", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="pattern of names of arrays")
    options = parser.parse_args()
    table = plant_in(options.paths, options.seed, options.only)
    kinds = ("detected", "listed", "no effect", "wrongly green")
    print(f"{'array':28} {'planted':>8}" + "".join(f"{kind:>15}" for kind in kinds))
    for name, count in sorted(table.items()):
        cells = "".join(f"{count[kind]:15}" for kind in kinds)
        print(f"{name:28} {count.total():8}{cells}")
    whole = sum(table.values(), Counter[str]())
    print(dict(whole))
    sys.exit(bool(whole["wrongly green"]))


if __name__ == "__main__":
    main()
