"""Advice about links and joints of which the other side is not the mirror image."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from physics_crosscheck.harness.documents.errors import quote
from physics_crosscheck.harness.modelfiles.robot import LinkPart
from physics_crosscheck.reference.mechanism.rotations import Array, Place
from .facts import Advice, RobotFacts, moments, vector_text

MIRROR_MASS, MIRROR_MOMENTS = 0.05, 0.2
"""Relative difference of masses, and of moments, of a left and a right link."""

MIRROR_PLACE, MIRROR_CENTER = 0.002, 0.01
"""Distance of a joint's axis, and of a center of mass, from the mirror image of the other, m."""

MIRROR_SHARE, MIRROR_CENTER_SHARE = 0.02, 0.2
"""The same as shares of the distance of both sides, and of the size of the link."""

SMALL_SHARE = 0.02
"""Share of a body's mass or moments below which one of its links does not matter."""

MIN_PRODUCT, MIRROR_PRODUCTS = 0.03, 0.5
"""Share of a moment from which products matter; their relative difference, as by a lost sign."""

MIRROR_RANGE, MIRROR_NUMBER = 0.05, 0.05
"""Relative difference of ranges, and of damping, friction, forces and gains."""

_SIDES = (
    ("left", "right"), ("Left", "Right"), ("LEFT", "RIGHT"), ("l", "r"), ("L", "R"),
    ("lf", "rf"), ("lh", "rh"), ("LF", "RF"), ("LH", "RH"),
    ("fl", "fr"), ("FL", "FR"), ("hl", "hr"), ("HL", "HR"), ("bl", "br"), ("RL", "RR"),
    ("BL", "BR"), ("rl", "rr"),
)  # fmt: skip
"""Words for both sides in names."""

_OTHER_SIDE = dict(_SIDES) | {right: left for left, right in _SIDES}

_WORDS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+|[^A-Za-z\d]+")


@dataclass(frozen=True, eq=False)
class _Symmetry:
    """The plane of symmetry of a robot as drawn: x = `offset` along `normal`."""

    facts: RobotFacts
    normal: Array
    offset: float

    def image(self, point: Array) -> Array:
        """Return the mirror image of a point."""
        moved: Array = point - 2 * (self.normal @ point - self.offset) * self.normal
        return moved

    @cached_property
    def turned(self) -> Array:
        """Mirror images of directions, (3, 3)."""
        turned: Array = np.eye(3) - 2 * np.outer(self.normal, self.normal)
        return turned

    def is_image(self, first: Array, other: Array, limit: float = MIRROR_PLACE) -> bool:
        """Return whether two points are mirror images, up to a limit or 2 % of their distance."""
        limit = max(limit, MIRROR_SHARE * float(np.linalg.norm(first - other)))
        return float(np.linalg.norm(self.image(first) - other)) <= limit

    def draws_alike(self, name: str, other: str) -> bool:
        """Return whether the shapes or the next links of two links are mirror images as drawn."""
        places = self.facts.places
        if name not in places or other not in places:
            return False
        if not self.is_image(places[name].origin, places[other].origin):
            return False
        pairs = list(self._next(name, other)) or self._middles(name, other)
        return bool(pairs) and all(self.is_image(*pair) for pair in pairs)

    def _next(self, name: str, other: str) -> Iterator[tuple[Array, Array]]:
        model, places = self.facts.robot.body_model, self.facts.places
        for body in () if model is None else model.bodies:
            image = mirrored_name(body.name)
            if body.parent == name and image in places and body.name in places:
                yield places[body.name].origin, places[image].origin

    def _middles(self, name: str, other: str) -> list[tuple[Array, Array]]:
        """Return the middles of the shapes, if these show how the links are turned."""
        middles = []
        for link in (name, other):
            body = next((one for one in self.facts.bodies if link in one.frames), None)
            if body is None or body.whole_hull is None:
                return []
            there = body.frames[link]
            place = self.facts.places[link]
            inside = there.rotation.T @ (body.whole_hull.center - there.origin)
            middles.append(place.transform(inside))
        apart = np.linalg.norm(middles[0] - self.facts.places[name].origin)
        return [(middles[0], middles[1])] if apart > MIRROR_CENTER else []


