"""Forces along lengths: tendons, servos, polynomial springs of joints.

A box has the edges a, b, c, in a fluid of density rho and viscosity beta. Its center moves with u
relative to the fluid, and it rotates with w, both along its own axes. The force and the moment
about the center are, for the first axis and cyclically for the others,

    f = -rho b c |u| u / 2 - 3 pi beta d u,  g = -rho a (b^4 + c^4) |w| w / 64 - pi beta d^3 w,

where d is the mean edge. The first terms are a quadratic drag; its moment integrates the force over
the rotating faces. The second terms are the resistance of a sphere of diameter d (Stokes). The
second derivative of the forces jumps where a velocity changes sign; the first is continuous.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import (
    DOUBLES,
    VANISHING,
    Field,
    Scalars,
    cross,
    from_quaternion,
    product,
    quaternion_product,
    rotate,
    rotate_back,
    rotation_vector,
)
from physics_crosscheck.reference.mechanism.tree import (
    WORLD,
    CablePath,
    Fluid,
    FrameForce,
    Immersed,
    JointForce,
    LinkFrame,
    Tree,
    TreeForce,
    TreeLink,
    Way,
)
from .propagation import Acting, Moving, Placement
from .recursion import Recursion

Line = tuple[Scalars, Scalars]
"""A length, (1, ...), and its derivatives by the velocities (power per unit force), (nv, ...)."""


class Lines:
    """Lengths of a tree's force paths over one number type; the batch is last.

    Args:
        tree: the links.
        recursion: the tree's kinematics over the same numbers.
        field: the number type.
    """

    def __init__(self, tree: Tree, recursion: Recursion, field: Field = DOUBLES) -> None:
        self._tree, self._recursion, self._field = tree, recursion, field
        self._fixed = cache(self._quaternion_of)

    def lines_of(self, ways: list[Way], q: Scalars) -> list[Line]:
        """Return each path's length and derivatives."""
        placements = self._recursion.placements(q)
        poses = self._recursion.poses_of(placements)
        lines: list[Line] = []
        for way in ways:
            if isinstance(way, JointForce):
                lines.append(self._joint(way, q))
            elif isinstance(way, CablePath):
                lines.append(self._cable(way, q, placements, poses))
            elif way.against is None:
                lines.append(self._frame(way, q, placements))
            else:
                lines.append(self._between(way, way.against, q, placements, poses))
        return lines

    def turning(self, way: JointForce[int] | FrameForce[LinkFrame], q: Scalars) -> Scalars:
        """Return the cosine of half the path's angle, (1, ...); s jumps where it changes sign."""
        if isinstance(way, JointForce):
            return self._quaternion(way.joint, q)[:1]
        assert way.against is not None  # otherwise there is no angle
        return self._turn(way.against, way.frame, q)[:1]

    def _joint(self, way: JointForce[int], q: Scalars) -> Line:
        there, batch = self._tree.velocities[way.joint], q.shape[1:]
        row = self._field.array(np.zeros((self._tree.nv, *batch)))
        gear = self._field.array(np.array(way.gear)).reshape(-1, *(1,) * len(batch))
        turn = self._quaternion(way.joint, q)
        rotation = from_quaternion(turn)
        moment = gear[-3:] + 0 * turn[1:]
        moment = rotate_back(rotation, moment) if way.in_parent else moment
        row[there.start : there.start + 3] = moment
        if len(way.gear) == 3:
            return (moment * rotation_vector(turn)).sum(axis=0)[None], row
        row[there.start + 3 : there.stop] = rotate_back(rotation, gear[:3] + 0 * turn[1:])
        return 0 * q[:1], row

    def _quaternion(self, link: int, q: Scalars) -> Scalars:
        here = self._tree.positions[link]
        return q[here.stop - 4 : here.stop]

    def _turn(self, base: LinkFrame, frame: LinkFrame, q: Scalars) -> Scalars:
        """Return the quaternion (4, ...) of a frame in another, continuous in q."""
        back = self._attitude(base, q)
        back = np.concatenate([back[:1], -back[1:]])
        result: Scalars = quaternion_product(back, self._attitude(frame, q))
        return result

    def _attitude(self, mark: LinkFrame, q: Scalars) -> Scalars:
        tall = (4, *(1,) * (q.ndim - 1))
        rotation, link = self._fixed(mark).reshape(tall) + 0 * q[:1], mark.link
        while link != WORLD:
            joint = self._tree.links[link]
            if joint.kind == "hinge":
                half = q[self._tree.positions[link]] / 2
                axis = self._field.array(joint.axis).reshape(3, *(1,) * (q.ndim - 1))
                turn = np.concatenate([self._field.cos(half), axis * self._field.sin(half)])
                rotation = quaternion_product(turn, rotation)
            elif joint.kind != "slide":
                rotation = quaternion_product(self._quaternion(link, q), rotation)
            rotation = quaternion_product(self._fixed(joint).reshape(tall), rotation)
            link = joint.parent
        result: Scalars = rotation
        return result

    def _quaternion_of(self, fixed: LinkFrame | TreeLink) -> Scalars:
        """Return the quaternion of a frame in its parent, (4,)."""
        from scipy.spatial.transform import Rotation  # slow import, not needed by every command

        turn = Rotation.from_matrix(fixed.rotation).as_quat(scalar_first=True)
        return self._field.array(turn)

    def _cable(
        self,
        way: CablePath[LinkFrame],
        q: Scalars,
        placements: list[Placement],
        poses: list[Placement],
    ) -> Line:
        length, on = 0 * q[:1], self._nothing(q)
        for share, marks in way.branches:
            by = self._field.array([share])
            points = [self._marked(mark, poses, q).origin for mark in marks]
            for k in range(len(marks) - 1):
                apart = points[k + 1] - points[k]
                size = ((apart * apart).sum(axis=0) + VANISHING) ** 0.5
                length = length + by * size[None]
                along = by * apart / size
                self._push(on, marks[k + 1], poses, along, None)
                self._push(on, marks[k], poses, -along, None)
        return length, self._recursion.propagate(placements, on)

    def _frame(self, way: FrameForce[LinkFrame], q: Scalars, placements: list[Placement]) -> Line:
        on = self._nothing(q)
        force, moment = self._gear(way, q)
        rotation = self._field.array(way.frame.rotation)
        if way.frame.link != WORLD:
            tall = (1,) * (q.ndim - 1)
            turn = rotation.reshape(3, 3, *tall)
            origin = self._field.array(way.frame.position).reshape(3, *tall)
            along = rotate(turn, force)
            on[way.frame.link] = along, rotate(turn, moment) + cross(origin, along)
        return 0 * q[:1], self._recursion.propagate(placements, on)

    def _between(
        self,
        way: FrameForce[LinkFrame],
        against: LinkFrame,
        q: Scalars,
        placements: list[Placement],
        poses: list[Placement],
    ) -> Line:
        frame, other = (self._marked(mark, poses, q) for mark in (way.frame, against))
        force, moment = self._gear(way, q)
        vector = rotation_vector(self._turn(against, way.frame, q))
        apart = rotate_back(other.rotation, frame.origin - other.origin)
        length = (force * apart + moment * vector).sum(axis=0)[None]
        on = self._nothing(q)
        along, about = rotate(other.rotation, force), rotate(other.rotation, moment)
        self._push(on, way.frame, poses, along, about)
        self._push(on, against, poses, -along, -about)
        row = self._recursion.propagate(placements, on)
        for link in self._above(way.frame.link) & self._above(against.link):
            row[self._tree.velocities[link]] = 0 * row[self._tree.velocities[link]]
        return length, row

    def _above(self, link: int) -> set[int]:
        """Return the indices of a link and its ancestors."""
        indices: set[int] = set()
        while link != WORLD:
            indices.add(link)
            link = self._tree.links[link].parent
        return indices

    def _gear(self, way: FrameForce[LinkFrame], q: Scalars) -> tuple[Scalars, Scalars]:
        gear = self._field.array(np.array(way.gear)).reshape(6, *(1,) * (q.ndim - 1)) + 0 * q[:1]
        return gear[:3], gear[3:]

    def _nothing(self, q: Scalars) -> list[Acting]:
        none = self._field.array(np.zeros((3, *q.shape[1:])))
        return [(none, none) for _ in self._tree.links]

    def _marked(self, mark: LinkFrame, poses: list[Placement], q: Scalars) -> Placement:
        """Return a frame's pose in the world."""
        tall = (1,) * (q.ndim - 1)
        rotation = self._field.array(mark.rotation).reshape(3, 3, *tall) + 0 * q[:1]
        origin = self._field.array(mark.position).reshape(3, *tall) + 0 * q[:1]
        if mark.link == WORLD:
            return Placement(rotation, origin)
        pose = poses[mark.link]
        return Placement(
            product(pose.rotation, rotation), pose.origin + rotate(pose.rotation, origin)
        )

    def _push(
        self,
        on: list[Acting],
        mark: LinkFrame,
        poses: list[Placement],
        force: Scalars,
        moment: Scalars | None,
    ) -> None:
        """Add a force at a frame, and a moment, both along the world's axes."""
        if mark.link == WORLD:
            return
        turn = poses[mark.link].rotation
        local_force = rotate_back(turn, force)
        origin = self._field.array(mark.position).reshape(3, *(1,) * (local_force.ndim - 1))
        about = cross(origin, local_force)
        if moment is not None:
            about = about + rotate_back(turn, moment)
        on[mark.link] = on[mark.link][0] + local_force, on[mark.link][1] + about


