"""Differences of the files beyond bodies and laws: shapes, contacts, options and joint numbers.

Motions and steps leave these out, or take them from the engine. Shapes are paired by their form and
place, so that names, order and the frames of bodies do not matter.
"""

import hashlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import PurePosixPath

import numpy as np

from physics_crosscheck.harness.documents.document import read_numbers
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.expanded import locate_file
from physics_crosscheck.harness.documents.reading import USD_SUFFIXES
from physics_crosscheck.harness.modelfiles.robot import PlacedShape
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import IDENTITY, Place
from physics_crosscheck.reference.mechanism.tree import WORLD, Tree
from .alignment import SAME, Aligned, angle_of
from .match import JointPair
from .side import (
    KEYS,
    Difference,
    ModelSide,
    element_line,
    equal_values,
    lines_of,
    make_property,
    values_shown,
)

make_stated = partial(make_property, moves=False)

NOWHERE = WORLD - 1
"""Index of the link of a body that is in no tree."""


def stated_properties(
    a: ModelSide, b: ModelSide, rows: Sequence[Aligned], pairs: Mapping[str, JointPair]
) -> Iterator[Difference]:
    """Yield the differences.

    Args:
        a, b: both files.
        rows: pairs of links.
        pairs: of joints, by the names of A's.
    """
    size, shapes, single = _matched(a, b, rows)
    yield from _shapes(size, shapes, single)
    if a.facts.compiled is not None and b.facts.compiled is not None:
        yield from _contacts(a, b, shapes)
        yield from _texts(a, b)
    yield from _joint_numbers(a, b, pairs)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Shape:
    """A shape at the common position.

    Attributes:
        index: among the file's shapes.
        link: index of A's link that carries it, or `WORLD`.
        place: its frame in the world, where B's link is moved to that of A.
    """

    model: ModelSide
    shape: PlacedShape
    index: int
    link: int
    place: Place

    @property
    def label(self) -> str:
        """Its name, or its number on its body."""
        kind, _, name = self.shape.name.partition(":")
        if name and not (kind == "geom" and name.startswith("geom_")):
            return name
        return f"#{self.index + 1} of {self.shape.body or 'the world'}"

    def line(self, *, size: bool = False) -> SourceLine | None:
        """Return the line of its element, or of its size."""
        file, line = self.shape.file, self.shape.line
        if size and self.shape.size_place:
            file, line = self.shape.size_place
        return SourceLine(file=str(file), line=line) if line else None

    @property
    def content(self) -> str:
        """A digest of its mesh; the name of a mesh without a file."""
        path = locate_file(self.shape.file, self.shape.mesh) if self.shape.mesh else None
        if path is None:
            return PurePosixPath(self.shape.mesh).name
        return hashlib.sha256(path.read_bytes()).hexdigest()


def _shapes(
    size: float,
    pairs: Sequence[tuple[_Shape, _Shape]],
    single: Sequence[tuple[str, _Shape, _Shape | None]],
) -> Iterator[Difference]:
    for x, y in pairs:
        for what, share, text in _unlike(x, y, size):
            lines = x.line(size=what == "size"), y.line(size=what == "size")
            message = f"{what} of shape {x.label}: {text}"
            yield make_stated("shape", x.label, message, relative=share, lines=lines)
    for label, shape, other in single:
        has = ("some", "none") if label == "A" else ("none", "some")
        what = "contacts of shape" if other else "shape"
        message = f"{what} {shape.label}: {has[0]} in A, {has[1]} in B"
        both = [shape.line(), other.line() if other else None]
        first, last = both if label == "A" else both[::-1]
        yield make_stated("shape", shape.label, message, lines=(first, last))


