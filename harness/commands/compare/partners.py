"""Pairs of joints of two files: by name, by order in the tree, by geometry."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from .placed import PlacedTree

MAX_AXIS_DISTANCE = 0.05
"""Maximum distance of paired axes: in radians, and in units of the mechanism's size."""

SAME_AXIS = 1e-6
"""Distance below which axes coincide."""

GEOMETRY_RATIO = 0.1
"""Ratio of distances of axes below which pairs by geometry are preferred to pairs by order."""

IMPOSSIBLE_COST = 1e6
"""Cost of an impossible pair."""

TIE_WEIGHT = 1e-3
"""Weight of body positions and depth, which distinguish joints on one line."""


K = TypeVar("K", str, int)
"""Name of a coordinate, or index of an actuator."""


@dataclass(frozen=True, kw_only=True)
class Pairs(Generic[K]):
    """Pairs of corresponding joints or actuators.

    Attributes:
        pairs: those of A -> those of B.
        notes: a phrase for each pair whose names differ.
        unpaired: those without a partner, of A and of B.
    """

    pairs: Mapping[K, K]
    notes: tuple[str, ...]
    unpaired: tuple[tuple[K, ...], tuple[K, ...]]


def pair_joints(
    a: Sequence[str],
    b: Sequence[str],
    spoken_for: tuple[set[str], set[str]],
    placed: tuple[PlacedTree, PlacedTree] | None,
) -> Pairs[str]:
    """Pair coordinates.

    Args:
        a, b: names of the coordinates.
        spoken_for: coordinates that the user or a sidecar maps.
        placed: both files' joints as they are drawn; None if a file has no tree.
    """
    pairs = {name: name for name in a if name in b and name not in spoken_for[0] | spoken_for[1]}
    unpaired_a = [name for name in a if name not in pairs and name not in spoken_for[0]]
    unpaired_b = [name for name in b if name not in pairs.values() and name not in spoken_for[1]]
    phrases: list[str] = []
    if placed is not None and unpaired_a and unpaired_b:
        placed_a, placed_b = placed
        ways = _whole(placed_a, unpaired_a), _whole(placed_b, unpaired_b)
        joint_pairs, how = _unnamed(*ways, joints_of(pairs, placed_a, placed_b), placed)
        phrases = [
            f"joint {here} of A is {there} of B: by {how}" for here, there in joint_pairs.items()
        ]
        for here, there in joint_pairs.items():
            pairs |= zip(placed_a.coordinates(here), placed_b.coordinates(there), strict=True)
    unpaired = (
        tuple(name for name in unpaired_a if name not in pairs),
        tuple(name for name in unpaired_b if name not in pairs.values()),
    )
    return Pairs(pairs=pairs, notes=tuple(phrases), unpaired=unpaired)


def _whole(placed: PlacedTree, names: Sequence[str]) -> list[str]:
    """Return joints whose coordinates are all in `names`."""
    return [joint for joint in placed.index if set(placed.coordinates(joint)) <= set(names)]


def joints_of(
    pairs: Mapping[str, str], placed_a: PlacedTree, placed_b: PlacedTree
) -> dict[str, str]:
    """Return joint pairs whose coordinates are paired in order."""
    owners = {name: joint for joint in placed_b.index for name in placed_b.coordinates(joint)}
    joints: dict[str, str] = {}
    for joint in placed_a.index:
        names_a = placed_a.coordinates(joint)
        its = owners.get(pairs.get(names_a[0], ""))
        if its is not None and tuple(pairs.get(name) for name in names_a) == placed_b.coordinates(
            its
        ):
            joints[joint] = its
    return joints


def _unnamed(
    joints_a: Sequence[str],
    joints_b: Sequence[str],
    pairs: Mapping[str, str],
    placed: tuple[PlacedTree, PlacedTree],
) -> tuple[dict[str, str], str]:
    """Return pairs of joints whose names do not correspond, and the criterion.

    Pair them by order, unless geometry pairs more of them, or as many much closer.
    """
    placed_a, placed_b = placed
    in_order = _in_order(joints_a, joints_b, pairs, placed_a, placed_b)
    near = _nearest(joints_a, joints_b, placed_a, placed_b)
    if len(near) != len(in_order):
        return (near, "geometry") if len(near) > len(in_order) else (in_order, "order")
    apart = [_apart(found, placed_a, placed_b) for found in (in_order, near)]
    if apart[0] > SAME_AXIS and apart[1] < GEOMETRY_RATIO * apart[0]:
        return near, "geometry"
    return in_order, "order"


