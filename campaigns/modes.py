"""Each fault judged twice, with single steps allowed to decide and with `--thorough`.

`python -m campaigns.modes --mechanisms 2000`: random mechanisms with faults of 1e-6, 1e-8 and 1e-9.
`python -m campaigns.modes FOLDER robot.urdf`: each fault that `mutate` plants in folders, and each
number of robot files off by 1e-6, 1e-8 and 1 %. Exit code 1 if a fault that the thorough mode
detects is missed without it. A line of JSON for each fault goes to --out.
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
from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.prepare import PreparedSystem, prepare, prepare_tree
from physics_crosscheck.harness.checks.task import ModelTask, TreeTask, model_task
from physics_crosscheck.harness.commands.mutation.survey import survey
from physics_crosscheck.harness.diagnosis.trial import scratch
from physics_crosscheck.harness.engines.registry import engines_to_run
from physics_crosscheck.harness.jobs.workers import Failure, Limits, Workers
from physics_crosscheck.harness.modelfiles.copies import copy_with_texts
from physics_crosscheck.harness.modelfiles.model_files import (
    UnreadModel,
    chosen_engines,
    model_files,
)
from physics_crosscheck.harness.modelfiles.numbers import SMALL
from physics_crosscheck.harness.modelfiles.readers import Numbers, robot_numbers
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.records.case import Case

SIZES = (1e-6, 1e-8, 1e-9)
ROBOT_SIZES = (1e-6, 1e-8, 1e-2)


@dataclass(frozen=True, kw_only=True)
class Both:
    """One fault in both modes.

    Attributes:
        name: case and fault.
        size: relative size of a wrong number; 0 for a sound model, nan for a typical mistake.
        outcome, thorough: in both modes.
        decided_by: the deciding check without `--thorough`.
        discrepancy: largest E by segments.
        by_steps: largest E without `--thorough`.
        seconds: processor time in both modes.
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
        """Whether only the thorough mode detects it."""
        return self.outcome == "AGREES" != self.thorough

    @property
    def differs(self) -> bool:
        """Whether the modes disagree."""
        return self.outcome != self.thorough


def both(name: str, size: float, task: ModelTask[Any]) -> Both:
    """Judge a model in both modes."""
    cases = [_case(replace(task, thorough=thorough)) for thorough in (False, True)]
    found, whole = cases
    verdict = found.verdict if isinstance(found, Case) else None
    return Both(
        name=name,
        size=size,
        outcome=_outcome(found),
        thorough=_outcome(whole),
        decided_by="" if verdict is None else verdict.decided_by,
        discrepancy=_size(whole),
        by_steps=_size(found),
        seconds=(_seconds(found), _seconds(whole)),
    )


def _case(task: ModelTask[Any]) -> Case | str:
    try:
        return run_case(task)
    except (RuntimeError, ValueError) as error:
        return type(error).__name__


def _outcome(case: Case | str) -> str:
    return case if isinstance(case, str) else str(case.outcome)


def _seconds(case: Case | str) -> float:
    return 0.0 if isinstance(case, str) else case.seconds


def _size(case: Case | str) -> float:
    verdict = case.verdict if isinstance(case, Case) else None
    return float("nan") if verdict is None else verdict.largest_discrepancy or 0.0


def mechanism(seed: int, faults: int, index: int) -> list[Both]:
    """Judge a random mechanism, sound and with faults, against the equations of the sound file."""
    drawn, rng = draw(seed, index), np.random.default_rng((seed, index, 2))
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as other:
        given = sidecar(drawn, Path(folder), {})
        settings = {k: v for k, v in given.settings.items() if k != "gravity"}
        task = model_task(prepare_tree(given.model), drawn.engine).with_settings(**settings)
        name = f"mechanism {index} {drawn.group}"
        found = [both(name, 0.0, task)]
        for turn, where in enumerate(rng.permutation(np.array(literals(drawn), dtype=object))):
            if turn == faults:
                break
            size = SIZES[turn % len(SIZES)]
            wrong = sidecar(with_fault(drawn, tuple(where), size), Path(other), {})
            found.append(both(f"{name} {where}", size, task.with_file(wrong.model)))
        return found


@lru_cache(maxsize=1)
def _robot(file: Path, engine: str, floating: bool) -> tuple[TreeTask, Numbers]:
    task = model_task(prepare_tree(file, floating=floating), engine)
    return task, robot_numbers(file, task.spec.settings)


