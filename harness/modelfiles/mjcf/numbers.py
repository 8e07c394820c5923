"""The numbers of a file that an engine compiles, and the tree for other values.

The engine resolves defaults, frames, units and shapes, so each change is compiled again. The effect
of a number is found by changing it. Numbers of visuals or contacts are changed all at once.
"""

import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, is_dataclass, replace
from functools import cached_property, partial
from operator import eq
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.elements import Number
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.engines.compiled import CompiledShape, CompiledTree
from physics_crosscheck.harness.engines.protocol import Engine, EngineError
from physics_crosscheck.reference.laws.mistakes import DIMENSIONS
from physics_crosscheck.reference.laws.step import LawModel
from physics_crosscheck.reference.mechanism.bodies import RigidBody
from physics_crosscheck.reference.mechanism.laws import Laws
from physics_crosscheck.reference.mechanism.tree import Tree, TreeError
from ..numbers import NUDGE, ModelFile
from .misread import check_reading
from .read import law_model, tree_of


@dataclass(frozen=True, kw_only=True, eq=False)
class _Compiled:
    """A compiled file."""

    read_tree: Callable[[], Tree | None]
    read_laws: Callable[[], LawModel | None]
    same_laws: bool = True
    moved_shapes: int = 0

    @cached_property
    def tree(self) -> Tree | None:
        """The tree of its bodies, or None."""
        return self.read_tree()

    @cached_property
    def laws(self) -> LawModel | None:
        """Its laws, or None."""
        return self.read_laws()


