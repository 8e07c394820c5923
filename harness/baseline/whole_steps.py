"""Whole steps of a robot file for the baseline: with limits, friction, contacts and drives.

The engine steps from the accepted states again. So a change shows even if the law of the present
file agrees with the engine.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from physics_crosscheck.harness.checks.law_comparison import Evaluated, WholeStepComparison
from physics_crosscheck.harness.checks.prepare import Prepared, PreparedTree
from physics_crosscheck.harness.checks.task import ModelTask
from physics_crosscheck.harness.checks.whole_step import case_whole_step
from physics_crosscheck.harness.engines.protocol import LoadedModel, WholeState
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.records.base import numbers, rows
from physics_crosscheck.harness.records.baseline import LawNumber, StepEnds, WholeSteps

Comparison = WholeStepComparison[Any, Any]


def measure_steps(
    task: ModelTask[Prepared],
    loaded: tuple[LoadedModel, CoordinateMap],
    accepted: WholeSteps | None,
) -> tuple[WholeSteps | None, StepEnds | None]:
    """Return the steps from drawn states, and the engine's present steps from accepted ones.

    Return None for both if the engine has no law for the file; also for the second one if the file
    has other coordinates, controls or states of drives.
    """
    target = task.target
    if not isinstance(target, PreparedTree) or case_whole_step(task, *loaded) is None:
        return None, None
    comparison, evaluated = target.steps.kept(task.engine)
    if comparison is None or not evaluated:
        return None, None
    ends = _ends(comparison, evaluated)
    steps = WholeSteps(
        coordinates=comparison.model.coordinates,
        components=comparison.components,
        controls=comparison.model.controls,
        states=rows(np.concatenate(sample.state).tolist() for sample in evaluated),
        scale=numbers(comparison.compare(evaluated).scale.tolist()),
        ends=ends,
        laws=dict(_leaves(comparison.laws.laws, "")),
    )
    if accepted is None or not _is_comparable(steps, accepted):
        return steps, None
    again = [comparison.evaluate([state]) for state in _states(accepted)]
    nothing = (None,) * len(comparison.components)
    present = [_ends(comparison, samples) for samples in again]
    return steps, StepEnds(
        values=tuple(one.values[0] if one.values else nothing for one in present),
        uncertainty=tuple(one.uncertainty[0] if one.uncertainty else nothing for one in present),
    )


def _ends(comparison: Comparison, evaluated: Sequence[Evaluated[Any]]) -> StepEnds:
    return StepEnds(
        values=rows(comparison.answer(sample).tolist() for sample in evaluated),
        uncertainty=rows(comparison.uncertainty(sample).tolist() for sample in evaluated),
    )


def _is_comparable(steps: WholeSteps, accepted: WholeSteps) -> bool:
    shapes = [
        (one.coordinates, one.components, one.controls, len(one.states[0]))
        for one in (steps, accepted)
    ]
    return shapes[0] == shapes[1]


def _states(accepted: WholeSteps) -> Iterator[WholeState]:
    n = len(accepted.coordinates)
    for row in np.array(accepted.states, dtype=float):  # None, for a control that is off, is nan
        yield WholeState(*np.split(row, (n, 2 * n, 2 * n + accepted.controls)))


def _leaves(value: object, name: str) -> Iterator[tuple[str, LawNumber]]:
    """Yield the numbers and words of laws, each with its name, such as `limits[0].upper`."""
    if is_dataclass(value) and not isinstance(value, type):
        dot = "." if name else ""
        parts = ((f"{name}{dot}{one.name}", getattr(value, one.name)) for one in fields(value))
    elif isinstance(value, Mapping):
        parts = ((f"{name}[{key}]", each) for key, each in sorted(value.items()))
    elif isinstance(value, frozenset):
        parts = ((name, " ".join(map(str, sorted(value)))) for _ in range(1))
    elif isinstance(value, list | tuple):
        parts = ((f"{name}[{i}]", each) for i, each in enumerate(value))
    else:
        if isinstance(value, np.generic):
            value = value.item()
        if isinstance(value, bool | int | str):
            yield name, value
        elif isinstance(value, float):
            yield name, value if np.isfinite(value) else str(value)
        return
    for inner, each in parts:
        yield from _leaves(each, inner)
