"""A tree at one state: mass matrix, smooth forces, Jacobians of points, lengths of paths.

Velocities are those that engines store: angular about a link's axes, linear along the axes of its
parent. Arrays are in the order of the tree's velocities, (nv,).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from physics_crosscheck.reference.dynamics.fluid import drag_box
from physics_crosscheck.reference.dynamics.force_elements import ForceElements
from physics_crosscheck.reference.dynamics.propagation import LinkMotion, Placement
from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.mechanism.chart import MinimalCoordinates, coordinate_names
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import cross, rotation_vector
from physics_crosscheck.reference.mechanism.spatial_inertia import Place
from physics_crosscheck.reference.mechanism.tree import WORLD, Tree, TreeForce
from physics_crosscheck.reference.solving.next_state import SteppedBodies


@dataclass(frozen=True, kw_only=True, eq=False)
class LawTree:
    """A tree whose couplings are laws, with the paths that laws and drives act along.

    Attributes:
        tree: without couplings.
        paths: force elements without coefficients.
        bodies: link index, or `WORLD`, and pose in the link's frame; the ground first.
        masses: of the bodies, kg.
        centers: of mass, in the bodies' frames, m, (bodies, 3).
    """

    tree: Tree
    paths: tuple[TreeForce, ...]
    bodies: tuple[tuple[int, Place], ...]
    masses: Array
    centers: Array

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the coordinates, (nv,)."""
        links = self.tree.links
        return tuple(name for link in links for name, _ in coordinate_names(link.kind, link.name))

    @cached_property
    def _stepped(self) -> SteppedBodies:
        return SteppedBodies(self.tree)

    @cached_property
    def _chart(self) -> MinimalCoordinates:
        return MinimalCoordinates(self.tree)

    @cached_property
    def _recursion(self) -> Recursion:
        return Recursion(self.tree)

    @cached_property
    def _lengths(self) -> ForceElements:
        """The lengths of the paths, then of the tree's own force elements."""
        elements = (*self.paths, *self.tree.pulls)
        return ForceElements(replace(self.tree, pulls=elements), self._recursion)

    def force(self, y: Array, m: Array, push: Array) -> Array:
        """Return the smooth forces at states (B, nv), under forces `push`, (B, nv)."""
        return self._stepped.force(y, m, push)

    def advance(self, y: Array, m: Array, h: float) -> Array:
        """Return the positions after h seconds at constant velocities, (B, nv)."""
        return self._stepped.advanced(y, m, h)

    def postures(self, y: Array, m: Array) -> Iterator[Posture]:
        """Yield the tree at each of B states: coordinates and stored velocities, (B, nv) each."""
        q, nothing = self._chart.positions(y.T), np.zeros_like(m)
        mass, smooth = self._stepped.mass(y), self.force(y, m, nothing)
        placements = self._recursion.placements(q)
        poses = self._recursion.poses_of(placements)
        still = self._chart.frame_acceleration(y.T, m.T)
        motions = self._recursion.motions(placements, self._chart.tree_velocities(y.T, m.T), still)
        lift = self._chart.to_joint_axes(y.T, self._recursion.lift(q))
        lines = list(self._lengths.lines(q)) if self._lengths else []
        count = len(self.paths)
        for b in range(len(y)):
            rows = self._stored_rows(y[b], [row[:, b] for _, row in lines])
            yield Posture(
                parent=self,
                y=y[b],
                m=m[b],
                q=q[:, b],
                mass=mass[b],
                smooth=smooth[b],
                lift=lift[:, b],
                poses=[Placement(*(_state(part, b) for part in pose)) for pose in poses],
                motions=[LinkMotion(*(_state(part, b) for part in motion)) for motion in motions],
                lengths=np.array([float(length[0, b]) for length, _ in lines[:count]]),
                rows=rows[:count],
                pull_rows=rows[count:],
            )

    def _stored_rows(self, y: Array, rows: Sequence[Array]) -> Array:
        """Return rows of paths, by the tree's velocities, as rows by the stored ones, (P, nv)."""
        if not rows:
            return np.zeros((0, len(y)))
        tall: Array = self._chart.to_joint_axes(y[:, None], np.stack(rows, axis=1))
        return tall.T