def _matched(
    a: ModelSide, b: ModelSide, rows: Sequence[Aligned]
) -> tuple[float, list[tuple[_Shape, _Shape]], list[tuple[str, _Shape, _Shape | None]]]:
    """Pair shapes on paired links: alike ones, then by name, then those of one form in order.

    Returns:
        The size of the mechanism, m; pairs of shapes that can touch; and others, each with the
        file that has it, and the shape without contacts that the other one has there.
    """
    links = {row.b: (row.a, row.moved) for row in rows}
    of_a = _placed(a, {row.a: (row.a, IDENTITY) for row in rows})
    of_b = _placed(b, links)
    if a.file.suffix != b.file.suffix:  # only an MJCF states the surroundings of a robot
        is_read = {a.file.suffix, b.file.suffix}.isdisjoint(USD_SUFFIXES)  # those of USD are not
        of_a, of_b = ([x for x in one if x.link != WORLD and is_read] for one in (of_a, of_b))
    size = max(a.placed.size, b.placed.size)
    touching_a, touching_b = ([x for x in one if _touches(x)] for one in (of_a, of_b))
    pairs: list[tuple[_Shape, _Shape]] = []
    tests: tuple[Callable[[_Shape, _Shape], bool], ...] = (
        lambda x, y: not any(True for _ in _unlike(x, y, size)),
        lambda x, y: x.label == y.label,
        lambda x, y: x.shape.kind == y.shape.kind,
    )
    for is_pair in tests:
        for x in list(touching_a):
            y = next((y for y in touching_b if x.link == y.link and is_pair(x, y)), None)
            if y is not None:
                pairs.append((x, y))
                touching_a.remove(x)
                touching_b.remove(y)
    single: list[tuple[str, _Shape, _Shape | None]] = []
    for label, rest, others in (("A", touching_a, of_b), ("B", touching_b, of_a)):
        for x in rest:
            still = (y for y in others if not _touches(y) and y.link == x.link)
            other = next((y for y in still if tests[0](x, y)), None)
            single.append((label, x, other))
    return size, pairs, single


def _placed(model: ModelSide, links: Mapping[int, tuple[int, Place]]) -> list[_Shape]:
    robot, shapes = model.facts.robot, list[_Shape]()
    frames: dict[str | None, tuple[int, Place]] = {None: (WORLD, IDENTITY)}
    frames.update(model.tree.frames)
    for i, shape in enumerate(() if robot is None else robot.placed):
        link, place = frames.get(shape.body, (NOWHERE, IDENTITY))
        if shape.name.startswith("site:") or (link != WORLD and link not in links):
            continue
        if link != WORLD:
            link, moved = links[link][0], links[link][1]
            place = moved.compose(model.placed.frames[frames[shape.body][0]].compose(place))
        shapes.append(
            _Shape(model=model, shape=shape, index=i, link=link, place=place.compose(shape.place))
        )
    return shapes


def _touches(x: _Shape) -> bool:
    """Return whether a shape can touch: by its masks, or in a pair that the file states."""
    compiled = x.model.facts.compiled
    stated = () if compiled is None or compiled.laws is None else compiled.laws.pairs
    return not x.shape.visual or any(x.index in (i, j) for i, j, _ in stated)


def _unlike(x: _Shape, y: _Shape, size: float) -> Iterator[tuple[str, float, str]]:
    kind, other = x.shape.kind, y.shape.kind
    if kind != other:
        yield "kind", 1.0, f"{kind} in A, {other} in B"
        return
    here, there = _extent(x), _extent(y)
    if kind == "box" and len(here) == 3 and _is_turned_box(x, y, here, there):
        return
    miss = np.abs(here - there) if len(here) == len(there) else np.ones(1)
    large = float(max(np.abs(here).max(initial=0.0), np.abs(there).max(initial=0.0)))
    if miss.size and float(miss.max()) > SAME * large:
        text = f"({_numbers(here)}) in A, ({_numbers(there)}) in B"
        yield "size", float(miss.max()) / large, text
    if x.shape.mesh and x.content != y.content:
        yield "mesh", 1.0, "another one in B"
    shift = y.place.origin - x.place.origin
    axes = x.place.rotation[:, 2], y.place.rotation[:, 2]
    if kind == "plane":
        shift = axes[0] * (axes[0] @ shift)
    apart, turn = float(np.linalg.norm(shift)), _turn(x, y)
    if apart > SAME * size or turn > 10 * SAME:
        by = ", ".join(f"{value + 0.0:.4g}" for value in shift)
        parts = [f"{apart:.3g} m apart, by ({by}) in the world"] if apart > SAME * size else []
        parts += [f"turned by {turn:.3g} rad"] if turn > 10 * SAME else []
        yield "place", apart / size + turn, " and ".join(parts)


