"""Inertias that no body can have, and joints that move none: before anything is derived."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from physics_crosscheck.harness.modelfiles.quote import brief
from physics_crosscheck.harness.modelfiles.robot import Part, Robot
from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import rotate
from physics_crosscheck.reference.mechanism.tree import WORLD, Tree

MARGIN = 1e-9
"""By how much of the largest moment a tensor may miss a rule: for the digits of a file."""

DIGITS = 1e-14
"""What rounding leaves of m r^2 in a moment that was brought to the center of mass."""

ROUNDED = 1e-13
"""Inertia of a joint, by what it carries, that is none."""

SEEN = 1e-6
"""Share of a joint in a motion that is one."""

STATES = 6
"""Positions at which a mass matrix is looked at; one that is singular at a few is none to all."""

Kind = Literal["not finite", "negative mass", "moments", "triangle", "massless"]


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A link whose inertia no body can have, though there are equations of it.

    Attributes:
        kind: which rule it breaks.
        link: its name.
        sentence: the rule and its numbers.
        file: in which it stands.
        line: where the link begins, from 1.
        remedy: what to do about it.
    """

    kind: Kind
    link: str
    sentence: str
    file: Path
    line: int
    remedy: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.sentence}; {self.remedy}"


def impossible(robot: Robot) -> tuple[Finding, ...]:
    """Every rule that a link of the file breaks, also one that stands still."""
    return tuple(
        Finding(
            kind=kind,
            link=part.name,
            sentence=f"link {brief(part.name)} {sentence}",
            file=robot.file,
            line=part.line,
            remedy=remedy,
        )
        for part in robot.parts
        for kind, sentence, remedy in _broken(part)
    )


def _broken(part: Part) -> Iterator[tuple[Kind, str, str]]:
    numbers = [part.mass, *part.center, *part.inertia.ravel()]
    if not np.isfinite(numbers).all():
        yield "not finite", "has an inertia that is not finite", "write finite numbers"
        return
    if part.mass < 0:
        yield "negative mass", f"has a mass of {part.mass:g} kg", "write a positive mass"
    small, middle, large = np.linalg.eigvalsh(part.inertia).tolist()
    far = float(part.center @ part.center)
    allowed = MARGIN * max(abs(small), abs(large)) + DIGITS * abs(part.mass) * far
    told = f"{small:.4g}, {middle:.4g} and {large:.4g} kg m^2"
    if small < -allowed:
        yield (
            "moments",
            f"has the principal moments of inertia {told}",
            "they can't be negative: check its products of inertia",
        )
    elif small + middle < large - allowed:
        yield (
            "triangle",
            f"has the principal moments of inertia {told}",
            "the largest can't exceed the sum of the other two: check its axes and its origin",
        )
    if part.mass == 0 and np.any(part.inertia):
        yield "massless", f"has inertia, {told}, but no mass", "set its mass, or remove the inertia"


def resting(tree: Tree, limits: tuple[Array, Array]) -> tuple[tuple[int, ...], ...] | None:
    """Groups of joints, by their links, of which a motion together moves no mass at any position.

    A mass matrix is not positive definite then, and there are no accelerations. None where it is
    not even finite.

    Args:
        tree: the bodies.
        limits: of the joints, within which is looked.
    """
    if not tree.nv:
        return ()
    q = _positions(tree, limits)
    mass = np.moveaxis(Recursion(tree).mass(q), -1, 0)
    owner = [i for i, there in enumerate(tree.velocities) for _ in range(there.start, there.stop)]
    if not np.isfinite(mass).all():
        return None
    diagonal = np.diagonal(mass, axis1=1, axis2=2)
    bare = (diagonal <= ROUNDED * _carried(tree, q)[:, owner]).all(axis=0)
    groups = [(i,) for i in dict.fromkeys(np.array(owner)[bare].tolist())]
    left = np.flatnonzero(~bare & (diagonal > 0).all(axis=0))
    together = _together(mass[:, left[:, None], left])
    if together:
        groups.append(tuple(dict.fromkeys(owner[left[k]] for k in together)))
    return tuple(groups)


def _positions(tree: Tree, limits: tuple[Array, Array]) -> Array:
    """A few positions, (nq, `STATES`), anyhow but within limits."""
    random = np.random.default_rng(20260101)
    q = random.normal(size=(tree.nq, STATES))
    for link, here, there in zip(tree.links, tree.positions, tree.velocities, strict=True):
        if link.kind in ("hinge", "slide"):
            lower = max(float(limits[0][there.start]), -np.pi)
            upper = max(min(float(limits[1][there.start]), np.pi), lower)
            q[here] = random.uniform(lower, upper, size=(1, STATES))
    return q


def _carried(tree: Tree, q: Array) -> Array:
    """What each joint carries: its inertia about a point, or its mass; (states, links)."""
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


def _together(mass: Array) -> list[int]:
    """Indices of the velocities of a motion without mass at every position, (states, n, n)."""
    if not mass.shape[1]:
        return []
    scale = 1 / np.sqrt(np.diagonal(mass, axis1=1, axis2=2))
    values, vectors = np.linalg.eigh(mass * scale[:, :, None] * scale[:, None])
    if not (values[:, 0] <= ROUNDED * mass.shape[1]).all():
        return []
    share = np.abs(vectors[-1, :, 0])
    found: list[int] = np.flatnonzero(share > SEEN * share.max()).tolist()
    return found