class CompiledNumbers(ModelFile):
    """The numbers of a file that an engine compiles, and of its includes."""

    def __init__(
        self, path: Path, engine: Engine, controls: Sequence[float], held: Collection[str] = ()
    ) -> None:
        self._path, self._engine = path, engine
        self._tree_of = partial(tree_of, controls=controls, held=held)
        self._cache: dict[tuple[int, float], _Compiled | None] = {}
        documents: list[Document] = []
        unread: list[str] = []
        for part in engine.parts(path):
            try:
                documents.append(Document(part))
            except LocationError as error:  # the engine may read it
                unread.append(str(error))
        super().__init__(documents)
        self.unread = tuple(unread)

    def tree(self, values: Mapping[int, float]) -> Tree | None:
        """Return the tree with other values of some numbers, by index, or None."""
        read = self._read(values)
        return None if read is None else read.tree

    def laws(self, values: Mapping[int, float]) -> LawModel | None:
        """Return the laws with other values of some numbers, by index, or None.

        They share the tree of the unchanged file if its bodies and paths are equal.
        """
        read = self._read(values)
        return None if read is None else read.laws

    def _read(self, values: Mapping[int, float]) -> _Compiled | None:
        if not values:
            return self._original
        if len(values) != 1:
            return self._compiled(values)
        (key,) = values.items()
        if key not in self._cache:  # slightly changed numbers are requested repeatedly
            self._cache[key] = self._compiled(values)
        return self._cache[key]

    @cached_property
    def _original(self) -> _Compiled | None:
        compiled = self._source
        if compiled is None:
            return None
        return _Compiled(
            read_tree=partial(self._tree_of, compiled),
            read_laws=partial(_laws_of, compiled),
        )

    @cached_property
    def _source(self) -> CompiledTree | None:
        return self._compile({})

    def _compiled(self, values: Mapping[int, float]) -> _Compiled | None:
        compiled, source, original = self._compile(values), self._source, self._original
        if compiled is None or source is None or original is None:
            return None
        read = self._reread(_shared(compiled, source), source, original)
        return replace(read, moved_shapes=_moved_shapes(source.placed, compiled.placed))

    def _reread(
        self, compiled: CompiledTree, source: CompiledTree, original: _Compiled
    ) -> _Compiled:
        """Return a changed file, with parts of the original one where they are equal."""
        same_tree = source == replace(
            compiled, laws=source.laws, paths=source.paths, placed=source.placed
        )
        read_tree: Callable[[], Tree | None] = (
            (lambda: original.tree) if same_tree else partial(self._tree_like, compiled, original)
        )
        model, laws = original.laws, compiled.laws
        if model is None or laws is None:
            return _Compiled(read_tree=read_tree, read_laws=lambda: None)
        same_paths, same_laws = compiled.paths == source.paths, laws == model.laws
        same_mechanics = (same_tree and same_paths) or _same_mechanics(source, compiled)
        read_laws: Callable[[], LawModel | None] = (
            partial(_under, model, laws) if same_mechanics else partial(_laws_of, compiled)
        )
        return _Compiled(
            read_tree=read_tree, read_laws=read_laws, same_laws=same_paths and same_laws
        )

    def _tree_like(self, compiled: CompiledTree, original: _Compiled) -> Tree | None:
        """Return a tree with the parts of the original where they are equal, or None."""
        tree, before = self._tree_of(compiled), original.tree
        return tree if tree is None or before is None else _shared(tree, before, _same)

    def _compile(self, values: Mapping[int, float]) -> CompiledTree | None:
        try:
            return self._engine.compiled(self._path, self.texts(values))
        except EngineError:
            return None

    def engine_variants(self) -> Iterator[tuple[str, Tree]]:
        """Yield force laws in which the engine differs from the file: causes, each with its tree.

        Raises:
            EngineError: naming the file.
        """
        compiled = self._engine.compiled(self._path)
        for cause, pulls in compiled.engine_variants:
            tree = self._tree_of(replace(compiled, pulls=pulls))
            if tree is not None:
                yield cause, tree

    @cached_property
    def relevant_numbers(self) -> tuple[int, ...]:
        """Indices of the numbers that affect the tree under a small change."""
        original = self.tree({})
        if original is None:
            return ()
        groups = dict(self._groups)
        single = [[i] for i in groups.pop("", [])]
        self._compile_together(i for (i,) in single)
        relevant = (
            i for group in (*groups.values(), *single) for i in self._relevant(original, group)
        )
        return tuple(sorted(relevant))

    def _compile_together(self, indices: Iterable[int]) -> None:
        """Compile nudged numbers of many bodies at once, where each changes its own body only."""
        source, original = self._source, self._original
        if source is None or original is None:
            return
        count = Counter(body.name for body in source.bodies)
        places = {body.name: k for k, body in enumerate(source.bodies) if count[body.name] == 1}
        kinds: dict[tuple[str, int], dict[int, int]] = {}
        for i in indices:
            number = self.numerals[i]
            kind = _OWN_BODY.fullmatch(number.path)
            if kind is not None:
                element = number.element if number.element.tag == "body" else number.element.parent
                name = "" if element is None else element.attributes.get("name", "")
                if name and name in places:
                    group = kinds.setdefault((kind[1], number.word), {})
                    group.setdefault(places[name], i)
        for group in kinds.values():
            if len(group) >= FEWEST:
                nudged = {k: {i: _moved(self.numerals[i], NUDGE)} for k, i in group.items()}
                for k, compiled in self._separated(source, nudged).items():
                    read = self._reread(compiled, source, original)
                    self._cache[next(iter(nudged[k].items()))] = read

    def _separated(
        self, source: CompiledTree, nudged: Mapping[int, Mapping[int, float]]
    ) -> Mapping[int, CompiledTree]:
        """Return the file with each nudged number alone, by its body; empty if others change too.

        Every second body is nudged at once, so that its neighbours show the effects on others, such
        as of a total mass. The last body is also compiled by itself.
        """
        bodies, last = dict[int, RigidBody](), max(nudged)
        for odd in (0, 1):
            group = [k for k in nudged if k % 2 == odd]
            compiled = self._compile({i: x for k in group for i, x in nudged[k].items()})
            if compiled is None or replace(compiled, bodies=source.bodies) != source:
                return {}
            for k, pair in enumerate(zip(source.bodies, compiled.bodies, strict=True)):
                if k in group:
                    bodies[k] = pair[1]
                elif pair[0] != pair[1]:
                    return {}
        whole = source.bodies
        trees = {
            k: replace(source, bodies=(*whole[:k], body, *whole[k + 1 :]))
            for k, body in bodies.items()
        }
        return trees if self._compile(nudged[last]) == trees[last] else {}

    @cached_property
    def law_numbers(self) -> tuple[int, ...]:
        """Indices of the numbers that affect the laws, or their paths, under a small change."""
        if self.laws({}) is None:
            return ()

        def acts(group: Sequence[int]) -> bool:
            other = self._nudged(group)
            return other is None or not other.same_laws

        groups = self._groups
        acting = [group for why, group in groups.items() if not why or acts(group)]
        return tuple(sorted(i for group in acting for i in group if acts([i])))

    @cached_property
    def read_numbers(self) -> frozenset[int]:
        """Indices of the law's numbers whose compiled values are compared with the file's text."""
        model, compiled = self.laws({}), self._source
        if model is None or compiled is None:
            return frozenset()
        places = {
            (file, element.start, key, word)
            for element, key, word in check_reading(self._path, compiled, model).places
            for file, _ in (element.place,)
        }
        return frozenset(
            i
            for i, one in enumerate(self.numerals)
            if (one.file, one.element.start, one.key, one.word) in places
        )

    @cached_property
    def law_choices(self) -> Mapping[int, tuple[int, ...]]:
        """Indices of the numbers that select a contact's directions, with the other values."""
        choices: dict[int, tuple[int, ...]] = {}
        for i, number in enumerate(self.numerals):
            if number.key == "condim" and number.value in DIMENSIONS and self.laws({}) is not None:
                others = (value for value in DIMENSIONS if value != number.value)
                choices[i] = tuple(value for value in others if self._selects(i, value))
        return choices

    def _selects(self, index: int, value: int) -> bool:
        read = self._read({index: value})
        return read is not None and not read.same_laws

    @cached_property
    def _groups(self) -> Mapping[str, list[int]]:
        """All numbers except choices, by their purpose if it is not the motion."""
        purposes = {path: self._purpose(path) for path in {one.path for one in self.numerals}}
        groups: dict[str, list[int]] = {}
        for i, number in enumerate(self.numerals):
            if (purpose := purposes[number.path]) is not None:
                groups.setdefault(purpose, []).append(i)
        return groups

    def placing(self, candidates: Collection[int]) -> frozenset[int]:
        """Return those numbers that shapes and sites depend on: where they are, or their sizes."""
        groups = [[i for i in group if i in candidates] for group in self._groups.values()]
        # A group that is refused as a whole may act.
        acting = (i for group in groups if self._moved_by(group) for i in group)
        rounds: dict[int, list[int]] = {}
        others, count = list[int](), Counter[int]()
        for i in acting:
            number = self.numerals[i]
            if _OWN_SHAPE.fullmatch(number.path):
                rounds.setdefault(count[id(number.element)], []).append(i)
                count[id(number.element)] += 1
            else:
                others.append(i)
        placed = (i for group in rounds.values() for i in self._placing(group))
        return frozenset((*placed, *(i for i in others if self._moved_by([i]))))

    def _placing(self, group: Sequence[int]) -> Iterator[int]:
        """Yield those numbers that their shapes depend on; each of another element."""
        moved = self._moved_by(group)
        if moved == len(group) or (moved and len(group) == 1):
            yield from group
        elif moved != 0 and len(group) > 1:
            half = len(group) // 2
            yield from self._placing(group[:half])
            yield from self._placing(group[half:])

    def _moved_by(self, group: Sequence[int]) -> int | None:
        """Return how many shapes nudged numbers move; None if they are refused."""
        other = self._nudged(group)
        return None if other is None else other.moved_shapes

    def _purpose(self, path: str) -> str | None:
        """Return the purpose of numbers if it is not the motion, else ""; None for choices."""
        if self._engine.choices and re.fullmatch(self._engine.choices, path):
            return None
        kinds = self._engine.non_physical.items()
        return next((why for kind, why in kinds if re.fullmatch(kind, path)), "")

    def _nudged(self, group: Sequence[int]) -> _Compiled | None:
        """Return the file with nudged numbers; downwards if it is refused upwards."""
        ways = ({i: _moved(self.numerals[i], way * NUDGE) for i in group} for way in (1.0, -1.0))
        return next((read for one in ways if (read := self._read(one)) is not None), None)

    def _relevant(self, original: Tree, group: Sequence[int]) -> Iterator[int]:
        """Yield the numbers of a group that affect the tree."""
        read = self._nudged(group)
        if read is not None and read.tree is not None and _same(original, read.tree):
            return
        if len(group) == 1:
            yield from group
        else:
            half = len(group) // 2
            yield from self._relevant(original, group[:half])
            yield from self._relevant(original, group[half:])