def _extent(x: _Shape) -> Array:
    """Return the numbers of a shape's extent; a plane has none, and a mesh its scale."""
    if x.shape.kind == "plane":
        return np.zeros(0)
    return np.array(x.shape.size or (x.shape.scale if x.shape.mesh else ()))


def _is_turned_box(x: _Shape, y: _Shape, here: Array, there: Array) -> bool:
    between = np.abs(x.place.rotation.T @ y.place.rotation)
    order = np.round(between)
    near = SAME * float(np.abs(here).max())
    return bool(
        np.abs(between - order).max() <= 10 * SAME
        and np.abs(order @ there - here).max() <= near
        and np.linalg.norm(x.place.origin - y.place.origin) <= near
    )


def _turn(x: _Shape, y: _Shape) -> float:
    """Return the angle between two shapes of one kind that a contact can show, rad."""
    between = x.place.rotation.T @ y.place.rotation
    if x.shape.kind == "sphere":
        return 0.0
    if x.shape.kind in ("plane", "capsule", "cylinder"):
        cosine = between[2, 2] if x.shape.kind == "plane" else abs(between[2, 2])
        return float(np.arctan2(np.linalg.norm(between[:2, 2]), cosine))
    if x.shape.kind in ("box", "ellipsoid"):
        between = between * np.sign(np.where(np.diag(between) < 0, -1.0, 1.0))
    return angle_of(between)


def _numbers(values: Array) -> str:
    return " ".join(f"{value:.9g}" for value in values)


def _contacts(
    a: ModelSide, b: ModelSide, pairs: Sequence[tuple[_Shape, _Shape]]
) -> Iterator[Difference]:
    """Yield shapes that touch others in one file only, by masks and excluded bodies."""
    tables = [_touching(model, [pair[k] for pair in pairs]) for k, model in enumerate((a, b))]
    changed = tables[0] ^ tables[1]
    while changed:
        (busiest, _), *_ = Counter(i for pair in changed for i in pair).most_common(1)
        others = sorted({i for pair in changed if busiest in pair for i in pair} - {busiest})
        changed = {pair for pair in changed if busiest not in pair}
        x, y = pairs[busiest]
        names = ", ".join(pairs[i][0].label for i in others[:3])
        names += f" and {len(others) - 3} more" if len(others) > 3 else ""
        counts = [sum(frozenset((busiest, i)) in table for i in others) for table in tables]
        here, there = ("some" if count else "none" for count in counts)
        message = f"contacts of shape {x.label} with {names}: {here} in A, {there} in B"
        bodies = {x.shape.body, *(pairs[i][0].shape.body for i in others)}
        lines = [_exclude_line(model, bodies) or one.line() for model, one in ((a, x), (b, y))]
        yield make_stated("contacts", x.label, message, lines=(lines[0], lines[1]))


def _touching(model: ModelSide, shapes: Sequence[_Shape]) -> set[frozenset[int]]:
    """Return pairs of some shapes that touch by their masks and bodies, by their order here."""
    compiled = model.facts.compiled
    if compiled is None or compiled.laws is None:
        return set()
    surfaces = [compiled.laws.surfaces[shape.index] for shape in shapes]
    excluded = {frozenset(pair) for pair in compiled.excluded}
    return {
        frozenset((i, j))
        for i, first in enumerate(surfaces)
        for j, other in enumerate(surfaces[:i])
        if first.touches(other) and frozenset((first.body, other.body)) not in excluded
    }