def _symmetry(facts: RobotFacts) -> _Symmetry | None:
    """Return the plane between most pairs of links; None if fewer than half have one in common."""
    places = facts.places
    pairs = [
        (places[name].origin, places[image].origin)
        for name in places
        if (image := mirrored_name(name)) in places
    ]
    votes: Counter[tuple[int, float]] = Counter()
    for first, other in pairs:
        apart = np.abs(first - other)
        axis = int(np.argmax(apart))
        if apart[axis] > MIRROR_PLACE and apart.sum() - apart[axis] < MIRROR_PLACE:
            votes[axis, round(float(first[axis] + other[axis]) / 2, 2)] += 1
    if not votes:
        return None
    (axis, offset), count = votes.most_common(1)[0]
    base = max(facts.bodies_of(min(one.body for one in facts.robot.parts)), key=_mass)
    place = places[base.name]
    middle = float(place.transform(base.inertia.center)[axis])
    if count == 1 and _mass(base) > 0 and abs(middle - place.origin[axis]) < MIRROR_PLACE:
        offset = middle  # one pair alone tells no plane
    return _Symmetry(facts, np.eye(3)[axis], offset + 0.0) if 2 * count >= len(pairs) else None


def _mass(part: LinkPart) -> float:
    return part.inertia.mass


def mirrored_links(facts: RobotFacts) -> Iterator[Advice]:
    """Yield links on the left whose mass or moments differ from those on the right."""
    parts = {part.name: part for body in facts.bodies for part in body.parts}
    plane = _symmetry(facts)
    for name, part in parts.items():
        other = parts.get(mirrored_name(name))
        if other is None or not (part.inertia.mass and other.inertia.mass):
            continue
        numbers = _unlike_sizes(part, other)
        if not numbers and plane is not None and _is_mirrored(plane, part, other):
            numbers = _unlike_places(plane, part, other)
        if numbers:
            what, there, here, excess = numbers
            yield Advice(
                kind="left and right",
                subject=(name, other.name),
                message=f"links {quote(name)} and {quote(other.name)} have {what}. Mirror one of "
                "them, unless the robot is asymmetric",
                line=facts.inertial_line(other.name if "expected" in what else name),
                expected=there,
                actual=here,
                excess=excess,
            )


_Numbers = tuple[str, float, float, float]
"""Words for two numbers, the expected and the actual one, and how far they are apart."""


def _unlike_sizes(part: LinkPart, other: LinkPart) -> _Numbers | None:
    """Return masses or moments that differ."""
    here, there = (moments(one.inertia.inertia) for one in (part, other))
    masses = part.inertia.mass, other.inertia.mass
    heavy = apart(np.array([masses[0]]), np.array([masses[1]]))
    if heavy > MIRROR_MASS:
        what = f"masses {masses[0]:.4g} and {masses[1]:.4g} kg"
        return what, masses[1], masses[0], heavy / MIRROR_MASS
    turned = apart(here, there)
    if turned > MIRROR_MOMENTS:
        what = f"moments of inertia {vector_text(here)} and {vector_text(there)} kg m^2"
        return what, float(there[-1]), float(here[-1]), turned / MIRROR_MOMENTS
    return None


def _is_mirrored(plane: _Symmetry, part: LinkPart, other: LinkPart) -> bool:
    """Return whether links of some size are drawn as mirror images, with unlike meshes."""
    body = next(one for one in plane.facts.bodies if part.name in one.frames)
    share = part.inertia.mass / body.inertia.mass
    share = min(share, np.abs(part.inertia.inertia).max() / np.abs(body.inertia.inertia).max())
    meshes = [
        {(one.mesh, one.scale) for one in plane.facts.robot.placed if one.mesh and one.body == name}
        for name in (part.name, other.name)
    ]
    is_same_part = bool(meshes[0]) and meshes[0] == meshes[1]
    return share > SMALL_SHARE and not is_same_part and plane.draws_alike(part.name, other.name)


