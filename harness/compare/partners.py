"""Pairs of joints of two files: by name, by order in the tree, by geometry."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from physics_crosscheck.harness.compare.placed import Placed

NEAR = 0.05
"""Maximum distance of paired axes: in radians, and in units of the mechanism's size."""

SAME = 1e-6
"""Distance below which axes coincide."""

NEARER = 0.1
"""Ratio of distances of axes below which pairs by geometry are preferred to pairs by order."""

UNLIKE = 1e6
"""Cost of an impossible pair."""

FAINT = 1e-3
"""Weight of body positions and depth, which distinguish joints on one line."""


@dataclass(frozen=True, kw_only=True)
class Partners:
    """Pairs of corresponding joints.

    Attributes:
        pairs: names of A's coordinates -> names of B's.
        told: a phrase for each pair whose names differ.
        alone: names without a partner, of A and of B.
    """

    pairs: Mapping[str, str]
    told: tuple[str, ...]
    alone: tuple[tuple[str, ...], tuple[str, ...]]


def partners(
    a: Sequence[str],
    b: Sequence[str],
    spoken_for: tuple[set[str], set[str]],
    placed: tuple[Placed, Placed] | None,
) -> Partners:
    """Pair coordinates.

    Args:
        a, b: names of the coordinates.
        spoken_for: coordinates that the user or a sidecar maps.
        placed: both files' joints as they are drawn; None if a file has no tree.
    """
    pairs = {name: name for name in a if name in b and name not in spoken_for[0] | spoken_for[1]}
    left = [name for name in a if name not in pairs and name not in spoken_for[0]]
    right = [name for name in b if name not in pairs.values() and name not in spoken_for[1]]
    told: list[str] = []
    if placed is not None and left and right:
        one, other = placed
        ways = _whole(one, left), _whole(other, right)
        found, how = _unnamed(*ways, joints_of(pairs, one, other), placed)
        told = [f"joint {here} of A is {there} of B: by {how}" for here, there in found.items()]
        for here, there in found.items():
            pairs |= zip(one.coordinates(here), other.coordinates(there), strict=True)
    alone = (
        tuple(name for name in left if name not in pairs),
        tuple(name for name in right if name not in pairs.values()),
    )
    return Partners(pairs=pairs, told=tuple(told), alone=alone)


def _whole(placed: Placed, names: Sequence[str]) -> list[str]:
    """Return joints whose coordinates are all in `names`."""
    return [joint for joint in placed.index if set(placed.coordinates(joint)) <= set(names)]


def joints_of(pairs: Mapping[str, str], one: Placed, other: Placed) -> dict[str, str]:
    """Return joint pairs whose coordinates are paired in order."""
    owners = {name: joint for joint in other.index for name in other.coordinates(joint)}
    found: dict[str, str] = {}
    for joint in one.index:
        own = one.coordinates(joint)
        its = owners.get(pairs.get(own[0], ""))
        if its is not None and tuple(pairs.get(name) for name in own) == other.coordinates(its):
            found[joint] = its
    return found


def _unnamed(
    left: Sequence[str],
    right: Sequence[str],
    pairs: Mapping[str, str],
    placed: tuple[Placed, Placed],
) -> tuple[dict[str, str], str]:
    """Return pairs of joints whose names do not correspond, and the criterion.

    Pair them by order, unless geometry pairs more of them, or as many much closer.
    """
    one, other = placed
    in_order = _in_order(left, right, pairs, one, other)
    near = _nearest(left, right, one, other)
    if len(near) != len(in_order):
        return (near, "geometry") if len(near) > len(in_order) else (in_order, "order")
    apart = [_apart(found, one, other) for found in (in_order, near)]
    if apart[0] > SAME and apart[1] < NEARER * apart[0]:
        return near, "geometry"
    return in_order, "order"


def _in_order(
    left: Sequence[str],
    right: Sequence[str],
    pairs: Mapping[str, str],
    one: Placed,
    other: Placed,
) -> dict[str, str]:
    """Pair joints of one kind whose parents are paired, in order."""
    found, free = dict(pairs), [name for name in right if name in other.index]
    new: dict[str, str] = {}
    for name in sorted((x for x in left if x in one.index), key=lambda x: one.index[x]):
        parent = one.parent(name)
        if parent and parent not in found:
            continue
        carrier, kind = found[parent] if parent else "", one.kind(name)
        like = (x for x in free if other.kind(x) == kind and other.parent(x) == carrier)
        partner = min(like, key=lambda x: other.index[x], default=None)
        if partner is not None:
            free.remove(partner)
            found[name] = new[name] = partner
    return new


def _apart(pairs: Mapping[str, str], one: Placed, other: Placed) -> float:
    """Return the summed distance of partners' axes and bodies.

    Bodies are needed since legs on both sides turn about one line.
    """
    size = max(one.size, other.size)
    lines = sum(_distance(one, name, other, its, size) for name, its in pairs.items())
    bodies = (
        one.centers[one.index[name]] - other.centers[other.index[its]]
        for name, its in pairs.items()
    )
    return lines + sum(float(np.linalg.norm(apart)) / size for apart in bodies)


def _nearest(
    left: Sequence[str], right: Sequence[str], one: Placed, other: Placed
) -> dict[str, str]:
    """Pair joints whose axes are close to each other in the world."""
    from scipy.optimize import linear_sum_assignment  # slow import: half a second per worker

    left = [name for name in left if name in one.index]
    right = [name for name in right if name in other.index]
    size = max(one.size, other.size)
    lines = np.array([[_distance(one, x, other, y, size) for y in right] for x in left])
    if not lines.size:
        return {}
    faint = np.array([[_faintly(one, x, other, y, size) for y in right] for x in left])
    rows, columns = linear_sum_assignment(np.minimum(lines, UNLIKE) + FAINT * faint)
    near = [(i, j) for i, j in zip(rows, columns, strict=True) if lines[i, j] < NEAR]
    return {left[i]: right[j] for i, j in near}


def _distance(one: Placed, x: str, other: Placed, y: str, size: float) -> float:
    """Return the distance of two axes: the angle in rad, plus the distance of hinges in sizes."""
    if one.kind(x) != other.kind(y):
        return UNLIKE
    i, j = one.index[x], other.index[y]
    u, v = one.axes[i], other.axes[j]
    angle = float(np.linalg.norm(np.cross(u, v)))
    if one.kind(x) != "hinge":
        return angle
    between = other.anchors[j] - one.anchors[i]
    return angle + float(np.linalg.norm(between - u * (u @ between))) / size


def _faintly(one: Placed, x: str, other: Placed, y: str, size: float) -> float:
    i, j = one.index[x], other.index[y]
    apart = float(np.linalg.norm(one.centers[i] - other.centers[j])) / size
    return apart + abs(i - j) / max(len(one.index), len(other.index))
