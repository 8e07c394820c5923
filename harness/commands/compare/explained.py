"""Effect of file differences on motions, by the equations of both files' trees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from physics_crosscheck.harness.commands.compare.equations import FileEquations
from physics_crosscheck.harness.commands.compare.judge import Recorded
from physics_crosscheck.harness.commands.compare.match import Match
from physics_crosscheck.harness.commands.compare.property import Difference
from physics_crosscheck.harness.commands.compare.segments import Ends, own_forces, reversed_segments
from physics_crosscheck.harness.commands.compare.side import ModelSide
from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.harness.numerics.ladder import movement
from physics_crosscheck.harness.records.base import number
from physics_crosscheck.harness.records.comparison import ComparedProperty
from physics_crosscheck.reference.solving.segments import Segments, even_indices

SOLVED_RUNS = 24
"""Runs over which the equations are solved."""


@dataclass(frozen=True, kw_only=True)
class Explained:
    """Comparison of the engines with the equations of both files.

    Attributes:
        share: of the discrepancy that the equations reproduce; 1 is all of it.
        off: deviation of the source's engine from the equations of its file, and of the target's,
            relative to how far components move.
    """

    share: float
    off: tuple[float, float]


def explained(
    sides: tuple[ModelSide, ModelSide],
    match: Match,
    recorded: Recorded,
    followed: Ends,
    signs: Array,
) -> Explained | None:
    """Solve both files' equations over the runs.

    Args:
        sides: source and target.
        match: of the coordinates.
        recorded: runs of the source.
        followed: the target's end states, with joints reversed by `signs`, (m,).

    Return None if that is impossible, with forces that depend on the state, or moving
    actuator states.
    """
    source, other = sides
    if not match.constant:
        return None
    if source.facts.states_move or other.facts.states_move:
        return None
    finite, reached = _reached(followed)
    if not len(finite):
        return None
    some = finite[even_indices(len(finite), SOLVED_RUNS)]
    compared, both = recorded.compared.pick(some), np.concatenate([signs, signs])
    with np.errstate(all="ignore"):
        source_ends = source.equations.ends(own_forces(recorded.runs.pick(some), match))
        target_ends = other.equations.ends(reversed_segments(compared, signs)) * both
    source_ends = match.convert(source_ends)
    if not (np.isfinite(source_ends).all() and np.isfinite(target_ends).all()):
        return None
    ends, seen, scale = compared.end, reached[some], compared.unit
    discrepancy = (seen - ends) / scale
    remaining = discrepancy - (target_ends - source_ends) / scale
    return Explained(
        share=1 - _size(remaining) / _size(discrepancy) if _size(discrepancy) else 0.0,
        off=(
            float(np.max(np.abs(source_ends - ends) / scale)),
            float(np.max(np.abs(target_ends - seen) / scale)),
        ),
    )


def weighed(
    differences: Sequence[Difference], a: ModelSide, runs: Segments | None
) -> tuple[ComparedProperty, ...]:
    """Return differences with their effects on A's motions, the largest first.

    The effect of a difference is the change of the ends of runs if A's tree takes B's value.

    Args:
        differences: of the files.
        a: contents of A.
        runs: of A, with forces on its own coordinates; None if these are unknown.
    """
    effects: list[float | None] = [None] * len(differences)
    if runs is not None:
        part = runs.pick(even_indices(len(runs.start), SOLVED_RUNS))
        with np.errstate(all="ignore"):
            ends = a.equations.ends(part)
            scale = movement(ends, part.start)
            for i, (_, tree) in enumerate(differences):
                if tree is not None:
                    changed = FileEquations(tree, a.facts.coordinates).ends(part)
                    effects[i] = float(np.max(np.abs(changed - ends) / scale))
    rows = [
        structs.replace(row, effect=number(effect))
        for (row, _), effect in zip(differences, effects, strict=True)
    ]
    return tuple(sorted(rows, key=_least_effect_last))


def _least_effect_last(row: ComparedProperty) -> tuple[bool, bool, float]:
    """Return a key; actuators and tendons, whose effects are unknown, follow bodies and joints."""
    size = row.relative if row.effect is None else row.effect
    # Round to six digits, so that last digits do not change the order of like legs.
    rounded = float(f"{1.0 if size is None else size:.5e}")
    return not row.moves, row.kind in ("tendon", "actuator", "actuators"), -rounded


def _reached(followed: Ends) -> tuple[NDArray[np.intp], Array]:
    """Return which runs have known end states, and all end states, (K, 2m).

    Where few runs have a limit, as under holding motors, use the end states of the finest rung.
    """
    if followed.mostly_limited:
        finite = np.isfinite(followed.uncertainty).all(axis=1)
        return np.flatnonzero(finite), followed.value
    return np.flatnonzero(np.isfinite(followed.finest).all(axis=1)), followed.finest


def _size(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0
