"""Numbers of a robot's file, counted by whether its motions depend on them."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from harness.cases.robot_task import RobotTask
from harness.diagnosis.robot_task import problem_of
from harness.engines.registry import engines
from harness.records.coverage import Coverage, Unseen
from harness.robots.numerals import Numeral
from harness.robots.read import robot_numbers

SHOWN = 3
"""Numbers that are named as examples of a reason that is known."""

SHARE = 1e-3
"""Of its size by which a number is thought to be changed, as in a folder."""

NO_SAY = "no motion depends on them"


def count_robot(task: RobotTask) -> Coverage:
    """Count the numbers of a file whose change moves the ends of segments beyond the resolution.

    By the equations, at the states of a diagnosis: no engine is run.

    Raises:
        RobotError, ReferenceError: naming the file.
    """
    numbers = robot_numbers(task.file, task.settings)
    problem = problem_of(task, numbers, own=False)
    moved = np.max(np.abs(problem.slopes({})), axis=1, initial=0.0)
    sizes = [one.size for one in problem.hypotheses]
    felt = moved * SHARE * np.array(sizes) > task.resolution
    seen = {i for i, one in zip(numbers.saying, felt, strict=True) if one}
    idle = engines()[task.engine].idle
    unseen: dict[str, list[Numeral]] = {}
    for i, numeral in enumerate(numbers.numerals):
        if i not in seen:
            unseen.setdefault(_reason(numeral, idle), []).append(numeral)
    return Coverage(
        numbers=len(numbers.numerals),
        motion=len(seen),
        unseen=tuple(
            Unseen(reason=why, count=len(them), examples=_examples(why, them))
            for why, them in sorted(unseen.items(), key=lambda item: -len(item[1]))
        ),
    )


def _reason(one: Numeral, idle: Mapping[str, str]) -> str:
    return next((why for kind, why in idle.items() if re.fullmatch(kind, one.path)), NO_SAY)


def _examples(why: str, them: list[Numeral]) -> tuple[str, ...]:
    """What some are called; all of those of which it could not be said beforehand."""
    if why == NO_SAY:
        return tuple(one.address for one in them)
    return tuple(dict.fromkeys(one.path.rpartition("/")[2] for one in them))[:SHOWN]