class _Line(NamedTuple):
    """A force element's length, (1, ...), and its derivatives by slices of the velocities."""

    element: TreeForce
    length: Scalars
    columns: list[tuple[slice, Scalars]]

    def rate(self, v: Scalars) -> Scalars:
        """Return the rate of the length, (1, ...)."""
        result: Scalars = 0 * v[:1]
        for there, column in self.columns:
            result = result + (column * v[there]).sum(axis=0, keepdims=True)
        return result


class ForceElements:
    """The force elements of a tree over one number type; the batch is last.

    Args:
        tree: the links and force elements.
        recursion: the tree's kinematics over the same numbers.
        field: the number type, which must be ordered.
    """

    def __init__(self, tree: Tree, recursion: Recursion, field: Field = DOUBLES) -> None:
        self._tree, self._field = tree, field
        self._lines = Lines(tree, recursion, field)
        self._ways = [element.along for element in tree.pulls if element.along is not None]

    def __bool__(self) -> bool:
        """Return whether the tree has force elements."""
        return bool(self._tree.pulls)

    def forces(self, q: Scalars, v: Scalars) -> Scalars:
        """Return their forces on the joints, (nv, ...)."""
        out = 0 * v
        for line in self._along(q):
            force = self._force(line, v)
            for there, column in line.columns:
                out[there] = out[there] + column * force
        return out

    def mass(self) -> Scalars:
        """Return the mass matrix of their armatures, (nv, nv)."""
        out = np.zeros((self._tree.nv, self._tree.nv))
        for element in self._tree.pulls:
            column = np.zeros(self._tree.nv)
            for i, share in element.joints:
                column[self._tree.velocities[i].start] += share
            out += element.armature * np.outer(column, column)
        return self._field.array(out)

    def stored(self, q: Scalars) -> Scalars:
        """Return the potential energy of springs and constant forces, joules, (...)."""
        energy: Scalars = 0 * q[0]
        for line in self._along(q):
            element, length = line.element, line.length
            if not _stores(element):
                continue
            energy = energy - (self._number(element.constant) * length).reshape(q.shape[1:])
            x = self._outside(element, length)
            for i, k in enumerate(element.stiffness, start=1):
                energy = energy + (self._number(k / (i + 1)) * x ** (i + 1)).reshape(q.shape[1:])
        return energy

    def dissipated(self, q: Scalars, v: Scalars) -> Scalars:
        """Return the power taken by dampers and non-conservative elements, watts, (...)."""
        power: Scalars = 0 * v[0]
        for line in self._along(q):
            rate = line.rate(v)
            lost = self._damped(line.element, rate) * rate
            if not _stores(line.element):
                lost = -self._force(line, v)
            power = power + (lost * rate).reshape(v.shape[1:])
        return power

    @property
    def nonsmooth(self) -> bool:
        """True if a spring has a dead band, a damper an even power, or a length a jump."""
        return any(
            _plays(element) or _turns(element) or _jumps(element) for element in self._tree.pulls
        )

    def switching_functions(self, q: Scalars, v: Scalars) -> Scalars:
        """Return quantities, (m, ...), that change sign where a force is not smooth.

        These are the deflections at the ends of dead bands, the rates of even-power dampers, and
        the cosines whose zeros make lengths jump.
        """
        values = [0 * v[:0]]
        for line in self._along(q) if self.nonsmooth else ():
            element = line.element
            if _plays(element):
                values += [line.length - self._number(end) for end in element.rest]
            if _turns(element):
                values.append(line.rate(v))
            if _jumps(element):
                assert isinstance(
                    element.along, (JointForce, FrameForce)
                )  # other paths have no angle
                values.append(self._lines.turning(element.along, q))
        return np.concatenate(values)

    def lines(self, q: Scalars) -> Iterator[Line]:
        """Yield each element's length, (1, ...), and its derivatives by velocities, (nv, ...)."""
        for line in self._along(q):
            row = self._field.array(np.zeros((self._tree.nv, *q.shape[1:])))
            for there, column in line.columns:
                row[there] = row[there] + column
            yield line.length, row

    def _along(self, q: Scalars) -> Iterator[_Line]:
        """Yield each element with its length."""
        lines = iter(self._lines.lines_of(self._ways, q) if self._ways else ())
        for element in self._tree.pulls:
            if element.along is not None:
                length, row = next(lines)
                yield _Line(element, length, [(slice(0, self._tree.nv), row)])
                continue
            length, columns = 0 * q[:1], []
            for i, share in element.joints:
                here, there = self._tree.positions[i], self._tree.velocities[i]
                column = self._number(share).reshape(1, *(1,) * (q.ndim - 1))
                length = length + column * q[here]
                columns.append((there, column))
            yield _Line(element, length, columns)

    def _force(self, line: _Line, v: Scalars) -> Scalars:
        """Return F, (1, ...)."""
        element, rate = line.element, line.rate(v)
        force = self._number(element.constant) - self._sprung(element, line.length)
        result: Scalars = force - self._damped(element, rate) * rate
        return result

    def _outside(self, element: TreeForce, length: Scalars) -> Scalars:
        low, high = element.rest
        if low == high:
            result: Scalars = length - self._number(low)
            return result
        over, under = length - self._number(high), length - self._number(low)
        both: Scalars = np.where(over > 0, over, np.where(under < 0, under, 0 * length))
        return both

    def _sprung(self, element: TreeForce, length: Scalars) -> Scalars:
        x, result = self._outside(element, length), 0 * length
        for k in reversed(element.stiffness):
            result = (result + self._number(k)) * x
        return result

    def _damped(self, element: TreeForce, rate: Scalars) -> Scalars:
        """Return the secant damping: the force per unit of rate."""
        result, size = 0 * rate, abs(rate) if len(element.damping) > 1 else rate
        for d in reversed(element.damping):
            result = result * size + self._number(d)
        return result

    def _number(self, value: float) -> Scalars:
        """Return a number as (1,), which broadcasts against every batch."""
        return self._field.array([value])


