"""Checks before a derivation: inertias that no body can have, and joints that move no inertia."""

from collections.abc import Iterator
from typing import Literal

import numpy as np

from physics_crosscheck.harness.documents.errors import ReadError, quote
from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.mechanism.chart import Coupled
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import SpatialInertia, rotate
from physics_crosscheck.reference.mechanism.tree import WORLD, Tree
from .robot import Robot

MARGIN = 1e-9
"""Tolerance of a tensor's rules, relative to the largest moment: for the digits of a file."""

MAX_ROUNDING = 1e-2
"""Largest rounding of a tensor's digits that excuses it, relative to the largest moment."""

MOMENT_ROUNDING = 1e-14
"""Rounding error of a moment moved to the center of mass, relative to m r^2."""

ZERO_INERTIA = 1e-13
"""Inertia of a joint that counts as zero, relative to its moved masses."""

MIN_SHARE = 1e-6
"""Share of a joint in a motion that counts as nonzero."""

SAMPLE_COUNT = 6
"""Positions at which a mass matrix is evaluated; one that is singular at a few is singular at
all.
"""

Kind = Literal["not finite", "negative mass", "moments", "triangle", "massless"]


def impossible_inertias(robot: Robot) -> tuple[ReadError, ...]:
    """Return every rule that a link of the file breaks, also for fixed links."""
    return tuple(
        ReadError(
            kind=kind,
            link=part.name,
            sentence=f"link {quote(part.name)} {sentence}",
            file=part.file or robot.file,
            line=part.line,
            remedy="its digits are rounded, so that some engines refuse it: write more of them"
            if (rounded := kind not in exact)
            else remedy,
            rounded=rounded,
        )
        for part in robot.parts
        for exact in [{kind for kind, *_ in _violations(part.inertia, part.rounding)}]
        for kind, sentence, remedy in _violations(part.inertia)
    )


def breaks_rule(inertia: SpatialInertia) -> bool:
    """Return whether no body can have an inertia, which is finite."""
    return any(kind != "massless" for kind, _, _ in _violations(inertia))


def _violations(body: SpatialInertia, rounding: float = 0.0) -> Iterator[tuple[Kind, str, str]]:
    mass, center, inertia = body
    numbers = [mass, *center, *inertia.ravel()]
    if not np.isfinite(numbers).all():
        yield "not finite", "has an inertia that is not finite", "write finite numbers"
        return
    if mass < 0:
        yield "negative mass", f"has a mass of {mass:g} kg", "write a positive mass"
    small, middle, large = np.linalg.eigvalsh(inertia).tolist()
    far = float(center @ center)
    size = max(abs(small), abs(large))
    allowed = MARGIN * size + MOMENT_ROUNDING * abs(mass) * far
    allowed += rounding if rounding <= MAX_ROUNDING * size else 0.0
    moments = f"{small:.4g}, {middle:.4g} and {large:.4g} kg m^2"
    if small < -allowed:
        yield (
            "moments",
            f"has the principal moments of inertia {moments}",
            "they can't be negative: check signs and products of inertia",
        )
    elif small + middle < large - allowed:
        yield (
            "triangle",
            f"has the principal moments of inertia {moments}",
            "the largest can't exceed the sum of the other two: check its axes and its origin",
        )
    if mass == 0 and np.any(inertia):
        yield (
            "massless",
            f"has inertia, {moments}, but no mass",
            "set its mass, or remove the inertia",
        )


def impossible_links(robot: Robot) -> tuple[ReadError, ...]:
    """Return the links whose inertia no body can have as problems that may prevent a tree."""
    kinds = ("negative mass", "moments", "triangle")
    problems = impossible_inertias(robot)
    return tuple(one for one in problems if one.kind in kinds and not one.rounded)


def massless_groups(tree: Tree, limits: tuple[Array, Array]) -> tuple[tuple[int, ...], ...] | None:
    """Return groups of joints, by their links, whose combined motion moves no mass at any position.

    Then the mass matrix is not positive definite, and accelerations do not exist, unless couplings
    give these joints the inertia of others. None if it is not finite.

    Args:
        tree: the bodies.
        limits: of the joints; positions are sampled within them.
    """
    if not tree.nv:
        return ()
    q = _positions(tree, limits)
    mass = np.moveaxis(Recursion(tree).mass(q), -1, 0)
    owner = [i for i, there in enumerate(tree.velocities) for _ in range(there.start, there.stop)]
    if not np.isfinite(mass).all():
        return None
    diagonal = np.diagonal(mass, axis1=1, axis2=2)
    smallest = ZERO_INERTIA * _carried_inertia(tree, q)[:, owner]
    if tree.couplings:
        along = Coupled(tree).matrix
        shared = along.T @ mass @ along
        unmoved = np.diagonal(shared, axis1=1, axis2=2) <= smallest @ along**2
        if not np.all(unmoved, axis=0).any() and not _massless_motion(shared):
            return ()
    bare = (diagonal <= smallest).all(axis=0)
    groups = [(i,) for i in dict.fromkeys(np.array(owner)[bare].tolist())]
    remaining = np.flatnonzero(~bare & (diagonal > 0).all(axis=0))
    together = _massless_motion(mass[:, remaining[:, None], remaining])
    if together:
        groups.append(tuple(dict.fromkeys(owner[remaining[k]] for k in together)))
    return tuple(groups)


def _positions(tree: Tree, limits: tuple[Array, Array]) -> Array:
    """Return random positions within limits, (nq, `SAMPLE_COUNT`)."""
    random = np.random.default_rng(20260101)
    q = random.normal(size=(tree.nq, SAMPLE_COUNT))
    for link, here, there in zip(tree.links, tree.positions, tree.velocities, strict=True):
        if link.kind in ("hinge", "slide"):
            lower = max(float(limits[0][there.start]), -np.pi)
            upper = max(min(float(limits[1][there.start]), np.pi), lower)
            q[here] = random.uniform(lower, upper, size=(1, SAMPLE_COUNT))
    return q


def _carried_inertia(tree: Tree, q: Array) -> Array:
    """Return the inertia about a point, or the mass, that each joint carries; (states, links)."""
    poses = Recursion(tree).poses(q)
    centers = [
        pose.origin + rotate(pose.rotation, link.center[:, None])
        for link, pose in zip(tree.links, poses, strict=True)
    ]
    out = np.zeros((q.shape[1], len(tree.links)))
    for k, link in enumerate(tree.links):
        i = k
        while i != WORLD:
            if tree.links[i].kind == "slide":
                out[:, i] += abs(link.mass)
            else:
                apart = centers[k] - poses[i].origin
                far = (apart * apart).sum(axis=0)
                out[:, i] += abs(link.mass) * far + np.abs(link.inertia).sum()
            i = tree.links[i].parent
    return out


def _massless_motion(mass: Array) -> list[int]:
    """Return indices of the velocities of a motion without mass at every position, (states, n,
    n).
    """
    if not mass.shape[1]:
        return []
    scale = 1 / np.sqrt(np.diagonal(mass, axis1=1, axis2=2))
    values, vectors = np.linalg.eigh(mass * scale[:, :, None] * scale[:, None])
    if not (values[:, 0] <= ZERO_INERTIA * mass.shape[1]).all():
        return []
    share = np.abs(vectors[-1, :, 0])
    indices: list[int] = np.flatnonzero(share > MIN_SHARE * share.max()).tolist()
    return indices