def _laws_of(compiled: CompiledTree) -> LawModel | None:
    """Return the laws of a compiled file; None if something acts that has none."""
    try:
        model = law_model(compiled)
    except TreeError:
        return None
    return None if model is None or model.laws.uncovered else model


def _same_mechanics(first: CompiledTree, second: CompiledTree) -> bool:
    """Return whether all that a tree with laws depends on, besides the laws, is equal."""
    names = ("paths", "gravity", "fluid")
    return (
        all(getattr(first, name) == getattr(second, name) for name in names)
        and first.passive == second.passive
        and len(first.bodies) == len(second.bodies)
        and all(
            one == two or _unlimited(one) == _unlimited(two)
            for one, two in zip(first.bodies, second.bodies, strict=True)
        )
    )


def _unlimited(body: RigidBody) -> RigidBody:
    """Return a body without limits of its joints, which are laws."""
    joints = tuple(replace(one, limits=None) for one in body.joints)
    return replace(body, joints=joints)


def _under(model: LawModel, laws: Laws) -> LawModel:
    """Return other laws on the bodies of a model."""
    return model.under(_shared(laws, model.laws))


T = TypeVar("T", Tree, Laws, CompiledTree)


def _shared(new: T, original: T, same: Callable[[Any, Any], bool] = eq) -> T:
    """Return it with the rows of the original where they are equal, to save memory.

    A file is kept with each of its numbers changed, which changes few rows.
    """
    changes: dict[str, Any] = {}
    for name in _TABLES[type(new)]:
        rows, before = getattr(new, name), getattr(original, name)
        if same(rows, before):
            changes[name] = before
        elif isinstance(rows, Mapping):
            changes[name] = {
                key: before[key] if key in before and same(row, before[key]) else row
                for key, row in rows.items()
            }
        elif len(rows) == len(before):
            pairs = zip(rows, before, strict=True)
            changes[name] = tuple(two if same(one, two) else one for one, two in pairs)
    return replace(new, **changes)