def _stores(element: TreeForce) -> bool:
    """Return whether an element is conservative: its force acts along its length."""
    return element.along is None or isinstance(element.along, CablePath)


def _jumps(element: TreeForce) -> bool:
    """Return whether the force depends on a rotation vector, which jumps at half a turn."""
    path = element.along
    if not element.stiffness or path is None or isinstance(path, CablePath):
        return False
    if isinstance(path, JointForce):
        return len(path.gear) == 3
    return path.against is not None and any(path.gear[3:])


def _plays(element: TreeForce) -> bool:
    """Return whether the spring has a dead band."""
    return bool(element.stiffness) and element.rest[0] != element.rest[1]


def _turns(element: TreeForce) -> bool:
    """Return whether the damper has even powers, such as w |w| and w |w|^3."""
    return any(element.damping[1::2])


@dataclass(frozen=True)
class DragBox:
    """Pose and coefficients of a box; coefficients of forces and of moments, (3,) each.

    Attributes:
        position, rotation: in the frame of its link.
        drag, turning_drag: factors of a force and a moment at |u| u and |w| w.
        resistance, turning_resistance: the same at u and w.
    """

    position: Scalars
    rotation: Scalars
    drag: Scalars
    resistance: Scalars
    turning_drag: Scalars
    turning_resistance: Scalars

    def place(self, vectors: Scalars) -> tuple[Scalars, Scalars]:
        """Return its position and rotation, shaped to broadcast with a batch of vectors."""
        tall = (1,) * (vectors.ndim - 1)
        return self.position.reshape(3, *tall), self.rotation.reshape(3, 3, *tall)


