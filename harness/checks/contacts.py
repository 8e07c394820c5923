"""Contacts that an engine finds, against the shapes of the file.

Where primitive shapes overlap and the file lets them touch, a contact must exist. Depth, normal and
point of pairs with a closed form are compared with it, others with the gap along their normal.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.urdf import read_urdf
from physics_crosscheck.harness.engines.protocol import WholeState
from physics_crosscheck.harness.modelfiles.mjcf.misread import MisreadNumber
from physics_crosscheck.harness.modelfiles.robot import PlacedShape, Robot
from physics_crosscheck.reference.laws.mechanics import Posture
from physics_crosscheck.reference.laws.solids import KINDS, ROUND, Solid, distance, gap, overlap
from physics_crosscheck.reference.laws.step import LawModel
from physics_crosscheck.reference.mechanism.laws import (
    ContactPoint,
    ImpulseContact,
    ImpulseRules,
    Rules,
    SoftRules,
)
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import IDENTITY, Place
from physics_crosscheck.reference.mechanism.tree import WORLD, Tree
from .law_comparison import Evaluated, LawComparison
from .law_states import MAX_CONTACTS

EXACT, ROUGH = 1e-9, 1e-3
"""Largest error of a distance relative to the shapes: in closed form, and by iteration."""

MIN_TILT = 1e-7
"""Tilt below which an engine may take a cylinder for one that stands, rad.

