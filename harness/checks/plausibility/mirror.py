"""Advice about links and joints of which the other side is not the mirror image."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache

import numpy as np

from physics_crosscheck.harness.documents.errors import quote
from physics_crosscheck.reference.mechanism.rotations import Array, Place
from .facts import Advice, RobotFacts, moments, vector_text

Row = tuple[str, Array, Array, float]
"""A quantity in words, the expected and the actual numbers, and their difference per limit."""

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

_LEFT_WORDS = ("left", "l", "lf", "lh", "fl", "hl", "bl", "rl")
_RIGHT_WORDS = ("right", "r", "rf", "rh", "fr", "hr", "br", "rr")
_SIDES = {"Left": "Right", **dict(zip(_LEFT_WORDS, _RIGHT_WORDS, strict=True))}
_SIDES |= {left.upper(): right.upper() for left, right in _SIDES.items()}
"""Words for the left side in names, and those for the right side."""

_OTHER_SIDE = _SIDES | {right: left for left, right in _SIDES.items()}

_WORDS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+|[^A-Za-z\d]+")


def mirrored_parts(facts: RobotFacts) -> Iterator[Advice]:
    """Yield links and joints on the left that differ from the mirror images of the right ones.

    Of the quantities in `_link_rows` and `_joint_rows`, the first that differs counts.
    """
    plane = _symmetry(facts)
    joints = [link.name for link in facts.tree.links if link.name in facts.rest]
    for rows, names in ((_link_rows, [*facts.body_of]), (_joint_rows, joints)):
        for name, other in _pairs(frozenset(names)).items():
            unlike = next((row for row in rows(facts, plane, name, other) if row[3] > 1), None)
            if unlike is None:
                continue
            what, expected, actual, excess = unlike
            worst = int(np.argmax(np.abs(expected - actual)))
            is_link = rows is _link_rows
            there = facts.inertial_line(other if "expected" in what else name)
            yield facts.advice(
                "left and right",
                (name, other),
                f"{'links' if is_link else 'joints'} {quote(name)} and {quote(other)} have {what}. "
                "Mirror one of them, unless the robot is asymmetric",
                expected.flat[worst],
                actual.flat[worst],
                excess,
                line=there if is_link else facts.line("joint", other),
            )


def _link_rows(facts: RobotFacts, plane: Place | None, name: str, other: str) -> Iterator[Row]:
    """Yield mass and moments, and those that depend on frames if both links are drawn mirrored."""
    part, image = facts.part(name).inertia, facts.part(other).inertia
    if not (part.mass and image.mass):
        return
    pair = np.array([image.mass]), np.array([part.mass])
    words = f"masses {part.mass:.4g} and {image.mass:.4g} kg"
    yield words, *pair, apart(*pair) / MIRROR_MASS
    here, there = moments(part.inertia), moments(image.inertia)
    words = f"moments of inertia {vector_text(here)} and {vector_text(there)} kg m^2"
    yield words, there[-1:], here[-1:], apart(here, there) / MIRROR_MOMENTS
    if plane is None or not _is_mirrored(facts, plane, name, other):
        return
    first, second = facts.places[name], facts.places[other]
    turn = second.rotation.T @ plane.rotation @ first.rotation
    center = second.rotation.T @ (plane.transform(first.transform(part.center)) - second.origin)
    size = 2 * np.sqrt(np.trace(part.inertia) / part.mass)
    off = float(np.linalg.norm(center - image.center))
    words = f"centers of mass that do not mirror: {quote(other)} has {vector_text(image.center)}, "
    words += f"expected {vector_text(center)}"
    limit = max(MIRROR_CENTER, MIRROR_CENTER_SHARE * float(size))
    yield words, center, image.center, off / limit
    tensor, stated = turn @ part.inertia @ turn.T, image.inertia
    crossed = [one - np.diag(np.diagonal(one)) for one in (tensor, stated)]
    off = apart(tensor, stated) / MIRROR_MOMENTS
    if off <= 1 and np.abs(crossed).max() > MIN_PRODUCT * np.abs(stated).max():
        off = apart(*crossed) / MIRROR_PRODUCTS
    products = [vector_text(one[[0, 0, 1], [1, 2, 2]]) for one in (stated, tensor)]
    words = f"moments of inertia that do not mirror: {quote(other)} has products {products[0]} "
    yield f"{words}kg m^2, expected {products[1]}", tensor, stated, off


def _is_mirrored(facts: RobotFacts, plane: Place, name: str, other: str) -> bool:
    """Return whether links of some size are drawn as mirror images, with unlike meshes."""
    part, body = facts.part(name).inertia, facts.body_of[name].inertia
    largest = np.abs(part.inertia).max() / np.abs(body.inertia).max()
    meshes = [
        {(one.mesh, one.scale) for one in facts.robot.placed if one.mesh and one.body == link}
        for link in (name, other)
    ]
    if min(part.mass / body.mass, largest) <= SMALL_SHARE or meshes[0] == meshes[1] != set():
        return False
    return _draws_alike(facts, plane, name, other)


def _joint_rows(facts: RobotFacts, plane: Place | None, name: str, other: str) -> Iterator[Row]:
    """Yield damping, friction and drives, and axes and ranges of joints on mirrored bodies."""
    numbers, others = facts.joint_numbers.get(name, {}), facts.joint_numbers.get(other, {})
    for what in [one for one in numbers if one in others]:
        pair = np.array([numbers[what]]), np.array([others[what]])
        words = f"{what} {numbers[what]:g} and {others[what]:g}"
        yield words, *pair, apart(*pair) / MIRROR_NUMBER
    kinds = {facts.joints[one].kind for one in (name, other)}
    links = facts.tree.links
    index, there = (next(i for i, e in enumerate(links) if e.name == n) for n in (name, other))
    if plane is None or len(kinds) > 1 or not _is_carried_alike(facts, plane, index, there):
        return
    first, second = facts.poses[index], facts.poses[there]
    axis, image = second.rotation @ links[there].axis, plane.transform(first.origin)
    wanted = plane.rotation @ first.rotation @ links[index].axis
    between = image - second.origin
    off = np.linalg.norm(between - (between @ axis) * axis)
    limit = max(MIRROR_PLACE, MIRROR_SHARE * float(np.linalg.norm(first.origin - second.origin)))
    words = f"axes that do not mirror, {1e3 * off:.3g} mm apart: {quote(other)} is at "
    words += f"{vector_text(second.origin)} in the world, expected {vector_text(image)}"
    yield words, np.zeros(1), np.array([off]), float(off) / limit * (kinds == {"hinge"})
    along = float(wanted @ axis)
    words = f"axes that do not mirror: {quote(other)} turns about {vector_text(axis)} in the "
    words += f"world, expected {vector_text(wanted)}"
    yield words, np.ones(1), np.array([abs(along)]), (1 - abs(along)) / MIRROR_SHARE
    yield from _ranges(facts, plane, (name, other), is_same=(along > 0) == (kinds == {"slide"}))


def _ranges(
    facts: RobotFacts, plane: Place, names: tuple[str, str], *, is_same: bool
) -> Iterator[Row]:
    """Yield the ranges of two joints, by the directions of both axes."""
    here, there = (np.array(facts.joints[one].limits or (0.0, 0.0)) for one in names)
    width = max(float(np.ptp(here)), float(np.ptp(there)))
    if any(facts.joints[one].limits is None for one in names) or not 0 < width < np.inf:
        return
    same, negated = (float(np.abs(one - there).max()) / width for one in (here, -here[::-1]))
    carried = {joint.name: link.name for link in facts.links for joint in link.joints}
    links = [carried.get(name, "") for name in names]
    if min(same, negated) < MIRROR_RANGE and not _draws_alike(facts, plane, *links):
        return  # the links are drawn in unlike poses
    wanted, off = (here, same) if is_same else (-here[::-1], negated)
    words = f"ranges that do not mirror: [{vector_text(here)}] and [{vector_text(there)}], "
    words += f"expected [{vector_text(wanted)}] by their axes"
    yield words, wanted, there, off / MIRROR_RANGE


def _is_carried_alike(facts: RobotFacts, plane: Place, index: int, other: int) -> bool:
    """Return whether joints are on one body, or on bodies that are mirror images as drawn."""
    links, poses = facts.tree.links, facts.poses
    here, there = links[index].parent, links[other].parent
    if here != there:
        pairs = _pairs(frozenset(link.name for link in links))
        is_pair = min(here, there) >= 0 and pairs.get(links[here].name) == links[there].name
        if not (is_pair and _is_image(plane, poses[here].origin, poses[there].origin)):
            return False
    # One part may be mounted on both sides, so that its joints change places.
    siblings = [i for i, link in enumerate(links) if link.parent == there and i != other]
    return not any(_is_image(plane, poses[index].origin, poses[i].origin) for i in siblings)


def apart(first: Array, other: Array) -> float:
    """Return the largest difference, relative to the largest number."""
    scale = max(np.abs(first).max(), np.abs(other).max())
    return float(np.abs(first - other).max() / scale) if scale else 0.0


@lru_cache(maxsize=16)
def _pairs(names: frozenset[str]) -> Mapping[str, str]:
    """Return the names of parts on the left, each with that of the same part on the other side.

    All words for sides change: the mirror image of `front_leftL` is `front_rightR`. If only
    one side has such words, in two names or more, the names without them are the other side.
    """
    words = {name: _WORDS.findall(name) for name in sorted(names)}
    sided = {name: first for name in words if (first := _first_side(words[name]))}
    if len(sided) > 1 and len({first in _SIDES for first in sided.values()}) == 1:
        plain = {_without_side(words[name]): name for name in words if name not in sided}
        bare = {name: _without_side(words[name]) for name in sided}
        is_whole = {*bare.values()} <= {*plain}
        return {name: plain[part] for name, part in bare.items()} if is_whole else {}
    images = {name: "".join(_OTHER_SIDE.get(one, one) for one in words[name]) for name in sided}
    return {name: to for name, to in images.items() if sided[name] in _SIDES and to in names}


def _without_side(words: Iterable[str]) -> str:
    return "_".join(one for one in words if one.isalnum() and one not in _OTHER_SIDE)


def _first_side(words: Iterable[str]) -> str:
    return next((word for word in words if word in _OTHER_SIDE), "")


def _symmetry(facts: RobotFacts) -> Place | None:
    """Return a mirror between most pairs of links; None if fewer than half have one in common."""
    places = facts.places
    pairs = [
        (places[name].origin, places[image].origin)
        for name, image in _pairs(frozenset(places)).items()
    ]
    votes: Counter[tuple[int, float]] = Counter()
    for first, other in pairs:
        off = np.abs(first - other)
        axis = int(np.argmax(off))
        if off[axis] > MIRROR_PLACE and off.sum() - off[axis] < MIRROR_PLACE:
            votes[axis, round(float(first[axis] + other[axis]) / 2, 2)] += 1
    if not votes or 2 * max(votes.values()) < len(pairs):
        return None
    (axis, offset), count = votes.most_common(1)[0]
    index = min(one.body for one in facts.robot.parts)
    parts = [part for part in facts.robot.parts if part.body == index]
    base = max(parts, key=lambda part: part.inertia.mass)
    place = places[base.name]
    middle = float(place.transform(base.inertia.center)[axis])
    if count == 1 and base.inertia.mass > 0 and abs(middle - place.origin[axis]) < MIRROR_PLACE:
        offset = middle  # one pair alone tells no plane
    normal = np.eye(3)[axis]
    return Place(np.eye(3) - 2 * np.outer(normal, normal), 2 * offset * normal)


def _is_image(plane: Place, first: Array, other: Array) -> bool:
    """Return whether two points are mirror images, up to a limit or 2 % of their distance."""
    limit = max(MIRROR_PLACE, MIRROR_SHARE * float(np.linalg.norm(first - other)))
    return float(np.linalg.norm(plane.transform(first) - other)) <= limit


def _draws_alike(facts: RobotFacts, plane: Place, name: str, other: str) -> bool:
    """Return whether the shapes or the next links of two links are mirror images as drawn."""
    places, bodies = facts.places, facts.body_of
    if name not in places or other not in places:
        return False
    start = places[name].origin
    images = _pairs(frozenset(places))
    pairs = [
        (places[link.name].origin, places[images[link.name]].origin)
        for link in facts.links
        if link.parent == name and link.name in images
    ]
    hulls = [bodies[one].whole_hull if one in bodies else None for one in (name, other)]
    if not pairs and hulls[0] is not None and hulls[1] is not None:
        poses = [facts.poses[bodies[one].parts[0].body] for one in (name, other)]
        middles = [poses[i].transform(hull.center) for i, hull in enumerate(hulls) if hull]
        if np.linalg.norm(middles[0] - start) > MIRROR_CENTER:  # or they don't show the rotation
            pairs = [(middles[0], middles[1])]
    pairs = [(start, places[other].origin), *pairs] if pairs else []
    return bool(pairs) and all(_is_image(plane, *pair) for pair in pairs)