def _in_order(
    joints_a: Sequence[str],
    joints_b: Sequence[str],
    pairs: Mapping[str, str],
    placed_a: PlacedTree,
    placed_b: PlacedTree,
) -> dict[str, str]:
    """Pair joints of one kind whose parents are paired, in order."""
    paired, free = dict(pairs), [name for name in joints_b if name in placed_b.index]
    new: dict[str, str] = {}
    for name in sorted(
        (x for x in joints_a if x in placed_a.index), key=lambda x: placed_a.index[x]
    ):
        parent = placed_a.parent(name)
        if parent and parent not in paired:
            continue
        carrier, kind = paired[parent] if parent else "", placed_a.kind(name)
        like = (x for x in free if placed_b.kind(x) == kind and placed_b.parent(x) == carrier)
        partner = min(like, key=lambda x: placed_b.index[x], default=None)
        if partner is not None:
            free.remove(partner)
            paired[name] = new[name] = partner
    return new


def _apart(pairs: Mapping[str, str], placed_a: PlacedTree, placed_b: PlacedTree) -> float:
    """Return the summed distance of partners' axes and bodies.

    Bodies are needed since legs on both sides turn about one line.
    """
    size = max(placed_a.size, placed_b.size)
    lines = sum(_distance(placed_a, name, placed_b, its, size) for name, its in pairs.items())
    bodies = (
        placed_a.centers[placed_a.index[name]] - placed_b.centers[placed_b.index[its]]
        for name, its in pairs.items()
    )
    return lines + sum(float(np.linalg.norm(apart)) / size for apart in bodies)


def _nearest(
    joints_a: Sequence[str], joints_b: Sequence[str], placed_a: PlacedTree, placed_b: PlacedTree
) -> dict[str, str]:
    """Pair joints whose axes are close to each other in the world."""
    from scipy.optimize import linear_sum_assignment  # slow import: half a second per worker

    joints_a = [name for name in joints_a if name in placed_a.index]
    joints_b = [name for name in joints_b if name in placed_b.index]
    size = max(placed_a.size, placed_b.size)
    lines = np.array(
        [[_distance(placed_a, x, placed_b, y, size) for y in joints_b] for x in joints_a]
    )
    if not lines.size:
        return {}
    faint = np.array(
        [[_faintly(placed_a, x, placed_b, y, size) for y in joints_b] for x in joints_a]
    )
    rows, columns = linear_sum_assignment(np.minimum(lines, IMPOSSIBLE_COST) + TIE_WEIGHT * faint)
    near = [(i, j) for i, j in zip(rows, columns, strict=True) if lines[i, j] < MAX_AXIS_DISTANCE]
    return {joints_a[i]: joints_b[j] for i, j in near}


def _distance(placed_a: PlacedTree, x: str, placed_b: PlacedTree, y: str, size: float) -> float:
    """Return the distance of two axes: the angle in rad, plus the distance of hinges in sizes."""
    if placed_a.kind(x) != placed_b.kind(y):
        return IMPOSSIBLE_COST
    i, j = placed_a.index[x], placed_b.index[y]
    u, v = placed_a.axes[i], placed_b.axes[j]
    angle = float(np.linalg.norm(np.cross(u, v)))
    if placed_a.kind(x) != "hinge":
        return angle
    between = placed_b.anchors[j] - placed_a.anchors[i]
    return angle + float(np.linalg.norm(between - u * (u @ between))) / size


def _faintly(placed_a: PlacedTree, x: str, placed_b: PlacedTree, y: str, size: float) -> float:
    i, j = placed_a.index[x], placed_b.index[y]
    apart = float(np.linalg.norm(placed_a.centers[i] - placed_b.centers[j])) / size
    return apart + abs(i - j) / max(len(placed_a.index), len(placed_b.index))