def robot(file: Path, engine: str, floating: bool, place: int | None) -> list[Both]:
    """Judge a robot file, sound, or with one of its relevant numbers wrong by each size."""
    task, numbers = _robot(file, engine, floating)
    if place is None:
        return [both(f"{file.name} [{engine}]", 0.0, task)]
    index, found = numbers.relevant_numbers[place], []
    one = numbers.numerals[index]
    for size in ROBOT_SIZES:
        value = one.value + size * (abs(one.value) if abs(one.value) > SMALL else one.scale)
        found.append(_changed(task, numbers.texts({index: value}), one.address, size))
    return found


def _changed(task: TreeTask, texts: Any, address: str, size: float) -> Both:
    with scratch() as folder:
        wrong = task.with_file(copy_with_texts(task.file, texts, folder))
        return both(f"{task.file.name} [{task.engine}] {address}", size, wrong)


@lru_cache(maxsize=1)
def _prepared(folder: Path) -> PreparedSystem:
    prepared = prepare(folder, described=False)
    assert isinstance(prepared, PreparedSystem)
    return prepared


def model(folder: Path, given: Sidecar, engine: str, sample: int) -> list[Both]:
    """Judge a model of a folder, sound, and with faults that `mutate` plants, in each scenario.

    These are at most `sample` faults, evenly spread over all and over the scenarios.
    """
    prepared, found = _prepared(folder), []
    faults = survey(model_task(prepared, engine, given)).faults
    every = [(name, fault) for fault in faults for name in prepared.motions]
    places = np.linspace(0, len(every) - 1, min(sample, len(every))).astype(int)
    for scenario in prepared.motions:
        task = model_task(prepared, engine, given, scenario=scenario)
        found.append(both(str(task.id), 0.0, task))
        for name, fault in (every[place] for place in places):
            if name == scenario:
                with scratch() as copies:
                    wrong = task.with_sidecar(fault.edit.apply(given, engine, copies))
                    title = f"{task.id} {fault.name} {fault.location}"
                    found.append(both(title, float("nan"), wrong))
    return found


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
                    yield partial(_call, robot, *which), place
            continue
        for given in model_files(target):
            if not isinstance(given, UnreadModel):
                for name in chosen_engines(given, ()):
                    yield partial(_call, model, target, given, name), chosen.sample


def _call(function: Any, *arguments: Any) -> list[Both]:
    found: list[Both] = function(*arguments)
    return found


def _run(chosen: argparse.Namespace) -> Iterator[Both]:
    with Workers(chosen.jobs, Limits(seconds=3600)) as workers:
        tasks = [workers.submit(*job) for job in _jobs(chosen)]
        for task in tasks:
            found = workers.outcome(task)
            if isinstance(found, Failure):
                print(f"lost: {found.reason[:200]}", file=sys.stderr, flush=True)
            else:
                yield from found


def summary(rows: Sequence[Both]) -> Iterator[str]:
    """Yield the counts of outcomes in both modes, and the largest E that single steps pass."""
    for size in [*sorted({row.size for row in rows if row.size == row.size}), float("nan")]:
        same = [row for row in rows if row.size == size or (row.size != row.size and size != size)]
        counts = Counter((row.outcome, row.thorough) for row in same)
        for (outcome, thorough), count in counts.most_common():
            yield f"{size:g}: {count} {outcome}, thorough {thorough}"
    by_steps = [row for row in rows if row.decided_by == "single steps"]
    largest = max((row.discrepancy for row in by_steps), default=0.0)
    yield (
        f"{len(by_steps)} of {len(rows)} decided by single steps;"
        f" the largest E of these by segments: {largest:.1e}"
    )
    spent = [sum(row.seconds[i] for row in rows) for i in (0, 1)]
    yield f"seconds: {spent[0]:.0f}, thorough {spent[1]:.0f}"


def main(given: Iterable[str] | None = None) -> int:
    """Run, and print what differs."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.modes", description=__doc__)
    parser.add_argument("targets", nargs="*", type=Path)
    parser.add_argument("--mechanisms", type=int, default=0)
    parser.add_argument("--faults", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--sample", type=int, default=10**9, help="most numbers of a file, or faults of a model"
    )
    parser.add_argument("--floating", action="store_true", help="the root link of a URDF is free")
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
