"""How much of a discrepancy follows from what the files say: by the equations of their trees."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.compare.excitation import Recorded
from physics_crosscheck.harness.compare.judge import Followed
from physics_crosscheck.harness.compare.match import Match
from physics_crosscheck.harness.compare.runs import Runs
from physics_crosscheck.harness.compare.side import Side
from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.harness.numerics.batch import even_indices
from physics_crosscheck.reference.dynamics.chart_equations import Charted
from physics_crosscheck.reference.mechanism.rotations import DOUBLES
from physics_crosscheck.reference.solving.collocation import ReferenceError, collocate

SOME = 24
"""Runs over which equations are solved."""

PIECES = (1, 8, 64)
"""Into so many a run is divided, until its equations can be solved."""


@dataclass(frozen=True, kw_only=True)
class Explained:
    """What the equations of both files make of the runs.

    Attributes:
        share: of the discrepancy that they make too; 1 is all of it.
        off: by how much the source's engine leaves the equations of its file, and the target's,
            relative to how far components move.
    """

    share: float
    off: tuple[float, float]


def explained(
    sides: tuple[Side, Side],
    match: Match,
    recorded: Recorded,
    target: Runs,
    followed: Followed,
    signs: Array,
) -> Explained | None:
    """Solve both files' equations over the runs.

    Args:
        sides: source and target.
        match: of the coordinates.
        recorded: runs of the source.
        target: the same in the coordinates of the comparison.
        followed: where the target ends them, with joints turned by `signs`, (m,).

    Returns None where they can't be had: forces that depend on the state, springs of a sidecar,
    joints that follow others, actuators whose states move.
    """
    source, other = sides
    if not match.constant or source.springs or other.springs:
        return None
    if source.tree.couplings or other.tree.couplings:
        return None
    if source.facts.states_move or other.facts.states_move:
        return None
    known, reached = _reached(followed)
    if not len(known):
        return None
    some = known[even_indices(len(known), SOME)]
    own, target = _of(recorded.runs, some), _of(target, some)
    ends = recorded.end[some]
    slopes = match.slopes(own.z[:1])[0]
    both = np.concatenate([signs, signs])
    with np.errstate(all="ignore"):
        one = _ends(source, own, own.push @ slopes)
        turned = Runs(
            length=target.length, z=target.z * signs, w=target.w * signs, push=target.push * signs
        )
        two = _ends(other, turned, turned.push) * both
    n = own.z.shape[1]
    one = np.hstack(match.over(one[:, :n], one[:, n:]))
    if not (np.isfinite(one).all() and np.isfinite(two).all()):
        return None
    seen, scale = reached[some], recorded.scale
    discrepancy = (seen - ends) / scale
    left = discrepancy - (two - one) / scale
    return Explained(
        share=1 - _size(left) / _size(discrepancy) if _size(discrepancy) else 0.0,
        off=(
            float(np.max(np.abs(one - ends) / scale)),
            float(np.max(np.abs(two - seen) / scale)),
        ),
    )


def _reached(followed: Followed) -> tuple[NDArray[np.intp], Array]:
    """Return which runs end somewhere known, and where all end, (K, 2m).

    Where hardly a run has a limit, as under motors that hold, ends are those in the most steps.
    """
    if followed.mostly_known:
        known = np.isfinite(followed.limit.uncertainty).all(axis=1)
        return np.flatnonzero(known), followed.limit.value
    return np.flatnonzero(np.isfinite(followed.finest).all(axis=1)), followed.finest


def _of(runs: Runs, some: NDArray[np.intp]) -> Runs:
    """Some of the runs."""
    return replace(runs, z=runs.z[some], w=runs.w[some], push=runs.push[some])


def _size(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


def _ends(side: Side, runs: Runs, push: Array) -> Array:
    """Where a file's equations end runs, (K, 2nz), in the engine's order."""
    order, n = side.order, runs.z.shape[1]
    equations = Charted(side.tree, DOUBLES)
    forces = push[:, order].T

    def field(times: Array, states: Array) -> Array:
        q, v = np.moveaxis(states[..., :n], -1, 0), np.moveaxis(states[..., n:], -1, 0)
        shape = forces.shape[:2] + (1,) * (q.ndim - 2)
        pushed = np.broadcast_to(forces.reshape(shape), q.shape)
        a = np.moveaxis(equations.acceleration(q, v, pushed), 0, -1)
        return np.concatenate([states[..., n:], a], axis=-1)

    found = start = np.hstack([runs.z[:, order], runs.w[:, order]])
    for pieces in PIECES:
        try:
            found = start
            for _ in range(pieces):
                found, _ = collocate(field, np.zeros(len(start)), found, runs.length / pieces)
        except ReferenceError:
            continue
        break
    else:
        return np.full_like(start, np.nan)
    ends = np.empty_like(found)
    ends[:, [*order, *(n + i for i in order)]] = found
    return ends