def _unlike_places(plane: _Symmetry, part: LinkPart, other: LinkPart) -> _Numbers | None:
    """Return centers of mass, or products of inertia, that do not mirror."""
    first, second = (plane.facts.places[one.name] for one in (part, other))
    image = second.rotation.T @ (plane.image(first.transform(part.inertia.center)) - second.origin)
    center = other.inertia.center
    size = 2 * np.sqrt(np.trace(part.inertia.inertia) / part.inertia.mass)
    limit = max(MIRROR_CENTER, MIRROR_CENTER_SHARE * float(size))
    off = float(np.linalg.norm(image - center))
    if off > limit:
        what = f"centers of mass that do not mirror: {quote(other.name)} has " + (
            f"{vector_text(center)}, expected {vector_text(image)}"
        )
        worst = int(np.argmax(np.abs(image - center)))
        return what, float(image[worst]), float(center[worst]), off / limit
    turn = second.rotation.T @ plane.turned @ first.rotation
    tensor, stated = turn @ part.inertia.inertia @ turn.T, other.inertia.inertia
    off, largest = apart(tensor, stated), float(np.abs(stated).max())
    crossed = [one - np.diag(np.diagonal(one)) for one in (tensor, stated)]
    if off <= MIRROR_MOMENTS and np.abs(crossed).max() > MIN_PRODUCT * largest:
        off = MIRROR_MOMENTS / MIRROR_PRODUCTS * apart(*crossed)
    if off <= MIRROR_MOMENTS:
        return None
    place = np.unravel_index(np.argmax(np.abs(tensor - stated)), (3, 3))
    products = (vector_text(one[[0, 0, 1], [1, 2, 2]]) for one in (stated, tensor))
    what = "moments of inertia that do not mirror: {} has products {} kg m^2, expected {}"
    what = what.format(quote(other.name), *products)
    return what, float(tensor[place]), float(stated[place]), off / MIRROR_MOMENTS


def apart(first: Array, other: Array) -> float:
    """Return the largest difference, relative to the largest number."""
    scale = max(np.abs(first).max(), np.abs(other).max())
    return float(np.abs(first - other).max() / scale) if scale else 0.0


def mirrored_name(name: str) -> str:
    """Return the name of the same part on the other side, of a name that begins on the left.

    All words for sides change: the mirror image of `front_leftL` is `front_rightR`.
    """
    words = _WORDS.findall(name)
    first = next((word for word in words if word in _OTHER_SIDE), "")
    if first not in dict(_SIDES):
        return ""
    return "".join(_OTHER_SIDE.get(word, word) for word in words)


def mirrored_joints(facts: RobotFacts) -> Iterator[Advice]:
    """Yield joints on the left whose axis, range, damping or drive differs from the right one's."""
    plane, numbers = _symmetry(facts), facts.joint_numbers
    indices = {link.name: index for index, link in enumerate(facts.tree.links)}
    for name, index in indices.items():
        other = mirrored_name(name)
        if other not in indices or name not in facts.rest or other not in facts.rest:
            continue
        unlike = next(_unlike_numbers(numbers.get(name, {}), numbers.get(other, {})), None)
        if unlike is None and plane is not None:
            unlike = _unlike_joints(plane, index, indices[other])
        if unlike is not None:
            what, there, here, excess = unlike
            yield Advice(
                kind="left and right",
                subject=(name, other),
                message=f"joints {quote(name)} and {quote(other)} have {what}. Mirror one of "
                "them, unless the robot is asymmetric",
                line=facts.line("joint", other),
                expected=there,
                actual=here,
                excess=excess,
            )