def _exclude_line(model: ModelSide, bodies: set[str | None]) -> SourceLine | None:
    rows = [] if model.root is None else model.root.findall("contact/exclude")
    excludes = (one for one in rows if {one.get("body1"), one.get("body2")} <= bodies)
    return element_line(model.file, next(excludes, None))


def _texts(a: ModelSide, b: ModelSide) -> Iterator[Difference]:
    first, other = a.facts.compiled, b.facts.compiled
    assert first is not None
    assert other is not None
    options = [{("", name): value for name, value in one.options} for one in (first, other)]
    rest = [{(one, key): value for one, key, value in model.others} for model in (first, other)]
    for kind, (here, there) in (("option", options), ("other", rest)):
        for subject, key in dict.fromkeys([*here, *there]):
            values = here.get((subject, key), "none"), there.get((subject, key), "none")
            in_one = "none" in values and (key, {*values}) != ("active", {"none", "false"})
            if values[0] != values[1] and not (in_one and key in EQUALITY):
                shown = [f"({value})" if " " in value else value for value in values]
                about = f"{key} of {subject}" if subject else key
                message = f"{about}: {shown[0]} in A, {shown[1]} in B"
                if key == "elevation" and "none" not in values:
                    message = f"{about}: other heights in B"
                if key == EQUALITY[1]:
                    message = f"inactive equality {subject}: other numbers in B"
                lines = _text_line(a, subject, key), _text_line(b, subject, key)
                immersed = bool(a.tree.fluid or b.tree.fluid)
                moves, calm = key in FLUID and immersed, key == "wind" and not immersed
                if calm:
                    message = f"{message}; it moves nothing without density and viscosity"
                yield make_property(
                    kind, subject or key, message, lines=lines, moves=moves,
                    relative=0.0 if calm else _share(*values),
                    changed=_immersed(a, b, key) if moves else None,
                )  # fmt: skip


EQUALITY = ("active", "data while inactive")
"""Attributes of equalities; an active one of one file only is a row of the laws."""

FLUID = ("density", "viscosity", "wind")
"""Options that act on bodies in a medium, and so on motions."""


def _immersed(a: ModelSide, b: ModelSide, key: str) -> Tree | None:
    here, there = a.tree.fluid, b.tree.fluid
    if here is None or there is None:
        return None
    return replace(a.tree, fluid=replace(here, **{key: getattr(there, key)}))


def _share(here: str, there: str) -> float:
    x, y = (np.array(read_numbers(text, len(text.split())) or ()) for text in (here, there))
    if not x.size or x.shape != y.shape:
        return 1.0
    return float(np.abs(x - y).max() / (max(np.abs(x).max(), np.abs(y).max()) or 1.0))


def _text_line(model: ModelSide, subject: str, key: str) -> SourceLine | None:
    if model.root is None:
        return None
    if not subject:
        kind, _, flag = key.partition(" ")
        elements = model.root.findall("option/flag" if flag else "option")
        stating = (e for e in elements[::-1] if (flag or kind) in e.attributes)
        return element_line(model.file, next(stating, None), flag or kind)
    kind, _, name = subject.partition(" ")
    if name.startswith("#"):
        of_kind = model.root.findall(f"equality/{kind}") or model.root.findall(f"{kind}/*")
        named = of_kind[int(name[1:]) - 1 :]
    else:
        named = [x for x in model.root.iter() if x.get("name") == name and x.tag != "default"]
    return element_line(model.file, next(iter(named), None), key)


