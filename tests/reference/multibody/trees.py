"""Random trees of bodies, drawn from a seed."""

from collections.abc import Sequence

import numpy as np

from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import from_quaternion
from physics_crosscheck.reference.mechanism.tree import WORLD, Kind, Tree, TreeLink

KINDS: tuple[Kind, ...] = ("hinge", "slide", "ball", "free")


def tree(kinds: Sequence[Kind], seed: int, *, chain: bool = False) -> Tree:
    """Draw a tree of links; in a chain, each carries the next."""
    rng = np.random.default_rng(seed)
    path, links = [WORLD], list[TreeLink]()
    for i, kind in enumerate(kinds):
        # Complete each branch before the next: some libraries accept links in no other order.
        path = path if chain else path[: int(rng.integers(len(path))) + 1]
        links.append(link(kind, f"j{i}", path[-1], rng))
        path = [*path, i]
    return Tree(links=tuple(links), gravity=rng.normal(size=3) * 9.81)


def link(kind: Kind, name: str, parent: int, rng: np.random.Generator) -> TreeLink:
    """Draw a body of about a kilogram and a metre, with products of inertia."""
    axis, points = rng.normal(size=3), rng.normal(size=(6, 3)) * 0.3
    turns = kind in ("hinge", "slide")
    return TreeLink(
        name=name,
        parent=parent,
        position=rng.normal(size=3) * 0.5,
        rotation=from_quaternion(rng.normal(size=4)),
        kind=kind,
        axis=axis / np.linalg.norm(axis),
        mass=float(rng.uniform(0.5, 2.0)),
        center=rng.normal(size=3) * 0.2,
        inertia=sum((p @ p * np.eye(3) - np.outer(p, p) for p in points), np.zeros((3, 3))) / 6,
        armature=float(rng.uniform(0.0, 0.1)),
        damping=float(rng.uniform(0.0, 0.5)),
        stiffness=float(rng.uniform(1.0, 20.0)) if turns else 0.0,
        rest=(float(rng.normal()),),
    )


def state(robot: Tree, seed: int, batch: tuple[int, ...] = ()) -> tuple[Array, Array]:
    """Draw positions (nq, ...) with unit quaternions, and velocities (nv, ...)."""
    rng = np.random.default_rng(seed)
    q, v = rng.normal(size=(robot.nq, *batch)), rng.normal(size=(robot.nv, *batch))
    for body, here in zip(robot.links, robot.positions, strict=True):
        if body.kind in ("ball", "free"):
            part = slice(here.stop - 4, here.stop)
            q[part] /= np.sqrt((q[part] ** 2).sum(axis=0))
    return q, v