_TABLES: Mapping[type, Sequence[str]] = {
    Tree: ("links", "pulls", "couplings", "immersed", "bushings", "frames"),
    Laws: ("limits", "frictions", "equalities", "surfaces", "pairs", "drives"),
    CompiledTree: ("bodies", "pulls", "couplings", "actuators", "paths", "placed"),
}


FEWEST = 4
"""Fewest bodies whose numbers are compiled together."""

_OWN_BODY = re.compile(
    r"(?!.*(?:default|replicate|composite|flexcomp|frame)).*/(body(?:/inertial|/joint)?@\w+)"
)
"""Paths of the numbers that mostly change one compiled body only, with the kind of number."""

PLACED = 1e-9
"""Smallest change of a shape's place or size that counts, relative to its largest number."""


_OWN_SHAPE = re.compile(r"(?!.*(default|replicate|composite|flexcomp)).*/(geom|site)@\w+")
"""Paths of the numbers that only one shape can depend on."""


def _moved_shapes(first: Sequence[CompiledShape], second: Sequence[CompiledShape]) -> int:
    """Return how many shapes have other places or sizes; -1 for other names or bodies."""
    if len(first) != len(second):
        return -1
    pairs = [pair for pair in zip(first, second, strict=True) if pair[0] is not pair[1]]
    if any(_kind(one) != _kind(two) for one, two in pairs):
        return -1
    moved = 0
    for before, after in pairs:
        numbers = np.array(_extent(before))
        by = np.abs(numbers - np.array(_extent(after)))
        moved += bool(np.any(by > PLACED * np.maximum(1e-3, np.abs(numbers))))
    return moved


def _kind(shape: CompiledShape) -> tuple[str, str | None, int]:
    return shape.name, shape.frame.body, len(shape.size)


def _extent(shape: CompiledShape) -> tuple[float, ...]:
    """Return its numbers; of a quaternion and its negative, the one with a positive first part."""
    turn = np.array(shape.frame.quaternion)
    sign = -1.0 if next((x for x in turn if abs(x) > PLACED), 1.0) < 0 else 1.0
    return (*shape.size, *shape.frame.position, *(sign * turn))


def _moved(number: Number, share: float) -> float:
    return number.value + share * number.scale


def _same(first: Any, second: Any) -> bool:
    """Return whether two trees, or parts of them, are equal to the last digit."""
    if first is second or type(first) is not type(second):
        return first is second
    if isinstance(first, np.ndarray):
        return bool(np.array_equal(first, second))
    if isinstance(first, tuple):
        return len(first) == len(second) and all(map(_same, first, second))
    if isinstance(first, Mapping):
        return first.keys() == second.keys() and all(_same(first[k], second[k]) for k in first)
    if is_dataclass(first):
        names = first.__dataclass_fields__
        return all(_same(getattr(first, name), getattr(second, name)) for name in names)
    return bool(first == second)
