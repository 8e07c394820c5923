"""The ten inertial parameters of each body, and differences of trees in these alone."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.tree import Tree, TreeLink

_INERTIAL = ("mass", "center", "inertia")
_LINKS = tuple(one.name for one in fields(TreeLink) if one.name not in _INERTIAL)
_TREES = ("pulls", "couplings", "bushings")


def ten(link: TreeLink) -> Array:
    """Return the ten inertial parameters of a link, (10,), as in `Recursion.regressor`.

    They are mass, mass times center (3), and inertia about the origin, xx, yy, zz, xy, xz, yz.
    """
    c = link.center
    about = link.inertia + link.mass * (c @ c * np.eye(3) - np.outer(c, c))
    (xx, xy, xz), (_, yy, yz), (*_, zz) = about
    return np.array([link.mass, *(link.mass * c), xx, yy, zz, xy, xz, yz])


def bodies_apart(first: Tree, second: Tree) -> Array | None:
    """Return differences of inertial parameters, (10 links,); None if anything else differs."""
    same = (
        len(first.links) == len(second.links)
        and first.fluid is None
        and second.fluid is None
        and np.array_equal(first.gravity, second.gravity)
        and all(getattr(first, name) == getattr(second, name) for name in _TREES)
    )
    if not same:
        return None
    differences = np.zeros((len(first.links), 10))
    for row, mine, theirs in zip(differences, first.links, second.links, strict=True):
        if mine is theirs:
            continue
        if not _carried_alike(mine, theirs):
            return None
        if not all(np.array_equal(getattr(mine, x), getattr(theirs, x)) for x in _INERTIAL):
            row[:] = ten(mine) - ten(theirs)
    return differences.ravel()


def _carried_alike(first: TreeLink, second: TreeLink) -> bool:
    """Return whether two links differ at most in their inertial parameters."""
    for name in _LINKS:
        mine, theirs = getattr(first, name), getattr(second, name)
        if mine is not theirs and not np.array_equal(mine, theirs):
            return False
    return True
