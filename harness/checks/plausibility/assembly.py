"""Advice about links that do not fit together as drawn: open loops, and shapes that overlap."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from physics_crosscheck.harness.documents.errors import quote
from physics_crosscheck.harness.modelfiles.robot import PlacedShape
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.results.status import counted, listed
from physics_crosscheck.reference.mechanism.laws import Anchor, SoftEquality
from physics_crosscheck.reference.mechanism.rotations import IDENTITY, Array, Place, from_quaternion
from physics_crosscheck.reference.mechanism.tree import WORLD
from .facts import COMPILED, Advice, RobotFacts, line_of, solid_hull
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
    for equality in () if facts.laws is None else facts.laws.equalities:
        gap, turn = _gap(facts, equality, facts.drawn)
        if gap <= MAX_GAP and turn <= MAX_TURN:
            continue
        least, least_turn = _smallest(facts, equality)
        names = tuple(_body(facts, anchor) or "the world" for anchor in equality.anchors or ())
        kind = "connect" if equality.turn_scale is None else "weld"
        is_turned, can_close = turn > MAX_TURN, least <= MAX_GAP and least_turn <= MAX_TURN
        measure, smallest = (
            f"{1e3 * far:.3g} mm" + f" and {angle:.3g} rad" * is_turned
            for far, angle in ((gap, turn), (least, least_turn))
        )
        within = f"no position of the joints makes it smaller than {smallest}: correct its frames"
        remedy = "the joints can close it: state a pose that does" if can_close else within
        message = f"the {kind} of {quote(names[0])} and {quote(names[1])} has a gap of {measure} "
        expected, actual = (least, gap) if gap > MAX_GAP else (least_turn, turn)
        yield facts.advice(
            "loop gap",
            names,
            f"{message}as drawn; {remedy}",
            0.0 if can_close else expected,
            actual,
            (1 if can_close else 1000) * max(gap / MAX_GAP, turn / MAX_TURN),
            line=_equality_line(facts, kind, names),
        )


def _body(facts: RobotFacts, anchor: Anchor) -> str:
    assert facts.compiled is not None
    return facts.compiled.bodies[anchor.body - 1].name if anchor.body > 0 else ""


def _gap(facts: RobotFacts, equality: SoftEquality, q: Array) -> tuple[float, float]:
    """Return the distance of both frames of an equality at a state, m, and their angle, rad."""
    if equality.anchors is None:
        return 0.0, 0.0
    poses = facts.poses_at(q)
    first, second = (
        facts.place(_body(facts, anchor), poses).compose(
            Place(from_quaternion(np.array(anchor.turn)), np.array(anchor.position))
        )
        for anchor in equality.anchors
    )
    cosine = (np.trace(first.rotation.T @ second.rotation) - 1) / 2
    turn = 0.0 if equality.turn_scale is None else float(np.arccos(np.clip(cosine, -1, 1)))
    return float(np.linalg.norm(first.origin - second.origin)), turn


def _smallest(facts: RobotFacts, equality: SoftEquality) -> tuple[float, float]:
    """Return the smallest gap within the limits of hinges and slides; others move anywhere."""
    # Import late: few robots have loops, and it costs a tenth of a worker's start.
    from scipy.optimize import minimize

    limits: dict[int, tuple[float, float]] = {}
    for link, part in zip(facts.tree.links, facts.tree.positions, strict=True):
        if link.name in facts.rest:
            limits[part.start] = facts.joints[link.name].limits or (-np.pi, np.pi)
        else:
            limits |= dict.fromkeys(range(part.start, part.stop), (-np.inf, np.inf))
    places = list(limits)
    weight = equality.turn_scale or 0.0

    def squared(x: Array) -> float:
        q = facts.drawn.copy()
        q[places] = x
        gap, turn = _gap(facts, equality, q)
        return gap**2 + (weight * turn) ** 2

    random = np.random.default_rng(20260101)
    low, high = np.array(list(limits.values())).reshape(-1, 2).T
    drawn, is_free = facts.drawn[places], np.isinf(low)
    ends = [np.clip(drawn, low, high)]
    if places:
        around = np.where(is_free, drawn - 0.5, low), np.where(is_free, drawn + 0.5, high)
        ends += [random.uniform(*around) for _ in range(STARTS)]
        bounds = list(limits.values())
        ends = [minimize(squared, x, bounds=bounds, method="L-BFGS-B").x for x in ends]
    q = facts.drawn.copy()
    q[places] = min(ends, key=squared)
    return _gap(facts, equality, q)


def _equality_line(facts: RobotFacts, kind: str, names: Sequence[str]) -> SourceLine:
    for root in facts.roots:
        sites = {site.get("name"): site.parent for site in root.iter("site")}
        for element in root.findall(f"equality/{kind}"):
            bodies = set()
            for i in "12":
                body = sites.get(element.get(f"site{i}"))
                by_site = "" if body is None else body.get("name")
                bodies.add(element.get(f"body{i}") or by_site or "the world")
            if bodies == set(names):
                return line_of(element)
    return SourceLine(file=str(facts.robot.file))


def overlapping_links(facts: RobotFacts) -> Iterator[Advice]:
    """Yield the pairs of links that overlap as drawn, in one finding, the deepest first."""
    depths: dict[tuple[str, str], float] = {}
    for first, other, depth in (*_near_pairs(facts), *_below_planes(facts)):
        size = min(first[2].diagonal, other[2].diagonal)
        if depth > max(MIN_DEPTH, DEPTH_SHARE * size):
            pair = first[0] or "the world", other[0] or "the world"
            depths[pair] = max(depth, depths.get(pair, 0.0))
    if not depths:
        return
    pairs = sorted(depths, key=lambda pair: -depths[pair])
    texts = [f"{one} and {other} by {1e3 * depths[one, other]:.3g} mm" for one, other in pairs]
    worst = next(name for name in pairs[0][::-1] if name != "the world")
    depth = depths[pairs[0]]
    message = (
        f"{counted(len(pairs), 'pair')} of links overlap as drawn, meshes by their hulls: "
        f"{listed(texts, 3)}. "
        "Engines that let them touch push them apart at the start. Draw another pose, make the "
        "shapes smaller, or exclude the pairs from contacts"
    )
    names = tuple(dict.fromkeys(name for pair in pairs for name in pair))
    line = facts.line("body" if facts.robot.file.suffix == COMPILED else "link", worst)
    yield facts.advice("overlap", names, message, 0.0, depth, depth / MIN_DEPTH, line=line)


def _below_planes(facts: RobotFacts) -> Iterator[tuple[Posed, Posed, float]]:
    """Yield shapes below planes of the world, with their depths, m."""
    for i, plane in enumerate(() if facts.laws is None else _shapes(facts)):
        if plane.kind == "plane" and plane.body is None and not plane.visual:
            for j, shape in _posed(facts):
                heights = (shape[2].points - plane.place.origin) @ plane.place.rotation[:, 2]
                if facts.laws is not None and (min(i, j), max(i, j)) in facts.laws.touching:
                    yield ("", WORLD, shape[2]), shape, -float(heights.min())


def _near_pairs(facts: RobotFacts) -> Iterator[tuple[Posed, Posed, float]]:
    """Yield pairs of shapes that may touch and whose boxes overlap, with their depths, m."""
    parents = [link.parent for link in facts.tree.links]
    count = 0
    for (i, shape), (j, other) in combinations(_posed(facts), 2):
        (_, a, hull), (_, b, near) = shape, other
        is_joined = (a >= 0 and parents[a] == b) or (b >= 0 and parents[b] == a)
        may_touch = not is_joined if facts.laws is None else (i, j) in facts.laws.touching
        if a != b and may_touch and count < MAX_PAIRS and hull.is_near(near):
            count += 1
            yield shape, other, _depth(hull, near)


def _shapes(facts: RobotFacts) -> Sequence[PlacedShape]:
    """Return all shapes, in the order of a compiled file."""
    placed = facts.robot.placed
    return [one for one in placed if facts.compiled is None or one.name.startswith("geom:")]


def _posed(facts: RobotFacts) -> Iterator[tuple[int, Posed]]:
    """Yield shapes that touch, by their index among `_shapes`."""
    for i, shape in enumerate(_shapes(facts)):
        link = shape.body or ""
        hull = None if shape.visual else solid_hull(shape, facts.place(link, facts.poses))
        if hull is not None:
            yield i, (link, facts.tree.frames.get(link, (WORLD, IDENTITY))[0], hull)


def _depth(first: Hull, other: Hull) -> float:
    """Return the diameter of the largest ball within two hulls, m; 0 if they are apart."""
    from scipy.optimize import linprog

    planes = np.concatenate([first.planes, other.planes])
    rows = np.column_stack([planes[:, :3], np.ones(len(planes))])
    free = [(None, None)] * 3
    ball = linprog([0, 0, 0, -1], A_ub=rows, b_ub=-planes[:, 3], bounds=[*free, (0, None)])
    return 2 * float(ball.x[3]) if ball.status == 0 else 0.0
