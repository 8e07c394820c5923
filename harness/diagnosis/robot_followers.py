"""Joints that follow others in an engine differently than in the equations.

If they start according to the equations, an engine pulls them to its own positions. This
impulse is the effect of no number. At the ends they follow according to the engine. From these
ends its law is estimated, and the segments run again with it. Deviations at the ends are
evidence in addition to the motions: an offset may move nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from physics_crosscheck.harness.checks.case import Followed, follow
from physics_crosscheck.harness.checks.followers import Followers
from physics_crosscheck.harness.checks.task import TreeTask
from physics_crosscheck.harness.checks.verdict import nonzero_scale
from physics_crosscheck.harness.numerics.ladder import EPSILON
from physics_crosscheck.reference.mechanism.chart import Coupled
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.tree import Tree
from physics_crosscheck.reference.solving.segments import Segments
from .samples import RUNGS_USED, finite

MAX_RUNS = 4
"""Maximum number of runs with an estimated law, each more accurate than the previous one."""

MAX_UNEXPLAINED = 0.1
"""Share of the followers' deviations above which they do not follow these leaders."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Following:
    """Deviations of k followers at the ends of segments.

    Attributes:
        coupled: the law in the equations.
        rows: indices of followers among all coordinates, (k,).
        end: end states of the equations, (B, 2n).
        scale: how far each moves at most, positions and rates, (2k,).
    """

    coupled: Coupled
    rows: list[int]
    end: Array
    scale: Array

    @staticmethod
    def from_tree(tree: Tree, some: Segments, like: Tree | None = None) -> Following | None:
        """Return deviations of a tree's followers at some states, or None without followers.

        Args:
            tree: with the couplings.
            some: states.
            like: tree whose motions give the scale; None: its own.
        """
        if not tree.couplings:
            return None
        coupled = Coupled(tree)
        rows, n = [i for i in range(tree.nv) if i not in coupled.kept], len(coupled.kept)
        multipliers = (coupled if like is None else Coupled(like)).matrix[rows]
        change = some.end - some.start
        moved = np.abs(np.hstack([change[:, :n] @ multipliers.T, change[:, n:] @ multipliers.T]))
        return Following(
            coupled=coupled, rows=rows, end=some.end, scale=nonzero_scale(np.max(moved, axis=0))
        )

    def apart(self, tree: Tree, by: Array) -> Array:
        """Return the change of deviations, (B, 2k), for another tree and changed end states."""
        if tree.couplings == self.coupled.couplings:
            return np.zeros((len(by), len(self.scale)))
        other = Coupled(tree)
        if other.kept != self.coupled.kept:
            return np.zeros((len(by), len(self.scale)))
        return _between(
            other.matrix[self.rows] - self.coupled.matrix[self.rows],
            other.offset[self.rows] - self.coupled.offset[self.rows],
            self.end + by,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class FollowersRun:
    """Run of segments in an engine.

    Attributes:
        task: the segments, and the equations.
        way: their ends in the engine.
        followers: law of followers at the starts.
    """

    task: TreeTask
    way: Followed
    followers: Followers

    def apart(self) -> tuple[Array, Array]:
        """Return engine - reference of followers, scaled, and its uncertainty, (B, 2k) each."""
        target = self.task.target
        following = Following.from_tree(target.tree, target.samples)
        residual = self.way.limits.residual
        if following is None or residual is None:
            none = np.zeros((len(target.samples.start), 0))
            return none, none
        rows = following.rows
        places = _places(self.way, target.followers, rows)
        off = _between(
            (self.followers.matrix - target.followers.matrix)[rows],
            (self.followers.offset - target.followers.offset)[rows],
            self.way.limits.limit.value,
        )
        value = residual.limit.value[:, places] + off
        uncertainty = finite(residual.limit.uncertainty, value)
        scale = following.scale
        return value / scale, np.maximum(uncertainty[:, places] / scale, EPSILON)


def run_followers(task: TreeTask, *, again: bool = True) -> FollowersRun:
    """Run segments from states that satisfy the engine's estimated law of followers.

    Args:
        task: the segments.
        again: whether to run again if the law differs.

    Raises:
        EngineError, BlownUpError: with the file.
    """
    way = follow(task, RUNGS_USED)
    best = FollowersRun(task=task, way=way, followers=task.target.followers)
    for _ in range(MAX_RUNS if again else 0):
        seeming = _seeming(best)
        if seeming is None:
            break
        way = follow(task.with_target(followers=seeming), RUNGS_USED)
        other = FollowersRun(task=task, way=way, followers=seeming)
        if not _off(other.way) < _off(best.way) / 2:
            break
        best = other
    return best


def _between(matrix: Array, offset: Array, states: Array) -> Array:
    n = matrix.shape[1]
    places = states[:, :n] @ matrix.T + offset
    return np.concatenate([places, states[:, n:] @ matrix.T], axis=1)


def _places(way: Followed, followers: Followers, rows: list[int]) -> list[int]:
    coordinates = list(way.model.coordinates)
    places = [coordinates.index(followers.names[row]) for row in rows]
    return [*places, *(len(coordinates) + place for place in places)]


def _off(way: Followed) -> float:
    residual = way.limits.residual
    return 0.0 if residual is None else float(np.max(np.abs(residual.limit.value) / residual.scale))


def _seeming(run: FollowersRun) -> Followers | None:
    """Estimate the engine's law of followers; None if it equals the present one or is unknown."""
    target, present, residual = run.task.target, run.followers, run.way.limits.residual
    following = Following.from_tree(target.tree, target.samples)
    if residual is None or following is None:
        return None
    uncertainty = np.maximum(residual.limit.uncertainty, EPSILON * residual.scale)
    if not np.any(np.abs(residual.limit.value) > uncertainty):
        return None
    matrix, offset = present.matrix.copy(), present.offset.copy()
    start, end = target.samples.start, run.way.limits.limit.value
    for row in following.rows:
        both = _places(run.way, present, [row])
        off = residual.limit.value[:, both], uncertainty[:, both]
        correction = _law(matrix[row], start, end, *off)
        if correction is None:
            return None
        matrix[row] += correction[0]
        offset[row] += correction[1]
    return replace(present, matrix=matrix, offset=offset)


def _law(
    multipliers: Array, start: Array, ends: Array, off: Array, uncertainty: Array
) -> tuple[Array, float] | None:
    """Estimate the deviation of a follower's multipliers and offset, from its ends, (B, 2).

    Some engines enforce positions, some only rates. `uncertainty` is the uncertainty of the ends.
    """
    n, leaders = len(multipliers), np.flatnonzero(multipliers)
    place, rate = off.T
    by = np.zeros(len(multipliers))
    if len(leaders):
        by[leaders] = np.linalg.lstsq(ends[:, n:][:, leaders], rate, rcond=None)[0]
    remainder = np.linalg.norm(rate - ends[:, n:] @ by)
    if remainder > max(MAX_UNEXPLAINED * np.linalg.norm(rate), np.linalg.norm(uncertainty[:, 1])):
        return None
    held = place - ends[:, :n] @ by
    loose = place - (ends - start)[:, :n] @ by
    shift = float(np.mean(held))
    if np.linalg.norm(held - shift) <= np.linalg.norm(loose):
        return by, shift
    return by, 0.0


def scaled(scale: Array, following: Following | None) -> Array:
    """Return the scale of a defect: of all coordinates, then of followers, (2n + 2k,)."""
    return scale if following is None else np.concatenate([scale, following.scale])
