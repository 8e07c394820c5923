"""Rows of limits, dry friction, equalities and contacts at one state of a tree.

Source: MuJoCo's documentation, Computation, Constraint model; there also the mixing of two
surfaces' numbers (Contact parameters) and the cones (Friction cones).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from physics_crosscheck.reference.mechanism.laws import (
    Anchor,
    ContactParameters,
    ContactPoint,
    Laws,
    Mixing,
    SoftEquality,
    SoftLimit,
    Softness,
    Surface,
)
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import from_quaternion, to_quaternion
from .mechanics import LawTree, Posture
from .soft import SMALLEST, WITHIN, Kind, Part, Rows


def mixed_friction(mixing: Mixing, first: float, other: float) -> float:
    """Return the friction of two surfaces."""
    match mixing:
        case "product":
            return first * other
        case "mean":
            return (first + other) / 2
        case "harmonic":
            return 2 * first * other / (first + other) if first + other else 0.0
        case "smallest":
            return min(first, other)
    return max(first, other)


def mix_surfaces(
    first: Surface, other: Surface, *, mixing: Mixing = "largest"
) -> ContactParameters:
    """Return the numbers of a contact of two surfaces."""
    if first.priority != other.priority:
        dominant = first if first.priority > other.priority else other
        dimension, frictions = dominant.dimension, dominant.frictions
        softness = dominant.softness
    else:
        dimension = max(first.dimension, other.dimension)
        pairs = zip(first.frictions, other.frictions, strict=True)
        frictions = tuple(mixed_friction(mixing, *pair) for pair in pairs)
        softness = _mixed_softness(first, other)
    return ContactParameters(
        dimension=dimension,
        friction=frictions,
        margin=first.margin + other.margin,
        softness=softness,
    )


def _mixed_softness(first: Surface, other: Surface) -> Softness:
    share = _share(first.mix, other.mix)
    mine, theirs = first.softness, other.softness
    direct = mine.reference[0] <= 0 or theirs.reference[0] <= 0
    pairs = list(zip(mine.reference, theirs.reference, strict=True))
    low, high = (min(pair) if direct else share * pair[0] + (1 - share) * pair[1] for pair in pairs)
    both = zip(mine.impedance, theirs.impedance, strict=True)
    return Softness(
        reference=(low, high), impedance=tuple(share * a + (1 - share) * b for a, b in both)
    )


def _share(first: float, other: float) -> float:
    """Return the weight of the first of two surfaces."""
    if first >= SMALLEST and other >= SMALLEST:
        return first / (first + other)
    return 0.5 if first < SMALLEST and other < SMALLEST else float(first >= SMALLEST)


@dataclass(frozen=True, kw_only=True, eq=False)
class Weights:
    """Inverse inertias in the drawn configuration, which scale the softness of all rows.

    Attributes:
        bodies: of translation and rotation, (bodies, 2); zero for bodies that stand still.
        velocities: of each velocity, (nv,); averages of the three of a rotation or translation.
        paths: (P,).
        path_accelerations: norm of the acceleration per unit force of each path, (P,).
    """

    bodies: Array
    velocities: Array
    paths: Array
    path_accelerations: Array

    @staticmethod
    def from_home(laws: Laws, tree: LawTree, home: Array) -> Weights:
        """Return the weights at coordinates `home`, (nv,)."""
        posture = next(tree.postures(home[None], np.zeros((1, len(home)))))
        inverse = posture.inverse
        bodies = np.zeros((len(tree.bodies), 2))
        velocities = np.diagonal(inverse).copy()
        for link, there in zip(tree.tree.links, tree.tree.velocities, strict=True):
            for start in range(there.start, there.stop, 3) if link.kind in ("ball", "free") else ():
                velocities[start : start + 3] = velocities[start : start + 3].mean()
        for i, (carrier, _) in enumerate(tree.bodies):
            if carrier < 0:
                continue
            if i in laws.light:
                bodies[i, 0] = 1 / tree.masses[i]
                while carrier >= 0:
                    velocities[tree.tree.velocities[carrier]] = 1 / tree.masses[i]
                    carrier = tree.tree.links[carrier].parent
                continue
            center = posture.body(i).rotation @ tree.centers[i] + posture.body(i).origin
            for k, rows in enumerate(posture.jacobian(i, center)):
                bodies[i, k] = np.einsum("ri,ij,rj->", rows, inverse, rows) / 3
        accelerations = posture.rows @ inverse
        return Weights(
            bodies=bodies,
            velocities=velocities,
            paths=np.einsum("pi,pi->p", accelerations, posture.rows),
            path_accelerations=np.linalg.norm(accelerations, axis=1),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Constraints:
    """The rows of a tree.

    Attributes:
        laws: the file's numbers.
        tree: the bodies.
        home: coordinates of the drawn configuration, (nv,).
    """

    laws: Laws
    tree: LawTree
    home: Array

    @cached_property
    def weights(self) -> Weights:
        """The inverse inertias of the drawn configuration."""
        return Weights.from_home(self.laws, self.tree, self.home)

    def under(self, laws: Laws) -> Self:
        """Return the same tree under other laws, with the weights of the drawn configuration."""
        other = replace(self, laws=laws)
        if laws.light == self.laws.light:
            other.__dict__["weights"] = self.weights
        return other

    def rows(self, posture: Posture, contacts: Sequence[ContactPoint]) -> Rows:
        """Return the rows at a state."""
        rows = Rows(step=self.laws.step, safe=self.laws.safe, velocities=posture.m)
        for i, equality in enumerate(self.laws.equalities):
            if equality.anchors is None:
                self._add_equality(rows, posture, equality, i)
            else:
                self._add_anchors(rows, posture, equality, equality.anchors, i)
        for i, friction in enumerate(self.laws.frictions):
            for row, weight in self._directions(posture, friction.joint, friction.path):
                rows.add(Kind.FRICTION, row, friction.softness, 0.0, weight, bound=friction.force,
                         part=Part("dry friction", i))  # fmt: skip
        for i, limit in enumerate(self.laws.limits):
            self._add_limit(rows, posture, limit, i)
        for i, contact in enumerate(contacts):
            self._add_contact(rows, posture, contact, i)
        return rows

    def _directions(self, posture: Posture, joint: int, path: int) -> list[tuple[Array, float]]:
        """Return the rows of a joint's velocities, or of a path, each with its weight."""
        if joint < 0:
            return [(posture.rows[path], float(self.weights.paths[path]))]
        there = self.tree.tree.velocities[joint]
        eye = np.eye(len(posture.m))
        return [(eye[i], float(self.weights.velocities[i])) for i in range(there.start, there.stop)]

    def _add_equality(
        self, rows: Rows, posture: Posture, equality: SoftEquality, index: int
    ) -> None:
        """Add the row of two joints or two paths."""
        pairs = [(joint, -1) for joint in equality.joints] + [(-1, k) for k in equality.paths]
        positions = [self._position(posture, *pair) for pair in pairs]
        moved = [x - start for x, start in zip(positions, equality.starts, strict=True)]
        (row, weight), *others = (self._directions(posture, *pair)[0] for pair in pairs)
        constant, *slopes = equality.polynomial
        violation = moved[0] - constant
        if others:
            curve = np.polynomial.Polynomial((0.0, *slopes))
            violation -= float(curve(moved[1]))
            row = row - float(curve.deriv()(moved[1])) * others[0][0]
            weight += others[0][1]
        size = sum(map(abs, (*positions, *equality.starts, constant)))
        rows.add(Kind.EQUALITY, row, equality.softness, violation, weight, position=size,
                 part=_within(Part("equality", index), equality.softness, violation),
                 )  # fmt: skip

    def _position(self, posture: Posture, joint: int, path: int) -> float:
        if joint < 0:
            return float(posture.lengths[path])
        return float(posture.y[self.tree.tree.velocities[joint].start])

    def _add_anchors(
        self,
        rows: Rows,
        posture: Posture,
        equality: SoftEquality,
        anchors: tuple[Anchor, Anchor],
        index: int,
    ) -> None:
        """Add the rows of two anchors: three of translation, three more if they can't rotate."""
        first, other = (_Anchored.from_posture(posture, anchor) for anchor in anchors)
        apart, row = first.origin - other.origin, first.linear - other.linear
        bias = first.acceleration - other.acceleration
        if self.laws.sliding_drift:
            before, after = (posture.sliding_drift(anchor.body) for anchor in anchors)
            bias = bias + before - after
        weights = [sum(float(self.weights.bodies[a.body, k]) for a in anchors) for k in range(2)]
        weight = [weights[0]] * 3
        if equality.turn_scale is not None:
            turn, by, drift = _rotation_error(first, other)
            scale = equality.turn_scale
            apart = np.concatenate([apart, scale * turn])
            row, bias = np.vstack([row, scale * by]), np.concatenate([bias, scale * drift])
            weight += [weights[1]] * 3
        size = float(np.abs(first.origin).sum() + np.abs(other.origin).sum())
        whole = float(np.linalg.norm(apart))
        for k in range(len(apart)):
            rows.add(
                Kind.EQUALITY, row[k], equality.softness, float(apart[k]), weight[k],
                position=size, depth=whole, bias=self.laws.drift * float(bias[k]),
                part=_within(Part("equality", index), equality.softness, whole),
            )  # fmt: skip

    def _add_limit(self, rows: Rows, posture: Posture, limit: SoftLimit, index: int) -> None:
        """Add the rows of a limit that is nearer than its margin."""
        links = self.tree.tree.links
        if limit.joint >= 0 and links[limit.joint].kind == "ball":
            return self._add_ball_limit(rows, posture, limit, index)
        position = self._position(posture, limit.joint, limit.path)
        row, weight = self._directions(posture, limit.joint, limit.path)[0]
        for sign, bound in ((-1, limit.lower), (1, limit.upper)):
            distance = sign * (bound - position)
            if distance < limit.margin:
                violation, part = distance - limit.margin, Part("limit", index, sign)
                rows.add(
                    Kind.ONE_SIDED, -sign * row, limit.softness, violation, weight,
                    position=abs(position) + abs(bound),
                    part=_within(part, limit.softness, violation),
                )  # fmt: skip
        return None

    def _add_ball_limit(self, rows: Rows, posture: Posture, limit: SoftLimit, index: int) -> None:
        vector = posture.angle(limit.joint)
        angle = float(np.linalg.norm(vector))
        distance = max(limit.lower, limit.upper) - angle
        if distance >= limit.margin:
            return
        there = self.tree.tree.velocities[limit.joint]
        row = np.zeros(len(posture.m))
        # At no angle the axis is arbitrary; the documented law takes the first.
        row[there] = -vector / angle if angle > SMALLEST else (-1.0, 0.0, 0.0)
        rows.add(
            Kind.ONE_SIDED, row, limit.softness, distance - limit.margin,
            float(self.weights.velocities[there.start]), position=2 * angle,
            part=_within(Part("limit", index, 1), limit.softness, distance - limit.margin),
        )  # fmt: skip

    def parameters(self, first: int, other: int) -> ContactParameters:
        """Return the numbers of the contact of two surfaces."""
        for *surfaces, parameters in self.laws.pairs:
            if set(surfaces) == {first, other}:
                return parameters
        pair = self.laws.surfaces[first], self.laws.surfaces[other]
        return mix_surfaces(*pair, mixing=self.laws.mixing)

    def _add_contact(self, rows: Rows, posture: Posture, contact: ContactPoint, index: int) -> None:
        """Add the rows of a contact within its margin, unless both bodies stand still."""
        parameters = self.parameters(*contact.surfaces)
        violation = contact.distance - parameters.margin
        first, other = (self.laws.surfaces[i].body for i in contact.surfaces)
        if violation >= 0 or (self.tree.bodies[first][0] < 0 and self.tree.bodies[other][0] < 0):
            return
        pairs = (posture.jacobian(body, contact.position) for body in (first, other))
        (linear, angular), (linear_2, angular_2) = pairs
        # A vector product has no term of equal axes: on a joint's axis an arm is exactly zero.
        sizes = np.abs(contact.position).sum() - np.abs(contact.position)
        jacobian = np.vstack(
            [contact.frame @ (linear_2 - linear), contact.frame @ (angular_2 - angular)]
        )
        added = _ContactRows(
            rows=rows,
            parameters=parameters,
            jacobian=jacobian[: parameters.dimension],
            violation=violation,
            # The distance is the detector's; the arms are differences of positions.
            position=abs(contact.distance) + parameters.margin,
            arms=sizes @ (np.abs(angular) + np.abs(angular_2)),
            weight=float(self.weights.bodies[first, 0] + self.weights.bodies[other, 0]),
            part=Part("contact", index),
        )
        friction = np.maximum(self.laws.least_friction, parameters.friction)
        friction = friction[: parameters.dimension - 1]
        ratio = max(SMALLEST, self.laws.friction_ratio)
        if parameters.dimension == 1:
            added.add(Kind.ONE_SIDED, jacobian[0], added.weight)
        elif self.laws.elliptic:
            added.add_cone(friction, ratio)
        else:
            added.add_pyramid(friction, ratio)