A box may lie if a cosine is that close to 1 (FCL's `halfspaceIntersectTolerance`).
"""

FLAT = {"box", "capsule", "sphere"}
"""Kinds whose supporting planes bound a contact to the last digits."""

NORMAL, POINT = 1e-6, 1e-8
"""Largest error in closed form of a normal, rad, and of a point relative to the shapes."""

SMALLER = 0.9
"""Factor of the smaller shape that must still overlap where a contact by iteration is missing."""

PLACED, DEPTHS = 16, (0.2, 0.01)
"""Number of shapes that are put onto others, and their depths, as shares of the smaller one."""

_INEXACT = "exact depths, normals and points by the file, of contacts without a closed form"

Pair = tuple[int, int]


@dataclass(frozen=True, kw_only=True, eq=False)
class TouchingShape:
    """A shape that may touch.

    Attributes:
        surface: index that contacts refer to; several shapes of a link may share one.
        link, place: index of the tree's link, or `WORLD`, and its frame there.
        shape: of the file; None for a floor that the file does not have.
    """

    surface: int
    link: int
    place: Place
    shape: PlacedShape | None

    def in_world(self, posture: Posture) -> Solid:
        """Return the shape at a state."""
        rotation, origin = self.place.rotation, self.place.origin
        if self.link != WORLD:
            pose = posture.poses[self.link]
            rotation, origin = pose.rotation @ rotation, pose.origin + pose.rotation @ origin
        kind, size = ("plane", ()) if self.shape is None else (self.shape.kind, self.shape.size)
        return Solid(kind=kind, size=size, rotation=rotation, origin=origin)


@dataclass(frozen=True, kw_only=True)
class ContactCheck:
    """The comparison of contacts at all states.

    Attributes:
        judged: number of contacts that are compared.
        unjudged: number of contacts by the reason why they are not.
        faults: the worst one of each pair and kind.
        counts: pairs with another number of contacts in another engine, one sentence each.
    """

    judged: int
    unjudged: Mapping[str, int]
    faults: tuple[MisreadNumber, ...]
    counts: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class TouchingShapes:
    """The shapes of a file and the pairs of them that may touch.

    Attributes:
        shapes: with closed forms.
        allowed: pairs of surfaces, in order.
        unknown: surfaces with other shapes; their contacts are not judged.
    """

    shapes: tuple[TouchingShape, ...]
    allowed: frozenset[Pair]
    unknown: frozenset[int] = frozenset()

    @cached_property
    def pairs(self) -> list[Pair]:
        """Indices of the shapes of each pair that may touch, by their surfaces in order."""
        by_surface: dict[int, list[int]] = {}
        for i, shape in enumerate(self.shapes):
            by_surface.setdefault(shape.surface, []).append(i)
        judged = (pair for pair in sorted(self.allowed) if not self.unknown & set(pair))
        return [
            (i, j)
            for first, other in judged
            for i in by_surface.get(first, ())
            for j in by_surface.get(other, ())
        ]

    def near(self, solids: Sequence[Solid], margins: Array) -> Iterator[Pair]:
        """Yield the pairs whose bounding spheres are about within their margins."""
        if not self.pairs:
            return
        places = np.array(self.pairs)
        centers, extent = np.array([s.origin for s in solids]), np.array([s.extent for s in solids])
        axes, flat = np.array([s.axis for s in solids]), np.isinf(extent)
        apart = centers[places[:, 1]] - centers[places[:, 0]]
        far = np.linalg.norm(apart, axis=1) - extent[places].sum(axis=1)
        for k, sign in ((0, 1.0), (1, -1.0)):
            ground, above = places[:, k], places[:, 1 - k]
            height = sign * np.sum(axes[ground] * apart, axis=1) - extent[above]
            far = np.where(flat[ground] & ~flat[above], height, far)
        slack = ROUGH * np.min(extent[places], axis=1)
        near = np.isfinite(slack) & (far - slack < margins)  # two planes never touch
        yield from (self.pairs[k] for k in np.flatnonzero(near))


def shapes_of_laws(placed: Sequence[PlacedShape], laws: LawModel) -> TouchingShapes:
    """Return the shapes of a compiled file: surfaces are its geoms, by index."""
    frames = laws.tree.tree.frames
    geoms = [one for one in placed if one.name.startswith("geom:")]
    shapes = [
        TouchingShape(surface=i, link=link, place=frame.compose(one.place), shape=one)
        for i, one in enumerate(geoms)
        for link, frame in [(WORLD, IDENTITY) if one.body is None else frames[one.body]]
        if one.kind in KINDS
    ]
    return TouchingShapes(
        shapes=tuple(shapes),
        allowed=laws.laws.touching,
        unknown=frozenset(range(len(laws.laws.surfaces))) - {one.surface for one in shapes},
    )


def shapes_of_urdf(robot: Robot, tree: Tree, rules: Rules, floor: float | None) -> TouchingShapes:
    """Return the shapes of a URDF in an engine that touches them by rules of its own."""
    file = read_urdf(Document(robot.file))
    numbers = dict(_surfaces(robot, rules))
    shapes = [
        TouchingShape(
            surface=numbers[one.name], link=link, place=frame.compose(one.place), shape=one
        )
        for one in robot.placed
        if one.name in numbers and one.kind in KINDS and one.body is not None
        for link, frame in [tree.frames[one.body]]
    ]
    links = {one.surface: str(one.shape and one.shape.body) for one in shapes}
    elements = Counter(
        name
        for link in file.links.values()
        for name in [link.element.get("name", "")]
        for _ in link.element.findall("collision")
    )
    placed = Counter(one.shape.body for one in shapes if one.shape is not None)
    unknown = set(numbers.values()) - set(links)
    ground = floor is not None
    if floor is not None:
        unknown.discard(0)
        up = Place(np.eye(3), np.array([0.0, 0.0, floor]))
        shapes.insert(0, TouchingShape(surface=0, link=WORLD, place=up, shape=None))
    if isinstance(rules, ImpulseRules):  # one surface for all shapes of a link
        unknown |= {i for i, name in links.items() if elements[name] != placed[name]}
        allowed = {(0, i) for i in links} if ground else set()
    elif isinstance(rules, SoftRules):
        allowed = set(rules.laws.touching)
    else:
        if rules.filters:
            unknown |= set(links)  # the file filters more pairs than joints do
        joined = {frozenset((one.parent, one.child)) for one in file.joints.values()}
        allowed = {
            (i, j)
            for (i, first), (j, other) in combinations(sorted(links.items()), 2)
            if tree.frames[first][0] != tree.frames[other][0]
            and frozenset((first, other)) not in joined
        } | {(0, i) for i in links if ground}
    return TouchingShapes(
        shapes=tuple(shapes), allowed=frozenset(allowed), unknown=frozenset(unknown)
    )


def _surfaces(robot: Robot, rules: Rules) -> Iterator[tuple[str, int]]:
    """Yield names of shapes with the index of their surface."""
    if isinstance(rules, SoftRules):
        yield from ((name, i) for i, name in enumerate(rules.shapes) if name)
        return
    solid = [one for one in robot.placed if not one.visual]
    if isinstance(rules, ImpulseRules):
        yield from ((one.name, rules.bodies.index(one.body or "")) for one in solid)
        return
    file = read_urdf(Document(robot.file))
    for i, (link, index) in enumerate(rules.shapes, start=1):
        drawn = len(file.links[link].element.findall("visual"))
        yield f"collision:{link}#{drawn + index}", i


def check_contacts(
    touching: TouchingShapes, comparison: LawComparison, evaluated: Sequence[Evaluated]
) -> ContactCheck:
    """Compare the contacts of an engine with the shapes of the file."""
    judge = _Judge(touching, comparison)
    for sample in evaluated:
        judge.add(sample.solution.posture, sample.state, sample.engine.contacts)
    states = list(_placed_states(touching, comparison)) if evaluated else []
    for state, posture in zip(states, comparison.postures(states) if states else (), strict=True):
        contacts = comparison.model.contacts(state)
        if len(contacts) <= MAX_CONTACTS:
            judge.add(posture, state, contacts)
    return judge.result()


def _placed_states(touching: TouchingShapes, comparison: LawComparison) -> Iterator[WholeState]:
    """Yield states in which a shape of a floating tree is put onto one that it may touch."""
    tree, start = comparison.laws.tree.tree, next(iter(comparison.model.starts))
    posture, roots = next(comparison.postures([start])), list[int]()
    for i, link in enumerate(tree.links):
        roots.append(i if link.parent == WORLD else roots[link.parent])
    placed = set[int]()
    for i, j in touching.pairs:
        for below, above in ((i, j), (j, i)):
            lower, upper = (touching.shapes[k] for k in (below, above))
            root = WORLD if upper.link == WORLD else roots[upper.link]
            floats = root != WORLD and tree.links[root].kind == "free"
            if not floats or above in placed or len(placed) == PLACED:
                continue
            if lower.link != WORLD and roots[lower.link] == root:
                continue
            placed.add(above)
            first = tree.velocities[root].start + 3
            for depth in DEPTHS:
                z = start.z.copy()
                moved = _onto(lower.in_world(posture), upper.in_world(posture), depth)
                z[comparison.order[first : first + 3]] += moved
                yield start._replace(z=z)


class _Expected(NamedTuple):
    """A contact by the shapes; unless `exact`, the distance is the least one along a normal."""

    distance: float
    normal: Array | None
    exact: bool
    error: float


class _Judge:
    """Counts and worst faults of contacts, state by state."""

    def __init__(self, touching: TouchingShapes, comparison: LawComparison) -> None:
        self._touching, self._model, self._laws = touching, comparison.model, comparison.laws
        self._surfaces = [one.surface for one in touching.shapes]
        self._margins = np.array([self._margin(i, j) for i, j in touching.pairs])
        self._judged, self._unjudged = 0, Counter[str]()
        self._worst: dict[tuple[Pair, str], tuple[float, str]] = {}
        self._count = Counter[tuple[Pair, str]]()
        self._counts: dict[Pair, Counter[Pair]] = {}

    def _margin(self, i: int, j: int) -> float:
        laws = self._laws
        if not isinstance(laws, LawModel) or not laws.laws.surfaces:
            return 0.0
        return laws.parameters(self._surfaces[i], self._surfaces[j]).margin

    def add(self, posture: Posture, state: WholeState, contacts: Sequence[ContactPoint]) -> None:
        """Compare the contacts at a state."""
        touching = self._touching
        if self._model.peer:
            self._compare(contacts, self._model.peer_contacts(state))
        solids = [one.in_world(posture) for one in touching.shapes]
        touches: dict[Pair, list[ContactPoint]] = {}
        for contact in contacts:
            low, high = sorted(contact.surfaces)
            if touching.unknown & {low, high}:
                if not self._model.peer:
                    self._unjudged["contacts of meshes and other shapes without a closed form"] += 1
            elif (low, high) not in touching.allowed:
                self._note((low, high), "exists, although the file excludes it", 1.0)
            else:
                touches.setdefault((low, high), []).append(contact)
        margins = dict(zip(touching.pairs, self._margins, strict=True))
        near: dict[Pair, list[Pair]] = {}
        for i, j in touching.near(solids, self._margins + self._model.shape_error):
            near.setdefault((self._surfaces[i], self._surfaces[j]), []).append((i, j))
        for surfaces in {**near, **touches}:
            pairs = [(solids[i], solids[j]) for i, j in near.get(surfaces, ())]
            margin = max((margins[one] for one in near.get(surfaces, ())), default=0.0)
            if surfaces not in touches:
                self._judge_absence(surfaces, pairs, margin)
            else:
                self._judge_contacts(surfaces, pairs, touches[surfaces])

    def _compare(self, contacts: Sequence[ContactPoint], others: Sequence[ContactPoint]) -> None:
        """Compare contacts with those of another engine: numbers, and depths of unknown shapes."""
        sides = [dict[Pair, list[float]](), dict[Pair, list[float]]()]
        for depths, points in zip(sides, (contacts, others), strict=True):
            for contact in points:
                low, high = sorted(contact.surfaces)
                if contact.distance < 0:
                    depths.setdefault((low, high), []).append(contact.distance)
        for pair in dict.fromkeys((*sides[0], *sides[1])):
            mine, theirs = (depths.get(pair, [0.0]) for depths in sides)
            if pair in sides[0] and pair in sides[1] and len(mine) != len(theirs):
                self._counts.setdefault(pair, Counter())[len(mine), len(theirs)] += 1
            if self._touching.unknown & set(pair):
                self._judged += len(sides[0].get(pair, ()))
                off = min(mine) - min(theirs)
                if abs(off) > ROUGH * (1 + abs(min(theirs))):
                    words = f"{min(mine):.6g} m in the engine, {min(theirs):.6g} m in"
                    words = f"{words} {self._model.peer}"
                    self._note(pair, "has another distance", abs(off), words)

    def _judge_absence(
        self, surfaces: Pair, pairs: Sequence[tuple[Solid, Solid]], margin: float
    ) -> None:
        """Judge that two surfaces do not touch."""
        for first, other in pairs:
            expected = self._expected(first, other, first.axis)
            if expected.exact and expected.distance < margin - expected.error:
                words = f"the shapes are {-expected.distance:.3g} m deep"
                self._note(surfaces, "is missing", 1.0, words)
            elif not expected.exact and overlap(*_shrunk(first, other)):
                self._note(surfaces, "is missing", 1.0, "the shapes overlap")

    def _judge_contacts(
        self, surfaces: Pair, pairs: Sequence[tuple[Solid, Solid]], contacts: Sequence[ContactPoint]
    ) -> None:
        """Judge the contacts of two surfaces, the deepest one by its depth."""
        deepest = min(contacts, key=lambda one: one.distance)
        self._judged += len(contacts)
        if not pairs:
            # Some engines find contacts before touch.
            if deepest.distance < 0:
                self._note(surfaces, "exists, although the shapes are apart", 1.0)
            return
        sign = 1.0 if deepest.surfaces == surfaces else -1.0
        rows = [self._expected(*pair, sign * deepest.frame[0]) for pair in pairs]
        k = min(range(len(rows)), key=lambda i: rows[i].distance)
        expected, size = rows[k], _size(*pairs[k])
        off = expected.distance - deepest.distance
        if (abs(off) if expected.exact else off) > expected.error:
            sizes = deepest.distance, expected.distance
            words = "{:.6g} m in the engine, {:.6g} m by the file's shapes".format(*sizes)
            self._note(surfaces, "has another distance", abs(off) / size, words)
        elif expected.exact:
            # Of a capsule or a cylinder, ends that are less deep lie inside.
            flat = {one.kind for one in pairs[k]} == {"plane", "box"}
            for contact in contacts if flat else (deepest,):
                # Surfaces of several shapes do not name the one that touches.
                share = self._model.point_share
                away = [_off_surface(*pair, contact, surfaces, share) for pair in pairs]
                near = k if away[k] == min(away) else away.index(min(away))
                self._judge_place(surfaces, pairs[near], contact, rows[near], away[near])
        else:
            self._unjudged[_INEXACT] += len(contacts)

    def _judge_place(
        self,
        surfaces: Pair,
        pair: tuple[Solid, Solid],
        contact: ContactPoint,
        expected: _Expected,
        off: float,
    ) -> None:
        """Judge the normal and the point of a contact of two shapes with a closed form."""
        slack, size = expected.error, _size(*pair)
        if expected.normal is None and {one.kind for one in pair} <= {*ROUND}:
            return  # axes that meet: any normal is right, and the ends of the contact follow it
        if expected.normal is not None:
            normal = contact.frame[0] if contact.surfaces == surfaces else -contact.frame[0]
            turned = float(np.linalg.norm(normal - expected.normal))
            if turned > NORMAL + slack / _least(*pair):
                self._note(surfaces, "has another normal", turned, f"{turned:.3g} rad off")
        # Where a cylinder or box nearly lies, some engines take the middle of its side or edge.
        kinds, middle = {one.kind for one in pair}, False
        if self._model.point_share is None:
            middle = "cylinder" in kinds or (kinds == {"plane", "box"} and _lies(*pair))
            slack += MIN_TILT * extent_of(*pair)
        if off > POINT * size + slack and not middle:
            self._note(surfaces, "is elsewhere", off / size, f"{off:.3g} m off the surfaces")

    def _expected(self, first: Solid, other: Solid, normal: Array) -> _Expected:
        """Return the contact of two shapes, or the bound of its distance along a normal."""
        exact, model, size = distance(first, other), self._model, _size(first, other)
        off, turned = model.frame_errors
        error = EXACT * size + 2 * (off + turned * extent_of(first, other))
        if "cylinder" in (first.kind, other.kind):
            error += MIN_TILT * extent_of(first, other)
        cosine, kinds = abs(float(first.axis @ other.axis)), {first.kind: first, other.kind: other}
        stands = kinds.keys() == {"plane", "cylinder"} and 1 - cosine < model.standing_cosine
        if exact is not None and stands:  # the engine takes its rim for level
            exact = exact[0] + kinds["cylinder"].size[0] * np.sqrt(1 - cosine**2), exact[1]
        if exact is not None and model.finds_exactly(first.kind, other.kind):
            return _Expected(*exact, exact=True, error=error)
        if model.shape_error or not {first.kind, other.kind} <= FLAT:
            error += ROUGH * size + model.shape_error
        return _Expected(gap(first, other, normal), None, exact=False, error=error)

    def _note(self, surfaces: Pair, what: str, size: float, words: str = "") -> None:
        """Note a fault, if it is the worst one of its pair and kind."""
        key = surfaces, what
        self._count[key] += 1
        if size > self._worst.get(key, (0.0, ""))[0]:
            self._worst[key] = size, words

    def result(self) -> ContactCheck:
        """Return the comparison."""
        faults = sorted(self._worst.items(), key=lambda item: -item[1][0])
        return ContactCheck(
            judged=self._judged,
            unjudged=self._unjudged,
            faults=tuple(self._fault(*key, *worst) for key, worst in faults),
            counts=tuple(
                f"{' and '.join(self._names(pair))} have {mine} contacts, {theirs} in"
                f" {self._model.peer}, {_often(often)}"
                for pair, counts in self._counts.items()
                for (mine, theirs), often in counts.most_common(1)
            ),
        )

    def _names(self, surfaces: Pair) -> list[str]:
        shapes = self._shapes(surfaces)
        return [
            "the floor" if one is None or one.shape is None else one.shape.name for one in shapes
        ]

    def _shapes(self, surfaces: Pair) -> list[TouchingShape | None]:
        return [
            next((one for one in self._touching.shapes if one.surface == surface), None)
            for surface in surfaces
        ]

    def _fault(self, surfaces: Pair, what: str, size: float, words: str) -> MisreadNumber:
        times, shapes = _often(self._count[surfaces, what]), self._shapes(surfaces)
        stated = next((one.shape for one in shapes[::-1] if one and one.shape), None)
        subject = f"the contact of {' and '.join(self._names(surfaces))}"
        return MisreadNumber(
            subject=subject,
            sentence=f"{subject} {what} {times}{': ' if words else ''}{words}",
            discrepancy=size,
            file=stated.file if stated else Path(),
            line=stated.line if stated else 0,
        )


def _often(count: int) -> str:
    return f"at {count} states" if count > 1 else "at one state"


def _shrunk(first: Solid, other: Solid) -> tuple[Solid, Solid]:
    """Return two shapes, the smaller one smaller."""
    if first.extent < other.extent:
        return first.scaled(SMALLER), other
    return first, other.scaled(SMALLER)


def _onto(first: Solid, other: Solid, share: float) -> Array:
    """Return the translation of a shape that puts it onto another one's top, (3,)."""
    axis = first.axis
    depth = share * min(first.extent, other.extent)
    low = other.support(-axis) + depth * axis
    if first.kind == "plane":
        return axis * float(axis @ (first.origin - low))
    return first.origin + axis * float(axis @ (first.support(axis) - first.origin)) - low


def _size(first: Solid, other: Solid) -> float:
    """Return the size of two shapes with their places, m."""
    far = float(np.linalg.norm(first.origin) + np.linalg.norm(other.origin))
    return extent_of(first, other) + far


def _lies(first: Solid, other: Solid) -> bool:
    """Return whether a side of a box is about parallel to a plane."""
    plane, box = (first, other) if first.kind == "plane" else (other, first)
    return float(np.max(np.abs(box.rotation.T @ plane.axis))) > 1 - MIN_TILT


def extent_of(*solids: Solid) -> float:
    """Return the size of shapes, m; a plane has none."""
    return sum(one.extent for one in solids if np.isfinite(one.extent))


def _least(first: Solid, other: Solid) -> float:
    """Return the smallest size of two shapes, m."""
    return min(size for one in (first, other) if one.kind != "plane" for size in one.size)


def _off_surface(
    first: Solid, other: Solid, contact: ContactPoint, surfaces: Pair, share: float | None
) -> float:
    """Return how far the ends of a contact are from two surfaces, m; 0 for unknown surfaces."""
    normal, point = contact.frame[0], contact.position
    mine, theirs = (first, other) if contact.surfaces == surfaces else (other, first)
    if share is not None:
        near = point - share * contact.distance * normal
        far = near + contact.distance * normal
    elif mine.kind == "plane" or (theirs.kind != "plane" and mine.kind in ROUND):
        # Inside of a shape, another side may be closer.
        outside = point + abs(contact.distance) * normal
        near = outside - normal * mine.height(outside)[0]
        far = near + contact.distance * normal
    else:
        outside = point - abs(contact.distance) * normal
        far = outside + normal * theirs.height(outside)[0]
        near = far - contact.distance * normal
    if isinstance(contact, ImpulseContact):
        far = contact.other
    heights = (mine.height(near)[0], theirs.height(far)[0])
    return float(np.nanmax([0.0, *np.abs(heights)]))