class Immersion:
    """Fluid forces on a tree over one number type; the batch is last.

    Args:
        tree: the links and immersed boxes.
        recursion: the tree's kinematics over the same numbers.
        field: the number type, which must be ordered.
    """

    def __init__(self, tree: Tree, recursion: Recursion, field: Field = DOUBLES) -> None:
        self._tree, self._recursion, self._field = tree, recursion, field
        self._wind = None
        self._boxes: list[DragBox] = []
        if tree.fluid is not None:
            self._boxes = [drag_box(immersed, tree.fluid, field) for immersed in tree.immersed]
            self._wind = field.array(tree.fluid.wind) if any(tree.fluid.wind) else None

    def __bool__(self) -> bool:
        """Return whether any box is immersed."""
        return bool(self._boxes)

    def forces(self, q: Scalars, v: Scalars) -> Scalars:
        """Return the forces on the joints, (nv, ...)."""
        none = self._field.array(np.zeros((3, *v.shape[1:])))
        on: list[Acting] = [(none, none) for _ in self._tree.links]
        placements = self._recursion.placements(q)
        for immersed, box, moving in self._moving(placements, v):
            force, moment = _dragged(box, moving)
            on[immersed.link] = on[immersed.link][0] + force, on[immersed.link][1] + moment
        return self._recursion.propagate(placements, on)

    @property
    def nonsmooth(self) -> bool:
        """True if there is a quadratic drag."""
        fluid = self._tree.fluid
        return bool(self) and fluid is not None and fluid.density > 0

    def switching_functions(self, q: Scalars, v: Scalars) -> Scalars:
        """Return the velocities whose sign changes make a drag non-smooth, (m, ...)."""
        placements = self._recursion.placements(q)
        moving = self._moving(placements, v) if self.nonsmooth else ()
        return np.concatenate([0 * v[:0], *(part for _, _, motion in moving for part in motion)])

    def _moving(
        self, placements: list[Placement], v: Scalars
    ) -> Iterator[tuple[Immersed, DragBox, Moving]]:
        """Yield each box with the velocity of its center relative to the fluid, in its own axes."""
        links = self._recursion.velocities(placements, v)
        blowing = self._blowing(placements, v)
        for immersed, box in zip(self._tree.immersed, self._boxes, strict=True):
            angular, linear = links[immersed.link]
            if blowing:
                linear = linear - blowing[immersed.link]
            center, turn = box.place(linear)
            linear = linear + cross(angular, center)
            yield immersed, box, Moving(rotate_back(turn, angular), rotate_back(turn, linear))

    def _blowing(self, placements: list[Placement], v: Scalars) -> list[Scalars]:
        """Return the wind in each link's frame, (3, ...); empty without wind."""
        if self._wind is None:
            return []
        wind = self._wind.reshape(3, *(1,) * (v.ndim - 1)) + 0 * v[:1]
        return [rotate_back(pose.rotation, wind) for pose in self._recursion.poses_of(placements)]


