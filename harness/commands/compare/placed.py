"""A tree of bodies at one position: axes, anchors and masses in the world."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from physics_crosscheck.harness.modelfiles.robot_system import names_of
from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.mechanism.chart import MinimalCoordinates, coordinate_names
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import DOUBLES
from physics_crosscheck.reference.mechanism.spatial_inertia import IDENTITY, Place, SpatialInertia
from physics_crosscheck.reference.mechanism.tree import WORLD, Kind, Tree


@dataclass(frozen=True, kw_only=True, eq=False)
class PlacedTree:
    """The links of a tree at one position, in the world.

    Attributes:
        tree: with n links.
        frames: each link's frame.
        index: of each link, by the name of its joint.
        axes: of the joints; meaningless for a ball and a free joint, (n, 3).
        anchors: points on them, m, (n, 3).
        centers: centres of mass, m, (n, 3).
        size: of the mechanism, m.
    """

    tree: Tree
    frames: tuple[Place, ...]
    index: Mapping[str, int]
    axes: Array
    anchors: Array
    centers: Array
    size: float

    def kind(self, name: str) -> Kind:
        """Return the kind of a joint."""
        return self.tree.links[self.index[name]].kind

    def coordinates(self, name: str) -> tuple[str, ...]:
        """Return coordinate names of a joint: its own name, or those of a ball or free joint."""
        return tuple(one for one, _ in coordinate_names(self.kind(name), name))

    def parent(self, name: str) -> str:
        """Return the joint that carries a joint, or "" for the world."""
        parent = self.tree.links[self.index[name]].parent
        return "" if parent == WORLD else self.tree.links[parent].name

    def body_inertia(self, i: int) -> SpatialInertia:
        """Return a link as a rigid body in the world."""
        link = self.tree.links[i]
        return SpatialInertia(link.mass, link.center, link.inertia).in_frame(self.frames[i])


def placed(tree: Tree, q: Array) -> PlacedTree:
    """Place a tree at positions q, (nq,)."""
    poses = Recursion(tree).poses(q)
    frames = tuple(Place(np.asarray(p.rotation), np.asarray(p.origin)) for p in poses)
    n = len(tree.links)
    rows = list(zip(tree.links, frames, strict=True))
    axes = np.array([frame.rotation @ link.axis for link, frame in rows]).reshape(n, 3)
    anchors = np.array([frame.origin for frame in frames]).reshape(n, 3)
    centers = np.array([frame.transform(link.center) for link, frame in rows]).reshape(n, 3)
    points = np.concatenate([anchors, centers])
    size = float(np.max(np.ptp(points, axis=0), initial=0.0)) if n else 0.0
    return PlacedTree(
        tree=tree,
        frames=frames,
        index={link.name: i for i, link in enumerate(tree.links)},
        axes=axes,
        anchors=anchors,
        centers=centers,
        size=size or 1.0,
    )


def positions(tree: Tree, coordinates: Sequence[str], z: Array) -> Array:
    """Convert positions of an engine's coordinates, (nz,), to a tree's positions, (nq,)."""
    where = {name: i for i, name in enumerate(coordinates)}
    values: Array = MinimalCoordinates(tree, DOUBLES).positions(
        z[[where[name] for name in names_of(tree)]]
    )
    return values


def with_link(tree: Tree, i: int, **changes: object) -> Tree:
    """Return the tree with other values of one link."""
    links = list(tree.links)
    links[i] = replace(links[i], **changes)  # type: ignore[arg-type]
    return replace(tree, links=tuple(links))


def with_joint(placed: PlacedTree, i: int, motion: Place) -> Tree:
    """Return the tree with a joint, and all that it carries, moved in the world."""
    tree, link = placed.tree, placed.tree.links[i]
    outer = IDENTITY if link.parent == WORLD else placed.frames[link.parent]
    place = motion.compose(outer.compose(Place(link.rotation, link.position)))
    rotation = outer.rotation.T
    position = rotation @ (place.origin - outer.origin)
    return with_link(tree, i, rotation=rotation @ place.rotation, position=position)