@dataclass(frozen=True, kw_only=True, eq=False)
class Posture:
    """A tree at one state.

    Attributes:
        parent: the tree.
        y, m: coordinates and stored velocities, (nv,).
        q: the tree's positions, with quaternions of any length, (nq,).
        mass: M, (nv, nv).
        smooth: all smooth forces but those of drives, (nv,).
        lift: the part of them that compensates weight, (nv,).
        poses: each link's frame in the world.
        motions: of each link at constant m, relative to a freely falling frame.
        lengths, rows: of the paths, (P,), and their derivatives by the velocities, (P, nv).
        pull_rows: the same derivatives of the tree's force elements, (pulls, nv).
    """

    parent: LawTree
    y: Array
    m: Array
    q: Array
    mass: Array
    smooth: Array
    lift: Array
    poses: list[Placement]
    motions: list[LinkMotion]
    lengths: Array
    rows: Array
    pull_rows: Array

    @cached_property
    def inverse(self) -> Array:
        """The inverse of M, (nv, nv)."""
        return np.asarray(np.linalg.inv(self.mass), dtype=np.float64)

    @cached_property
    def loads(self) -> Array:
        """Bounds of the terms that cancel in the weight and inertial forces, (nv,).

        Of each link its force and moment by weight and rotation, with those of the links on it.
        """
        links, count = self.parent.tree.links, len(self.poses)
        force, moment, spins, speeds = np.zeros((4, count + 1))  # the last is the world
        arms = np.zeros(count)
        for i, (link, motion) in enumerate(zip(links, self.motions, strict=True)):
            carrier = np.zeros(3) if link.parent == WORLD else self.poses[link.parent].origin
            arms[i] = np.linalg.norm(self.poses[i].origin - carrier)
            spin, turning, linear = (float(np.linalg.norm(one)) for one in motion)
            rate = np.linalg.norm(link.motion[1] @ self.m[self.parent.tree.velocities[i]])
            spins[i], speeds[i] = spin, speeds[link.parent] + spins[link.parent] * arms[i] + rate
            center, inertia = np.linalg.norm(link.center), np.linalg.norm(link.inertia)
            moved = linear + (turning + spin**2) * center + spin * (speeds[i] + spin * center)
            force[i] = link.mass * moved
            place = np.linalg.norm(self.poses[i].origin)  # from which engines take arms
            moment[i] = (center + place) * force[i] + inertia * (turning + spin**2)
        result = np.zeros(len(self.m))
        for i in reversed(range(count)):
            turns, slides = links[i].motion
            there, parent = self.parent.tree.velocities[i], links[i].parent
            result[there] = moment[i] * turns.any(axis=0) + force[i] * slides.any(axis=0)
            force[parent] += force[i]
            moment[parent] += moment[i] + arms[i] * force[i]
        return result

    @cached_property
    def mass_terms(self) -> Array:
        """Bounds of the terms that cancel in M, (nv, nv), such as in the axial inertia of a rod.

        By Cauchy and Schwarz, an entry is at most the product of the root mean square velocities
        that two joints give to the bodies on the further one, times their mass.
        """
        links = self.parent.tree.links
        masses = np.array([link.mass for link in links])
        inertias = np.array([float(np.linalg.norm(link.inertia)) for link in links])
        inertias += masses * [float(link.center @ link.center) for link in links]
        result = np.zeros_like(self.mass)
        for i in reversed(range(len(links))):
            whole, turning = float(np.sqrt(masses[i])), float(np.sqrt(inertias[i]))
            above, here = i, self.parent.tree.velocities[i]
            outer: Array = np.zeros(0)
            while above != WORLD:
                arm = float(np.linalg.norm(self.poses[i].origin - self.poses[above].origin))
                turns, slides = (part.any(axis=0) for part in links[above].motion)
                moved: Array = np.asarray(turns * (turning + whole * arm) + slides * whole)
                outer = moved if above == i else outer
                there = self.parent.tree.velocities[above]
                result[here, there] = np.outer(outer, moved)
                result[there, here] = result[here, there].T
                if above == links[i].parent:
                    masses[above] += masses[i]
                    inertias[above] += (turning + whole * arm) ** 2
                above = links[above].parent
        return result

    def body(self, index: int) -> Placement:
        """Return a body's frame in the world."""
        link, place = self.parent.bodies[index]
        if link == WORLD:
            return Placement(place.rotation, place.origin)
        pose = self.poses[link]
        return Placement(pose.rotation @ place.rotation, pose.origin + pose.rotation @ place.origin)

    def jacobian(self, body: int, point: Array) -> tuple[Array, Array]:
        """Return the derivatives of a body's point, linear and angular, (3, nv) each.

        Args:
            body: index of the body.
            point: that moves with it, in the world, m, (3,).
        """
        return self._link_jacobian(self.parent.bodies[body][0], point)

    def _link_jacobian(self, link: int, point: Array) -> tuple[Array, Array]:
        tree = self.parent.tree
        linear, angular = np.zeros((3, tree.nv)), np.zeros((3, tree.nv))
        while link != WORLD:
            there, (about, along) = tree.velocities[link], self._axes[link]
            angular[:, there] = about
            linear[:, there] = along + cross(about, (point - self.poses[link].origin)[:, None])
            link = tree.links[link].parent
        return linear, angular

    def fluid_damping(self) -> Array:
        """Return minus the derivative of the fluid's forces by the velocities, (nv, nv)."""
        tree, result = self.parent.tree, np.zeros_like(self.mass)
        if (fluid := tree.fluid) is None:
            return result
        for immersed in tree.immersed:
            box, pose = drag_box(immersed, fluid), self.poses[immersed.link]
            center, turn = pose.origin + pose.rotation @ box.position, pose.rotation @ box.rotation
            linear, angular = self._link_jacobian(immersed.link, center)
            for rows, wind, drag, resistance in (
                (linear, np.array(fluid.wind), box.drag, box.resistance),
                (angular, np.zeros(3), box.turning_drag, box.turning_resistance),
            ):
                speed = np.abs(turn.T @ (rows @ self.m - wind))
                along = turn.T @ rows
                result += along.T @ ((2 * drag * speed + resistance)[:, None] * along)
        return result

    @cached_property
    def _axes(self) -> list[tuple[Array, Array]]:
        """Axes of rotation and of translation of each link's joint, in the world, (3, n) each."""
        axes = []
        for joint, pose in zip(self.parent.tree.links, self.poses, strict=True):
            about, along = (pose.rotation @ part for part in joint.motion)
            if joint.kind == "free":  # its linear velocity is along its parent's axes
                base = np.eye(3) if joint.parent == WORLD else self.poses[joint.parent].rotation
                along = np.hstack([np.zeros((3, 3)), base @ joint.rotation])
            axes.append((about, along))
        return axes

    def drift(self, body: int, point: Array) -> tuple[Array, Array, Array]:
        """Return a point's acceleration at constant m, its body's, and its velocity of rotation.

        Each is (3,), along the world's axes.
        """
        link = self.parent.bodies[body][0]
        if link == WORLD:
            return np.zeros(3), np.zeros(3), np.zeros(3)
        turn, motion = self.poses[link].rotation, self.motions[link]
        spin, change = turn @ motion.angular, turn @ motion.turning
        arm = point - self.poses[link].origin
        # The frame falls, so that a body at rest seems to accelerate upwards.
        origin = turn @ motion.linear + self.parent.tree.gravity
        return origin + np.cross(change, arm) + np.cross(spin, np.cross(spin, arm)), change, spin

    def sliding_drift(self, body: int) -> Array:
        """Return the error of `drift`, (3,), if balls move with the slides after them in a body.

        Joints of one body are links without mass, except for the last one.
        """
        links, link = self.parent.tree.links, self.parent.bodies[body][0]
        error, along = np.zeros(3), np.zeros(3)
        while link != WORLD:
            (about, axis), rates = self._axes[link], self.m[self.parent.tree.velocities[link]]
            if links[link].kind == "ball":
                error += np.cross(along, about @ rates)
            slides, link = links[link].kind == "slide", links[link].parent
            within = slides and link != WORLD and not links[link].mass
            along = along + axis @ rates if within else np.zeros(3)
        return error

    def angle(self, joint: int) -> Array:
        """Return the rotation vector of a ball joint, (3,)."""
        vector: Array = rotation_vector(self.q[self.parent.tree.positions[joint]])
        return vector


def _state(values: Array, index: int) -> Array:
    """Return the values at one state of a batch; constants have a batch of one."""
    result: Array = values[..., index if values.shape[-1] > 1 else 0]
    return result
