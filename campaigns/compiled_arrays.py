"""Faults planted in a loaded model: does the run differ, or is the number listed as not tested?

`python -m campaigns.compiled_arrays FILE... [--engine NAME]` changes entries of each array of a
compiled MJCF in MuJoCo, or each number that has a setter in PyBullet, Drake or DART, after loading,
by 1e-4 and by 10 %, or a flag. It prints a table: faults planted, detected, listed (the file's
number is not counted as tested), not stated in the file, without effect on any step, and wrongly
green. The exit code is 1 if any is wrongly green.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from campaigns.laws import spec_of
from campaigns.setters import SETTERS, SHARES, LoadedFault, Place, Plant, planting, setter_faults
from physics_crosscheck.harness.checks import law_states
from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.law_states import KeptSteps
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import TreeTask, model_task
from physics_crosscheck.harness.checks.whole_step import check_whole_step
from physics_crosscheck.harness.diagnosis.coverage import SMOOTH, NumberEffect, counted_numbers
from physics_crosscheck.harness.documents.errors import FileError
from physics_crosscheck.harness.engines.protocol import EngineStep, WholeState
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.mjcf.stated import StatedLaws
from physics_crosscheck.harness.modelfiles.readers import robot_numbers
from physics_crosscheck.harness.numerics.segments import BlownUpError
from physics_crosscheck.harness.records.outcome import Outcome

STATES = 24
"""Further states at which steps with and without a fault are compared."""

SELDOM = 10
"""Share of the states, one in so many, that are tried for each fault alone."""

SEED = 8
"""Seed of states that are drawn as those of the run, which are tried too."""

PREFIXES = "body_", "jnt_", "dof_", "geom_", "site_", "tendon_", "actuator_", "eq_", "pair_", "qpos"
FLAGS = re.compile(
    r"\w+_(limited|contype|conaffinity|condim|priority|dim|active0|actgravcomp|actearly)"
)
OPTIONS = "timestep", "gravity", "wind", "density", "viscosity", "impratio", "integrator", "cone"
ATTRIBUTES: Mapping[str, str] = {
    "sameframe|subtreemass|invweight0|rbound|aabb|M0|acc0|length0?|lengthrange|user|rgba|group": "",
    "sol(ref|imp)(_lim|_fri)?": "sol(ref|imp)(limit|friction)?", "active0": "active",
    "size": "size|fromto|height", "i?pos": "pos|fromto", "i?quat": "quat|euler|axisangle|fromto",
    "inertia": "diaginertia|fullinertia|mass|density", "mass": "mass|density",
    "limited": "range|limited", "actfrcrange": "actuatorfrcrange", "fluid": "fluidcoef",
    "gainprm|biasprm": "gainprm|biasprm|k[pv]|dampratio", "data": "polycoef|anchor|relpose",
    "dynprm": "dynprm|timeconst", "lengthspring": "springlength", "dim": "condim",
    "qpos0": "ref", "spring": "springref", "dampingpoly": "damping", "stiffnesspoly": "stiffness",
    "actgravcomp": "actuatorgravcomp",
}  # fmt: skip
"""Patterns of attributes by patterns of the last words of arrays; others have their own name."""

ELEMENTS: Mapping[str, str] = {
    "body": "(body|inertial|geom)", "jnt": "(free)?joint", "dof": "(free)?joint", "qpos": "joint",
    "tendon": "(fixed|spatial|tendon)", "eq": r"equality(/\w+)?", "opt": "option",
    "actuator": r"(actuator|default.*)/\w+",
}  # fmt: skip
"""Patterns of elements by first words of arrays; others have their own name."""


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


KINDS_OF_TEXT = {"jnt": "joint", "dof": "joint", "actuator": "drive", "eq": "equality"}
"""Kinds of elements of the text by first words of arrays; others have their own name."""


def array_faults(
    model: Any, stated: StatedLaws, rng: np.random.Generator, each: int
) -> Iterator[LoadedFault]:
    """Yield changes of entries of each array of a model, which `stated` is the text of."""
    for name, values in arrays(model):
        used = np.flatnonzero(np.asarray(values).ravel())
        places = used if len(used) else np.arange(np.size(values))
        chosen = rng.choice(places, min(each, len(places)), replace=False)
        whole = np.asarray(values).dtype.kind not in "f"
        first, _, last = name.replace(".", "_").partition("_")
        last = last.rpartition("_")[2] if not last.endswith(("_lim", "_fri")) else last
        key = next((k for word, k in ATTRIBUTES.items() if re.fullmatch(word, last)), last)
        path = f"mujoco(/.*)?/{ELEMENTS.get(first, first)}@({key or '-'})"
        for place in map(int, chosen):
            row, word = divmod(place, np.size(values) // max(1, len(np.atleast_1d(values))))
            owner, sources = _owner(model, first, row), tuple(_chain(stated, model, first, row))
            for share in (None,) if whole else SHARES:
                yield LoadedFault(name, _change(name, place, share), path, owner, word, sources)


def _chain(stated: StatedLaws, model: Any, kind: str, row: int) -> Iterator[Place]:
    """Yield the places of an element and of the defaults that it takes; none for bodies."""
    row = int(model.dof_jntid[row]) if kind == "dof" else row
    kind = KINDS_OF_TEXT.get(kind, kind)
    if kind in ("joint", "geom", "site", "tendon", "drive", "equality", "pair"):
        for element in stated.elements(kind, row):
            file, _ = element.place
            yield Path(file or ""), element.start


def _owner(model: Any, kind: str, row: int) -> str:
    """Return the name of an element, or of its body."""
    if kind == "dof":
        kind, row = "jnt", int(model.dof_jntid[row])
    if kind not in ("body", "jnt", "geom", "site", "tendon", "actuator"):
        return ""
    item = getattr(model, "joint" if kind == "jnt" else kind)(row)
    return str(
        item.name or (model.body(int(item.bodyid[0])).name if hasattr(item, "bodyid") else "")
    )


def _change(name: str, place: int, share: float | None) -> Plant:
    def plant(loaded: Any) -> None:
        model: Any = getattr(loaded, "_model", None) or loaded.model
        owner, _, key = name.rpartition(".")
        there = model.opt if owner else model
        values = np.array(getattr(there, key))
        flat = values.reshape(-1)
        if share is not None:
            flat[place] += share * (flat[place] or 1.0)
        elif name.endswith("dim"):
            flat[place] = 1 if flat[place] > 1 else 3
        else:
            flat[place] = 1 - min(flat[place], 1)
        setattr(there, key, values if values.ndim else values.item())

    return plant


def run_with(task: TreeTask, plant: Plant | None, steps: KeptSteps) -> tuple[Outcome, bool]:
    """Run a case whose engine changes each model after loading it; True if it compares steps."""
    with planting(task.engine, plant):
        case = run_case(task.with_target(steps=steps))
    return case.outcome, case.whole_step is not None and case.whole_step.outcome is not None


class PlantedRobot:
    """A file that agrees, with its steps and the coverage of each number."""

    def __init__(
        self, file: Path, rng: np.random.Generator, engine: str, each: int, *, floating: bool
    ) -> None:
        self.engine, self._spec = spec_of(file, engine, floating=floating)
        prepared = prepare_tree(file, states=8, floating=floating)
        self.task = model_task(prepared, self.engine).with_settings(**self._spec.settings)
        self._kept = KeptSteps()
        outcome, self._compares = run_with(self.task, None, self._kept)
        self.agrees = outcome is Outcome.AGREES
        self.faults = list[LoadedFault]()
        if not self.agrees:
            return
        self._file = file
        model = self._load(None)
        self.states = [] if model is None else list(self._drawn(model, rng))
        self.steps = list(self._evaluated(None))
        if self.engine in SETTERS:
            self.faults += setter_faults(self.engine, self._spec, rng, each)
        else:
            self.faults += array_faults(model._model, StatedLaws(file), rng, each)
        numbers = robot_numbers(file, self.task.spec.settings)
        counted = counted_numbers(self.task, numbers)
        tested = (*SMOOTH, NumberEffect.SHAPES)
        self.numbers = [
            (number, one.bound or one.effect in tested)
            for one, number in zip(counted, numbers.numerals, strict=True)
        ]

    def _load(self, plant: Plant | None) -> Any:
        with planting(self.engine, plant):
            return engines()[self.engine].load_whole(self._spec)

    def _drawn(self, model: Any, rng: np.random.Generator) -> Iterator[WholeState]:
        again = KeptSteps()
        with patch.object(law_states, "SEED", SEED):
            check_whole_step(self._file, self._spec, self.engine, 1e-9, again)
        for steps in (self._kept, again):
            yield from (sample.state for sample in steps.kept(self.engine)[1])
        start = next(iter(model.starts))
        for k in range(STATES):
            moved = model.moved(start, int(rng.integers(1, 300))) if k % 2 else start
            sizes = (0.3 * rng.normal(size=len(one)) for one in (moved.z, moved.m))
            z, m = (one + more for one, more in zip((moved.z, moved.m), sizes, strict=True))
            controls = rng.uniform(-2, 2, len(moved.controls)) + 0 * moved.controls
            yield moved._replace(z=z if k % 4 > 1 else moved.z, m=m, controls=controls)

    def _evaluated(self, plant: Plant | None, every: int = 1) -> Iterator[EngineStep]:
        with planting(self.engine, plant):
            model = engines()[self.engine].load_whole(self._spec)
            if model is not None:
                yield from map(model.evaluate, self.states[::every])

    def acting(self, faults: Sequence[LoadedFault]) -> list[LoadedFault]:
        """Return the faults that change a step from a state; those without effect by groups."""
        quick = [fault for fault in faults if self._acts([fault], SELDOM)]
        rest = [fault for fault in faults if fault not in quick]
        acting = quick + self._halves(rest)
        return [fault for fault in faults if fault in acting]

    def _halves(self, faults: Sequence[LoadedFault]) -> list[LoadedFault]:
        if not faults or not self._acts(faults):
            return []
        half = (len(faults) + 1) // 2
        if half == len(faults):
            return list(faults)
        return [*self._halves(faults[:half]), *self._halves(faults[half:])]

    def _acts(self, faults: Sequence[LoadedFault], every: int = 1) -> bool:
        def plant(model: Any) -> None:
            for fault in faults:
                fault.plant(model)

        if not self.steps:
            return True
        try:
            changed = self._evaluated(plant, every)
            return any(map(_apart, changed, self.steps[::every]))
        except (FileError, BlownUpError):
            return True

    def _steps_differ(self, plant: Plant) -> bool:
        """Return whether steps differ at the states of the run without a fault, which is quick."""
        comparison, kept = self._kept.kept(self.engine)
        try:
            model = self._load(plant)
            if comparison is None or model is None:
                return False
            again = comparison.of_engine(model)
            evaluated = again.evaluate([sample.state for sample in kept])
            judged = again.judge(again.compare(evaluated), self.task.resolution)
        except (FileError, BlownUpError):
            return False
        return judged.outcome is Outcome.DIFFERS

    def verdict(self, fault: LoadedFault) -> str:
        """Return what a fault that acts leads to."""
        try:
            if self._steps_differ(fault.plant):
                return "detected"
            outcome, compares = run_with(self.task, fault.plant, KeptSteps())
            if outcome is not Outcome.AGREES:
                return "detected"
            if self._compares and not compares:
                return "listed"  # the run states that it compares no whole steps, and why
        except (FileError, BlownUpError):
            return "detected"
        tested = fault.stated(self.numbers)
        return "wrongly green" if any(tested) else "listed" if tested else "not stated"


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


KINDS = "detected", "listed", "not stated", "no effect", "wrongly green"


def plant_in(
    paths: Sequence[Path],
    seed: int,
    only: str = "",
    engine: str = "",
    each: int = 1,
    *,
    floating: bool = False,
) -> dict[str, Counter[str]]:
    """Plant faults in robots; return the counts of verdicts by array, and print wrong ones."""
    table: dict[str, Counter[str]] = {}
    for path in paths:
        robot = PlantedRobot(path, np.random.default_rng(seed), engine, each, floating=floating)
        if not robot.agrees:
            print(f"{path.name}: skipped, since it does not agree", flush=True)
        faults = [fault for fault in robot.faults if re.fullmatch(only or ".*", fault.name)]
        acting = robot.acting(faults)
        for fault in faults:
            verdict = robot.verdict(fault) if fault in acting else "no effect"
            table.setdefault(fault.name, Counter())[verdict] += 1
            if verdict not in ("detected", "no effect"):
                what = f"{fault.name} {fault.owner}[{fault.word}]"
                print(f"{path.parent.name}/{path.name}: {what} is {verdict}", flush=True)
    return table


def main() -> None:
    """Plant faults and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("paths", nargs="+", type=Path)
    parser.add_argument("--engine", default="", help="engine, such as drake or dart")
    parser.add_argument("--floating", action="store_true", help="free the root link of URDFs")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--each", type=int, default=1, help="entries of each array [1]")
    parser.add_argument("--only", default="", help="pattern of names of arrays")
    options = parser.parse_args()
    settings = options.only, options.engine, options.each
    table = plant_in(options.paths, options.seed, *settings, floating=options.floating)
    print(f"{'array':28} {'planted':>8}" + "".join(f"{kind:>14}" for kind in KINDS))
    for name, count in sorted(table.items()):
        cells = "".join(f"{count[kind]:14}" for kind in KINDS)
        print(f"{name:28} {count.total():8}{cells}")
    whole = sum(table.values(), Counter[str]())
    print(dict(whole))
    sys.exit(bool(whole["wrongly green"]))


if __name__ == "__main__":
    main()
