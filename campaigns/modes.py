"""Verdicts on planted faults in two modes: with `--thorough`, and where single steps may decide.

`python -m campaigns.modes --mechanisms 2000` judges random mechanisms with faults of 1e-6, 1e-8 and
1e-9. `python -m campaigns.modes FOLDER robot.urdf` judges each fault that `mutate` plants in
folders, and each number of robot files changed by 1e-6, 1e-8 and 1 %. The exit code is 1 if only
the thorough mode detects a fault. `--out` receives a line of JSON for each fault.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from campaigns.mechanisms.drawn import draw
from campaigns.mechanisms.mechanism import literals, with_fault
from campaigns.mechanisms.written import sidecar
from campaigns.planted.fates import wrong_value
from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.prepare import PreparedSystem, prepare, prepare_tree
from physics_crosscheck.harness.checks.task import ModelTask, TreeTask, model_task
from physics_crosscheck.harness.commands.mutation.survey import system_faults
from physics_crosscheck.harness.diagnosis.trial import scratch
from physics_crosscheck.harness.engines.registry import engines_to_run
from physics_crosscheck.harness.jobs.workers import Failure, Limits, Workers
from physics_crosscheck.harness.modelfiles.model_files import (
    UnreadModel,
    chosen_engines,
    model_files,
)
from physics_crosscheck.harness.modelfiles.numbers import ModelFile, copy_with_texts
from physics_crosscheck.harness.modelfiles.readers import robot_numbers
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar

SIZES = (1e-6, 1e-8, 1e-9)
ROBOT_SIZES = (1e-6, 1e-8, 1e-2)


@dataclass(frozen=True, kw_only=True)
class ModeComparison:
    """A fault judged in both modes.

    Attributes:
        name: case and fault.
        size: relative error of a wrong number; 0 for a correct model, nan for a typical mistake.
        outcome, thorough: outcomes without and with `--thorough`.
        decided_by: the deciding check without `--thorough`.
        discrepancy: largest E with `--thorough`, by segments.
        by_steps: largest E without `--thorough`.
        seconds: processor time without and with `--thorough`.
    """

    name: str
    size: float
    outcome: str
    thorough: str
    decided_by: str
    discrepancy: float
    by_steps: float
    seconds: tuple[float, float]

    @property
    def missed(self) -> bool:
        """True if only the thorough mode detects the fault."""
        return self.outcome == "AGREES" != self.thorough

    @property
    def differs(self) -> bool:
        """True if the modes disagree."""
        return self.outcome != self.thorough


def compare_modes(name: str, size: float, task: ModelTask[Any]) -> ModeComparison:
    """Judge a model in both modes."""
    outcome, by_steps, seconds, decided_by = _judged(replace(task, thorough=False))
    thorough, discrepancy, more_seconds, _ = _judged(replace(task, thorough=True))
    return ModeComparison(
        name=name,
        size=size,
        outcome=outcome,
        thorough=thorough,
        decided_by=decided_by,
        discrepancy=discrepancy,
        by_steps=by_steps,
        seconds=(seconds, more_seconds),
    )


def _judged(task: ModelTask[Any]) -> tuple[str, float, float, str]:
    """Return the outcome, the largest E, processor time, and the deciding check."""
    try:
        case = run_case(task)
    except (RuntimeError, ValueError) as error:
        return type(error).__name__, float("nan"), 0.0, ""
    outcome, verdict = str(case.outcome), case.verdict
    if verdict is None:
        return outcome, float("nan"), case.seconds, ""
    return outcome, verdict.largest_discrepancy or 0.0, case.seconds, verdict.decided_by


def mechanism(seed: int, faults: int, index: int) -> list[ModeComparison]:
    """Judge a random mechanism, correct and with faults, by the equations of the correct file."""
    drawn, rng = draw(seed, index), np.random.default_rng((seed, index, 2))
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as other:
        given = sidecar(drawn, Path(folder), {})
        settings = {k: v for k, v in given.settings.items() if k != "gravity"}
        task = model_task(prepare_tree(given.model), drawn.engine).with_settings(**settings)
        name = f"mechanism {index} {drawn.group}"
        results = [compare_modes(name, 0.0, task)]
        for turn, where in enumerate(rng.permutation(np.array(literals(drawn), dtype=object))):
            if turn == faults:
                break
            size = SIZES[turn % len(SIZES)]
            wrong = sidecar(with_fault(drawn, tuple(where), size), Path(other), {})
            results.append(compare_modes(f"{name} {where}", size, task.with_file(wrong.model)))
        return results


@lru_cache(maxsize=1)
def _robot(file: Path, engine: str, floating: bool) -> tuple[TreeTask, ModelFile]:
    task = model_task(prepare_tree(file, floating=floating), engine)
    return task, robot_numbers(file, task.spec.settings)


def robot(file: Path, engine: str, floating: bool, place: int | None) -> list[ModeComparison]:
    """Judge a robot file: with the relevant number at `place` wrong, or unchanged for None."""
    task, numbers = _robot(file, engine, floating)
    if place is None:
        return [compare_modes(f"{file.name} [{engine}]", 0.0, task)]
    index, results = numbers.relevant_numbers[place], []
    number = numbers.numerals[index]
    for size in ROBOT_SIZES:
        texts = numbers.texts({index: wrong_value(number, size)})
        with scratch() as folder:
            wrong = task.with_file(copy_with_texts(task.file, texts, folder))
            title = f"{file.name} [{engine}] {number.address}"
            results.append(compare_modes(title, size, wrong))
    return results


@lru_cache(maxsize=1)
def _prepared(folder: Path) -> PreparedSystem:
    prepared = prepare(folder, described=False)
    assert isinstance(prepared, PreparedSystem)
    return prepared


def model(folder: Path, given: Sidecar, engine: str, sample: int) -> list[ModeComparison]:
    """Judge a model of a folder in each scenario, unchanged and with faults that `mutate` plants.

    At most `sample` pairs of a fault and a scenario are taken, evenly spread.
    """
    prepared, results = _prepared(folder), []
    faults = [one.mistake for one in system_faults(model_task(prepared, engine, given))]
    every = [(name, fault) for fault in faults for name in prepared.motions]
    places = np.linspace(0, len(every) - 1, min(sample, len(every))).astype(int)
    for scenario in prepared.motions:
        task = model_task(prepared, engine, given, scenario=scenario)
        results.append(compare_modes(str(task.id), 0.0, task))
        for name, fault in (every[place] for place in places):
            if name == scenario:
                with scratch() as copies:
                    wrong = fault.edit.plant(task, copies)
                    title = f"{task.id} {fault.name} {fault.location}"
                    results.append(compare_modes(title, float("nan"), wrong))
    return results


def _jobs(chosen: argparse.Namespace) -> Iterator[Any]:
    for index in range(chosen.mechanisms):
        yield partial(mechanism, chosen.seed, chosen.faults), index
    for target in chosen.targets:
        if target.is_file():
            for engine in engines_to_run(target.suffix):
                which = target, engine.name, chosen.floating
                count = len(_robot(*which)[1].relevant_numbers)
                places = np.linspace(0, count - 1, min(chosen.sample, count)).astype(int)
                for place in (None, *places.tolist()):
                    yield partial(robot, *which), place
            continue
        for given in model_files(target):
            if not isinstance(given, UnreadModel):
                for name in chosen_engines(given, ()):
                    yield partial(model, target, given, name), chosen.sample


def _run(chosen: argparse.Namespace) -> Iterator[ModeComparison]:
    with Workers(chosen.jobs, Limits(seconds=3600)) as workers:
        tasks = [workers.submit(*job) for job in _jobs(chosen)]
        for task in tasks:
            results = workers.outcome(task)
            if isinstance(results, Failure):
                print(f"failed: {results.reason[:200]}", file=sys.stderr, flush=True)
            else:
                yield from results


def summary(rows: Sequence[ModeComparison]) -> Iterator[str]:
    """Yield the counts of outcomes in both modes, and the largest E that single steps accept."""
    for size in [*sorted({row.size for row in rows if row.size == row.size}), float("nan")]:
        same = [row for row in rows if row.size == size or (row.size != row.size and size != size)]
        counts = Counter((row.outcome, row.thorough) for row in same)
        for (outcome, thorough), count in counts.most_common():
            yield f"{size:g}: {count} {outcome}, thorough {thorough}"
    by_steps = [row for row in rows if row.decided_by == "single steps"]
    largest = max((row.discrepancy for row in by_steps), default=0.0)
    yield (
        f"{len(by_steps)} of {len(rows)} decided by single steps;"
        f" largest E by segments: {largest:.1e}"
    )
    spent = [sum(row.seconds[i] for row in rows) for i in (0, 1)]
    yield f"seconds: {spent[0]:.0f}, thorough {spent[1]:.0f}"


def main(given: Iterable[str] | None = None) -> int:
    """Print the faults on which the modes disagree, and the counts; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.modes", description=__doc__)
    parser.add_argument("targets", nargs="*", type=Path)
    parser.add_argument("--mechanisms", type=int, default=0, help="random mechanisms [0]")
    parser.add_argument("--faults", type=int, default=3, help="faults per mechanism [3]")
    parser.add_argument("--seed", type=int, default=1)
    sample = "largest count of numbers per file or faults per model"
    parser.add_argument("--sample", type=int, default=10**9, help=sample)
    parser.add_argument("--floating", action="store_true", help="free the root link of URDFs")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, required=True)
    chosen = parser.parse_args(None if given is None else list(given))
    rows = []
    with chosen.out.open("w") as file:
        for row in _run(chosen):
            rows.append(row)
            print(json.dumps(asdict(row)), file=file, flush=True)
            if row.differs:
                print(row, flush=True)
    print("\n".join(summary(rows)))
    return int(any(row.missed for row in rows))


if __name__ == "__main__":
    sys.exit(main())