def _joint_numbers(
    a: ModelSide, b: ModelSide, pairs: Mapping[str, JointPair]
) -> Iterator[Difference]:
    is_mixed = ".xml" in (a.file.suffix, b.file.suffix)
    driven = {one.on for model in (a, b) for one in model.facts.actuators}
    both = [_by_joint(model, drives=a.file.suffix != b.file.suffix) for model in (a, b)]
    names = {name: pair.b for name, pair in pairs.items()}
    back = {its: name for name, its in names.items()}
    every = [*(name for name in both[0] if name in names), *(back[k] for k in both[1] if k in back)]
    for name in dict.fromkeys(every):
        here, there = both[0].get(name, {}), both[1].get(names.get(name, name), {})
        for what in dict.fromkeys([*here, *there]):
            renamed = (back.get(x, x) if isinstance(x, str) else x for x in there.get(what, ()))
            values: tuple[_Values, _Values] = here.get(what, ()), tuple(renamed)
            if not equal_values(*values, SAME):
                shown = [values_shown(one) for one in values]
                message = f"{what} of joint {name}: {shown[0]} in A, {shown[1]} in B"
                lines = lines_of(a, b, what, (name, names.get(name, name)))
                share = _share(*(" ".join(map(str, one)) or "none" for one in values))
                if is_mixed and what == "velocity":
                    share, message = 0.0, f"velocity of joint {name}: no MJCF states one"
                if is_mixed and what == "effort" and not (all(values) or name in driven):
                    share, message = 0.0, f"{message}; it limits no drive"
                yield make_stated(what, name, message, lines=lines, relative=share)


_Values = tuple[float | str, ...]


def _by_joint(model: ModelSide, *, drives: bool) -> dict[str, dict[str, _Values]]:
    """Return what a file states of each joint, or of its only drive, without what is zero."""
    rows = model.stage_numbers()
    robot, compiled = model.facts.robot, model.facts.compiled
    body_model = None if robot is None else robot.body_model
    for coupling in () if body_model is None else body_model.couplings:
        leaders = [(coupling.leader or "none", coupling.multiplier), *coupling.others]
        values: _Values = (*(part for pair in leaders for part in pair), coupling.offset)
        rows.setdefault(coupling.follower, {})["coupling"] = values
    if compiled is None:
        for element in () if model.root is None else model.root.iter("joint"):
            stated = rows.setdefault(element.get("name"), {})
            stated.update(_stated_mimic(element) if model.file.suffix == ".urdf" else {})
            for what in ("friction", "effort", "velocity"):
                if (value := _stated_number(element, what)) is not None:
                    stated[what] = (value,)
        return rows
    laws = compiled.laws
    ranges = {} if laws is None else laws.joint_ranges
    frictions = {} if laws is None else {one.joint: one.force for one in laws.frictions}
    for j, name in enumerate(compiled.joints):
        if frictions.get(j):
            rows.setdefault(name, {})["friction"] = (frictions[j],)
        on = [one for one in compiled.actuators if drives and one.on == name]
        force: tuple[float, ...] | None = ranges[j][0] if j in ranges else None
        if force is None and len(on) == 1 and abs(dict(on[0].numbers)["gear"][0]) == 1:
            force = dict(on[0].ranges).get("force range")
        if force is not None:
            low, high = force[0], force[1]
            rows.setdefault(name, {})["effort"] = (high,) if low == -high else (low, high)
    return rows


def _stated_mimic(joint: XmlElement) -> dict[str, _Values]:
    """Return the coupling of a URDF's joint, also one that no engine enforces."""
    mimic = joint.find("mimic")
    texts = [] if mimic is None else [mimic.get("multiplier", "1"), mimic.get("offset", "0")]
    if mimic is None or not all(read_numbers(text, 1) for text in texts):
        return {}
    return {"coupling": (mimic.get("joint"), *map(float, texts))}


def _stated_number(joint: XmlElement, what: str) -> float | None:
    """Return a number of a joint's element that limits or resists it; None for zero or none."""
    for key in KEYS[what]:
        path, _, attribute = key.partition("@")
        element = joint.find(path) if path else joint
        text = "" if element is None else element.get(attribute) if attribute else element.text
        numbers = read_numbers(text, 1)
        if numbers is not None and numbers[0] and np.isfinite(numbers[0]) and numbers[0] < 1e16:
            return numbers[0] if joint.get("type") != "fixed" else None
    return None
