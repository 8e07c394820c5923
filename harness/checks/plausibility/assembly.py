"""Advice about links that do not fit together as drawn: open loops, and shapes that overlap."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import quote
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.results.status import counted, listed
from physics_crosscheck.reference.mechanism.laws import Anchor, SoftEquality
from physics_crosscheck.reference.mechanism.rotations import IDENTITY, Array, Place, from_quaternion
from physics_crosscheck.reference.mechanism.tree import WORLD
from .facts import COMPILED, Advice, RobotFacts, solid_hull
from .hull import Hull

MAX_GAP, MAX_TURN = 0.001, 0.01
"""Largest gap of a closed loop, m, and largest angle between the frames of a weld, rad."""

MIN_DEPTH, DEPTH_SHARE = 0.002, 0.02
"""Depth from which shapes overlap, m, and as a share of the smaller one's diagonal."""

STARTS, MAX_PAIRS = 4, 300
"""Random positions from which a loop is closed; most pairs of shapes that are compared exactly."""

Posed = tuple[str, int, Hull]
"""A shape: its link (empty for the world), its body's index, and its hull in the world."""


def open_loops(facts: RobotFacts) -> Iterator[Advice]:
    """Yield each `connect` and `weld` with a gap as drawn, and the smallest that joints allow."""
    laws = None if facts.compiled is None else facts.compiled.laws
    for equality in () if laws is None else laws.equalities:
        if equality.anchors is None:
            continue
        gap, turn = _gap(facts, equality, facts.drawn)
        if gap <= MAX_GAP and turn <= MAX_TURN:
            continue
        least, least_turn = _smallest(facts, equality)
        names = [_body(facts, anchor) or "the world" for anchor in equality.anchors]
        kind = "connect" if equality.turn_scale is None else "weld"
        measure = f"{1e3 * gap:.3g} mm" + (f" and {turn:.3g} rad" if turn > MAX_TURN else "")
        closed = least <= MAX_GAP and least_turn <= MAX_TURN
        smallest = f"{1e3 * least:.3g} mm" + (f" and {least_turn:.3g} rad" * (turn > MAX_TURN))
        within = f"no position of the joints makes it smaller than {smallest}: correct its frames"
        remedy = "the joints can close it: state a pose that does" if closed else within
        yield Advice(
            kind="loop gap",
            subject=tuple(names),
            message=f"the {kind} of {quote(names[0])} and {quote(names[1])} has a gap of {measure}"
            f" as drawn; {remedy}",
            line=_equality_line(facts, kind, names),
            expected=0.0 if closed else least if gap > MAX_GAP else least_turn,
            actual=gap if gap > MAX_GAP else turn,
            excess=(1 if closed else 1000) * max(gap / MAX_GAP, turn / MAX_TURN),
        )


def _body(facts: RobotFacts, anchor: Anchor) -> str:
    assert facts.compiled is not None
    return facts.compiled.bodies[anchor.body - 1].name if anchor.body > 0 else ""


def _gap(facts: RobotFacts, equality: SoftEquality, q: Array) -> tuple[float, float]:
    """Return the distance of both frames of an equality at a state, m, and their angle, rad."""
    poses, frames = facts.poses_at(q), []
    for anchor in equality.anchors or ():
        index, place = facts.tree.frames.get(_body(facts, anchor), (WORLD, IDENTITY))
        body = place if index == WORLD else poses[index].compose(place)
        frame = Place(from_quaternion(np.array(anchor.turn)), np.array(anchor.position))
        frames.append(body.compose(frame))
    cosine = (np.trace(frames[0].rotation.T @ frames[1].rotation) - 1) / 2
    turn = 0.0 if equality.turn_scale is None else float(np.arccos(np.clip(cosine, -1, 1)))
    return float(np.linalg.norm(frames[0].origin - frames[1].origin)), turn


def _smallest(facts: RobotFacts, equality: SoftEquality) -> tuple[float, float]:
    """Return the smallest gap within the limits of hinges and slides; other joints are held."""
    # Import late: few robots have loops, and it costs a tenth of a worker's start.
    from scipy.optimize import minimize

    names = [link.name for link in facts.tree.links]
    single = [name for name in names if name in facts.rest]
    places = [facts.tree.positions[names.index(name)].start for name in single]
    limits = [facts.joints[name].limits or (-np.pi, np.pi) for name in single]
    weight = equality.turn_scale or 0.0

    def squared(x: Array) -> float:
        q = facts.drawn.copy()
        q[places] = x
        gap, turn = _gap(facts, equality, q)
        return gap**2 + (weight * turn) ** 2

    random = np.random.default_rng(20260101)
    low, high = np.array(limits).reshape(-1, 2).T
    starts = [np.clip(facts.drawn[places], low, high)]
    starts += [random.uniform(low, high) for _ in range(STARTS if single else 0)]
    ends = [
        minimize(squared, x, bounds=limits, method="L-BFGS-B").x if single else x for x in starts
    ]
    q = facts.drawn.copy()
    q[places] = min(ends, key=squared)
    return _gap(facts, equality, q)