def _unlike_numbers(here: Mapping[str, float], there: Mapping[str, float]) -> Iterator[_Numbers]:
    """Yield the first of equal quantities that differ, such as damping."""
    for what in [one for one in here if one in there]:
        pair = here[what], there[what]
        off = apart(np.array(pair[:1]), np.array(pair[1:]))
        if off > MIRROR_NUMBER:
            yield f"{what} {pair[0]:g} and {pair[1]:g}", *pair, off / MIRROR_NUMBER


def _unlike_joints(plane: _Symmetry, index: int, other: int) -> _Numbers | None:
    """Return axes or ranges that do not mirror, of joints on bodies that are."""
    facts, links = plane.facts, plane.facts.tree.links
    joints = [facts.joints[links[one].name] for one in (index, other)]
    if joints[0].kind != joints[1].kind or not _carried_alike(plane, index, other):
        return None
    first, second = facts.poses[index], facts.poses[other]
    axes = [place.rotation @ links[i].axis for place, i in ((first, index), (second, other))]
    image, wanted = plane.image(first.origin), plane.turned @ axes[0]
    between = image - second.origin
    off = float(np.linalg.norm(between - (between @ axes[1]) * axes[1]))
    limit = max(MIRROR_PLACE, MIRROR_SHARE * float(np.linalg.norm(first.origin - second.origin)))
    siblings = [facts.poses[i] for i in range(len(links)) if links[i].parent == links[other].parent]
    if any(plane.is_image(first.origin, one.origin) for one in siblings if one is not second):
        return None  # one part is mounted on both sides, so that its joints change places
    if joints[0].kind == "hinge" and off > limit:
        what = f"axes that do not mirror, {1e3 * off:.3g} mm apart: {quote(links[other].name)}"
        what += f" is at {vector_text(second.origin)} in the world, expected {vector_text(image)}"
        return what, 0.0, off, off / limit
    along = float(wanted @ axes[1])
    if abs(along) < 1 - MIRROR_SHARE:
        what = f"axes that do not mirror: {quote(links[other].name)} turns about "
        what += f"{vector_text(axes[1])} in the world, expected {vector_text(wanted)}"
        return what, 1.0, abs(along), 1 / MIRROR_SHARE
    is_same = (along > 0) == (joints[0].kind == "slide")
    return _unlike_ranges(plane, index, other, is_same=is_same)


def _unlike_ranges(plane: _Symmetry, index: int, other: int, *, is_same: bool) -> _Numbers | None:
    """Return ranges that do not mirror, by the directions of both axes."""
    facts, links = plane.facts, plane.facts.tree.links
    names = [links[one].name for one in (index, other)]
    limits, stated = (facts.joints[name].limits for name in names)
    if limits is None or stated is None:
        return None
    here, there = np.array(limits), np.array(stated)
    width = max(float(np.ptp(here)), float(np.ptp(there)))
    if not 0 < width < np.inf:
        return None
    same, negated = (float(np.abs(one - there).max()) / width for one in (here, -here[::-1]))
    carried = [facts.carried.get(name, "") for name in names]
    off = same if is_same else negated
    if min(same, negated) < MIRROR_RANGE and not plane.draws_alike(carried[0], carried[1]):
        return None  # the links are drawn in unlike poses
    if off <= MIRROR_RANGE:
        return None
    wanted = here if is_same else -here[::-1]
    worst = int(np.argmax(np.abs(wanted - there)))
    what = f"ranges that do not mirror: [{vector_text(here)}] and [{vector_text(there)}], "
    what += f"expected [{vector_text(wanted)}] by their axes"
    return what, float(wanted[worst]), float(there[worst]), off / MIRROR_RANGE


def _carried_alike(plane: _Symmetry, index: int, other: int) -> bool:
    """Return whether two joints are on one body, or on bodies that are mirror images as drawn."""
    links = plane.facts.tree.links
    parents = links[index].parent, links[other].parent
    if parents[0] == parents[1]:
        return True
    if min(parents) < 0 or mirrored_name(links[parents[0]].name) != links[parents[1]].name:
        return False
    places: Sequence[Place] = plane.facts.poses
    return plane.is_image(places[parents[0]].origin, places[parents[1]].origin)
