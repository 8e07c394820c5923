"""The numbers of a file that an engine compiles, and the tree for other values.

The engine resolves defaults, frames, units and shapes, so each change is compiled again. The effect
of a number is found by changing it. Numbers of visuals or contacts are changed all at once.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.engines.protocol import Engine, EngineError
from physics_crosscheck.harness.modelfiles.mjcf.read import tree_of
from physics_crosscheck.harness.modelfiles.numbers import NUDGE, Number, numerals, with_values
from physics_crosscheck.reference.mechanism.tree import Tree


class CompiledNumbers:
    """The numbers of a file and of its includes.

    Attributes:
        numerals: all of them, file after file.
        unread: why numbers of some of these files are missing, one sentence each.
    """

    def __init__(self, path: Path, engine: Engine, controls: Sequence[float]) -> None:
        self._path, self._engine, self._controls = path, engine, controls
        self._texts: dict[Path, bytes] = {}
        self._cache: dict[tuple[int, float], Tree | None] = {}
        all_numbers: list[Number] = []
        unread: list[str] = []
        for part in engine.parts(path):
            try:
                document = Document(part)
            except LocationError as error:  # the engine may read it
                unread.append(str(error))
                continue
            self._texts[part] = document.data
            all_numbers += numerals(document)
        self.numerals: tuple[Number, ...] = tuple(all_numbers)
        self.unread = tuple(unread)

    def tree(self, values: Mapping[int, float]) -> Tree | None:
        """Return the tree with other values of some numbers, by index, or None."""
        if len(values) != 1:
            return self._compiled(values)
        (key,) = values.items()
        if key not in self._cache:  # slightly changed numbers are requested repeatedly
            self._cache[key] = self._compiled(values)
        return self._cache[key]

    def _compiled(self, values: Mapping[int, float]) -> Tree | None:
        try:
            return tree_of(self._engine.compiled(self._path, self.texts(values)), self._controls)
        except EngineError:
            return None

    def engine_variants(self) -> Iterator[tuple[str, Tree]]:
        """Yield force laws in which the engine differs from the file: causes, each with its tree.

        Raises:
            EngineError: naming the file.
        """
        compiled = self._engine.compiled(self._path)
        for cause, pulls in compiled.engine_variants:
            tree = tree_of(replace(compiled, pulls=pulls), self._controls)
            if tree is not None:
                yield cause, tree

    def texts(self, values: Mapping[int, float]) -> Mapping[Path, bytes]:
        """Return the files with other values of some numbers."""
        texts = dict(self._texts)
        for file, data in self._texts.items():
            changed = {i: value for i, value in values.items() if self.numerals[i].file == file}
            texts[file] = with_values(data, self.numerals, changed)
        return texts

    @cached_property
    def relevant_numbers(self) -> tuple[int, ...]:
        """Indices of the numbers that affect the tree under a small change."""
        original = self.tree({})
        if original is None:
            return ()
        groups: dict[str, list[int]] = {}
        single: list[list[int]] = []
        for i, number in enumerate(self.numerals):
            if self._engine.choices and re.fullmatch(self._engine.choices, number.path):
                continue
            if why := self._reason(number):
                groups.setdefault(why, []).append(i)
            else:
                single.append([i])
        relevant = (
            i for group in (*groups.values(), *single) for i in self._relevant(original, group)
        )
        return tuple(sorted(relevant))

    def _reason(self, number: Number) -> str:
        kinds = self._engine.non_physical.items()
        return next((why for kind, why in kinds if re.fullmatch(kind, number.path)), "")

    def _relevant(self, original: Tree, group: Sequence[int]) -> Iterator[int]:
        """Yield the numbers of a group that affect the tree."""
        ways = (1.0, -1.0)
        for way in ways:
            tree = self.tree({i: _moved(self.numerals[i], way * NUDGE) for i in group})
            if tree is not None:
                break
        if len(group) == 1:
            if tree is None or not _same(original, tree):
                yield from group
        elif tree is None or not _same(original, tree):
            half = len(group) // 2
            yield from self._relevant(original, group[:half])
            yield from self._relevant(original, group[half:])


def _moved(number: Number, share: float) -> float:
    return number.value + share * number.scale


def _same(first: Tree, second: Tree) -> bool:
    """Return whether two trees are equal, to the last digit."""
    return _plain(first) == _plain(second)


def _plain(value: object) -> object:
    """Return a comparable value: all fields of nested data classes, and arrays as lists."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, tuple):
        return tuple(map(_plain, value))
    if isinstance(value, Mapping):
        return {key: _plain(one) for key, one in value.items()}
    if is_dataclass(value):
        return tuple(_plain(getattr(value, field.name)) for field in fields(value))
    return value