def _equality_line(facts: RobotFacts, kind: str, names: Sequence[str]) -> SourceLine:
    """Return the line of the equality of two bodies."""
    for document in facts.documents:
        sites = {site.get("name"): site.parent for site in document.root.iter("site")}
        for element in document.root.findall(f"equality/{kind}"):
            bodies = {_named(element, i, sites) or "the world" for i in "12"}
            if bodies == set(names):
                return SourceLine(file=str(document.path), line=document.line(element))
    return SourceLine(file=str(facts.robot.file), line=None)


def _named(element: XmlElement, i: str, sites: dict[str, XmlElement | None]) -> str:
    body = sites.get(element.get(f"site{i}"))
    return element.get(f"body{i}") or ("" if body is None else body.get("name"))


def overlapping_links(facts: RobotFacts) -> Iterator[Advice]:
    """Yield the pairs of links that overlap as drawn, in one finding, the deepest first."""
    depths: dict[tuple[str, str], float] = {}
    near = ((*pair, _depth(pair[0][2], pair[1][2])) for pair in _near_pairs(facts))
    for first, other, depth in (*near, *_below_planes(facts)):
        size = min(first[2].diagonal, other[2].diagonal)
        if depth > max(MIN_DEPTH, DEPTH_SHARE * size):
            pair = first[0] or "the world", other[0] or "the world"
            depths[pair] = max(depth, depths.get(pair, 0.0))
    if not depths:
        return
    pairs = sorted(depths, key=lambda pair: -depths[pair])
    texts = [f"{one} and {other} by {1e3 * depths[one, other]:.3g} mm" for one, other in pairs]
    worst = next(name for name in pairs[0][::-1] if name != "the world")
    yield Advice(
        kind="overlap",
        subject=tuple(dict.fromkeys(name for pair in pairs for name in pair)),
        message=f"{counted(len(pairs), 'pair')} of links overlap as drawn, meshes by their hulls: "
        f"{listed(texts, 3)}. "
        "Engines that let them touch push them apart at the start. Draw another pose, make the "
        "shapes smaller, or exclude the pairs from contacts",
        line=facts.line("body" if facts.robot.file.suffix == COMPILED else "link", worst),
        expected=0.0,
        actual=depths[pairs[0]],
        excess=depths[pairs[0]] / MIN_DEPTH,
    )


def _below_planes(facts: RobotFacts) -> Iterator[tuple[Posed, Posed, float]]:
    """Yield shapes below planes of the world, with their depths, m."""
    laws = None if facts.compiled is None else facts.compiled.laws
    shapes = [one for one in facts.robot.placed if one.name.startswith("geom:")]
    for i, plane in enumerate(shapes if laws is not None else ()):
        if plane.kind == "plane" and plane.body is None and not plane.visual:
            for j, shape in _posed(facts):
                heights = (shape[2].points - plane.place.origin) @ plane.place.rotation[:, 2]
                if laws is not None and (min(i, j), max(i, j)) in laws.touching:
                    yield ("", WORLD, shape[2]), shape, -float(heights.min())


def _near_pairs(facts: RobotFacts) -> Iterator[tuple[Posed, Posed]]:
    """Yield pairs of shapes that may touch and whose boxes overlap."""
    posed = list(_posed(facts))
    laws = None if facts.compiled is None else facts.compiled.laws
    parents = [link.parent for link in facts.tree.links]
    boxes = [(one[2].points.min(axis=0), one[2].points.max(axis=0)) for _, one in posed]
    count = 0
    for i, j in combinations(range(len(posed)), 2):
        (first, shape), (second, other) = posed[i], posed[j]
        if (boxes[i][0] > boxes[j][1]).any() or (boxes[j][0] > boxes[i][1]).any():
            continue
        a, b = shape[1], other[1]
        if a == b or (laws is not None and (first, second) not in laws.touching):
            continue
        is_joined = (a >= 0 and parents[a] == b) or (b >= 0 and parents[b] == a)
        if laws is None and is_joined:
            continue
        count += 1
        if count <= MAX_PAIRS:
            yield shape, other


def _posed(facts: RobotFacts) -> Iterator[tuple[int, Posed]]:
    """Yield shapes that touch, by their index among those of a compiled file."""
    shapes = facts.robot.placed
    if facts.compiled is not None:
        shapes = tuple(one for one in shapes if one.name.startswith("geom:"))
    for i, shape in enumerate(shapes):
        if not shape.visual:
            place = IDENTITY if shape.body is None else facts.places[shape.body]
            hull = solid_hull(shape, place)
            index = facts.tree.frames.get(shape.body or "", (WORLD, IDENTITY))[0]
            if hull is not None:
                yield i, (shape.body or "", index, hull)


def _depth(first: Hull, other: Hull) -> float:
    """Return the diameter of the largest ball within two hulls, m; 0 if they are apart."""
    from scipy.optimize import linprog

    planes = np.concatenate([first.planes, other.planes])
    rows = np.column_stack([planes[:, :3], np.ones(len(planes))])
    free = [(None, None)] * 3
    ball = linprog([0, 0, 0, -1], A_ub=rows, b_ub=-planes[:, 3], bounds=[*free, (0, None)])
    return 2 * float(ball.x[3]) if ball.status == 0 else 0.0