def _within(part: Part, softness: Softness, violation: float) -> Part:
    """Return a part, or that of a small violation."""
    small = abs(violation) < softness.impedance[2]
    return part._replace(way=WITHIN * (part.way or 1)) if small else part


@dataclass(frozen=True, kw_only=True, eq=False)
class _ContactRows:
    """The rows of one contact; the first row of its Jacobian is along the normal."""

    rows: Rows
    parameters: ContactParameters
    jacobian: Array
    violation: float
    position: float
    arms: Array
    weight: float
    part: Part

    def add(self, kind: Kind, row: Array, weight: float, share: float = 1.0) -> None:
        """Add a row that resists the violation."""
        self.rows.add(
            kind, row, self.parameters.softness, self.violation, weight,
            position=self.position, share=share, arms=self.arms, part=self.part,
        )  # fmt: skip

    def add_pyramid(self, friction: Array, ratio: float) -> None:
        """Add two edges for each direction of friction."""
        slope = float(friction[0]) ** 2
        weight, share = (1 + slope) * self.weight, 2 * slope / ratio
        for row, mu in zip(self.jacobian[1:], friction, strict=True):
            for edge in (mu * row, -mu * row):
                self.add(Kind.ONE_SIDED, self.jacobian[0] + edge, weight, share)

    def add_cone(self, friction: Array, ratio: float) -> None:
        """Add a normal row, and one for each direction of friction."""
        slope = float(friction[0] / np.sqrt(ratio))
        self.rows.cones.append((len(self.rows.kinds), slope, friction))
        self.add(Kind.BLOCK, self.jacobian[0], self.weight)
        softness, sliding = self.parameters.softness, self.parameters.sliding
        softness = replace(softness, reference=sliding) if any(sliding) else softness
        for row, mu in zip(self.jacobian[1:], friction, strict=True):
            share = float(friction[0] / mu) ** 2 / ratio
            self.rows.add(Kind.BLOCK, row, softness, 0.0, self.weight, depth=self.violation,
                          share=share, arms=self.arms, part=self.part)  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class _Anchored:
    """An anchor in the world at one state: axes, origin, Jacobians, accelerations at constant m."""

    rotation: Array
    origin: Array
    linear: Array
    angular: Array
    acceleration: Array
    change: Array
    spin: Array

    @staticmethod
    def from_posture(posture: Posture, anchor: Anchor) -> _Anchored:
        """Return an anchor at a state."""
        body = posture.body(anchor.body)
        origin = body.origin + body.rotation @ np.array(anchor.position)
        linear, angular = posture.jacobian(anchor.body, origin)
        acceleration, change, spin = posture.drift(anchor.body, origin)
        return _Anchored(
            rotation=body.rotation @ from_quaternion(np.array(anchor.turn)),
            origin=origin,
            linear=linear,
            angular=angular,
            acceleration=acceleration,
            change=change,
            spin=spin,
        )


def _rotation_error(first: _Anchored, other: _Anchored) -> tuple[Array, Array, Array]:
    """Return the vector part of the relative quaternion, its Jacobian, and J-dot v, (3, ...)."""
    back = other.rotation.T
    w, *e = to_quaternion(back @ first.rotation)
    turn = np.array(e)
    rate = back @ (first.spin - other.spin)
    change = back @ (first.change - other.change - np.cross(other.spin, first.spin))
    w_rate, turn_rate = -rate @ turn / 2, (w * rate + np.cross(rate, turn)) / 2
    jacobian = back @ (first.angular - other.angular)
    by = (w * jacobian + np.cross(jacobian.T, turn).T) / 2
    drift = (w_rate * rate + w * change + np.cross(change, turn) + np.cross(rate, turn_rate)) / 2
    return turn, by, drift