def _dragged(box: DragBox, moving: Moving) -> Acting:
    """Return the force on the link at the link's origin, in the link's frame."""
    angular, linear = moving
    tall = (3, *(1,) * (linear.ndim - 1))
    drag, resistance, turning_drag, turning_resistance = (
        coefficients.reshape(tall)
        for coefficients in (box.drag, box.resistance, box.turning_drag, box.turning_resistance)
    )
    center, turn = box.place(linear)
    force = rotate(turn, -(drag * abs(linear) + resistance) * linear)
    moment = rotate(turn, -(turning_drag * abs(angular) + turning_resistance) * angular)
    return force, moment + cross(center, force)


def drag_box(immersed: Immersed, fluid: Fluid, field: Field = DOUBLES) -> DragBox:
    """Return the pose of a box in a fluid, and its coefficients."""
    size: Array = immersed.size
    others = size[[1, 2, 0]], size[[2, 0, 1]]
    mean = size.sum() / 3
    density, viscosity = max(fluid.density, 0.0), max(fluid.viscosity, 0.0)
    return DragBox(
        position=field.array(immersed.position),
        rotation=field.array(immersed.rotation),
        drag=field.array(density / 2 * others[0] * others[1]),
        resistance=field.array(np.full(3, 3 * np.pi * viscosity * mean)),
        turning_drag=field.array(density / 64 * size * (others[0] ** 4 + others[1] ** 4)),
        turning_resistance=field.array(np.full(3, np.pi * viscosity * mean**3)),
    )
