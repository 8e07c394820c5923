"""The numbers of a file that an engine compiles, and the tree that it makes of other ones.

Defaults, frames, units and shapes are the engine's to resolve: each change is compiled. So what a
number says is found by moving it; what is for looks, or for contacts, is moved all at once.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.engines.protocol import Engine, EngineError
from physics_crosscheck.harness.modelfiles.document import Document, DocumentError
from physics_crosscheck.harness.modelfiles.mjcf.read import tree_of
from physics_crosscheck.harness.modelfiles.numbers import NUDGE, Numeral, numerals, with_values
from physics_crosscheck.reference.mechanism.tree import Tree


class CompiledNumbers:
    """The numbers of a file, and of those that it includes.

    Attributes:
        numerals: all of them, file after file.
        unread: why numbers of some of these files are not among them, a sentence each.
    """

    def __init__(self, path: Path, engine: Engine, controls: Sequence[float]) -> None:
        self._path, self._engine, self._controls = path, engine, controls
        self._texts: dict[Path, bytes] = {}
        self._known: dict[tuple[int, float], Tree | None] = {}
        found: list[Numeral] = []
        unread: list[str] = []
        for part in engine.parts(path):
            try:
                document = Document(part)
            except DocumentError as error:  # the engine may read it
                unread.append(str(error))
                continue
            self._texts[part] = document.data
            found += numerals(document)
        self.numerals: tuple[Numeral, ...] = tuple(found)
        self.unread = tuple(unread)

    def tree(self, values: Mapping[int, float]) -> Tree | None:
        """The tree with other values of some numbers, by their index; None where there is none."""
        if len(values) != 1:
            return self._compiled(values)
        (key,) = values.items()
        if key not in self._known:  # one moved a little is asked for more than once
            self._known[key] = self._compiled(values)
        return self._known[key]

    def _compiled(self, values: Mapping[int, float]) -> Tree | None:
        try:
            return tree_of(self._engine.compiled(self._path, self.texts(values)), self._controls)
        except EngineError:
            return None

    def taken(self) -> Iterator[tuple[str, Tree]]:
        """What the engine does with pulls on its own: each a cause, with the tree that it makes.

        Raises:
            EngineError: naming the file.
        """
        found = self._engine.compiled(self._path)
        for cause, pulls in found.taken:
            tree = tree_of(replace(found, pulls=pulls), self._controls)
            if tree is not None:
                yield cause, tree

    def texts(self, values: Mapping[int, float]) -> Mapping[Path, bytes]:
        """The files with other values of some numbers."""
        texts = dict(self._texts)
        for file, data in self._texts.items():
            own = {i: value for i, value in values.items() if self.numerals[i].file == file}
            texts[file] = with_values(data, self.numerals, own)
        return texts

    @cached_property
    def saying(self) -> tuple[int, ...]:
        """Indices of those that the tree depends on, as far as a small change tells."""
        own = self.tree({})
        if own is None:
            return ()
        groups: dict[str, list[int]] = {}
        alone: list[list[int]] = []
        for i, one in enumerate(self.numerals):
            if self._engine.choices and re.fullmatch(self._engine.choices, one.path):
                continue
            if why := self._reason(one):
                groups.setdefault(why, []).append(i)
            else:
                alone.append([i])
        found = (i for group in (*groups.values(), *alone) for i in self._felt(own, group))
        return tuple(sorted(found))

    def _reason(self, one: Numeral) -> str:
        idle = self._engine.idle.items()
        return next((why for kind, why in idle if re.fullmatch(kind, one.path)), "")

    def _felt(self, own: Tree, group: Sequence[int]) -> Iterator[int]:
        """Those of a group that the tree depends on."""
        ways = (1.0, -1.0)
        for way in ways:
            tree = self.tree({i: _moved(self.numerals[i], way * NUDGE) for i in group})
            if tree is not None:
                break
        if len(group) == 1:
            if tree is None or not _same(own, tree):
                yield from group
        elif tree is None or not _same(own, tree):
            half = len(group) // 2
            yield from self._felt(own, group[:half])
            yield from self._felt(own, group[half:])


def _moved(one: Numeral, share: float) -> float:
    return one.value + share * one.scale


def _same(one: Tree, other: Tree) -> bool:
    """Whether two trees are equal, to the last digit."""
    return _plain(one) == _plain(other)


def _plain(value: object) -> object:
    """What can be compared: all fields of what it is made of, and arrays as lists."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, tuple):
        return tuple(map(_plain, value))
    if is_dataclass(value):
        return tuple(_plain(getattr(value, field.name)) for field in fields(value))
    return value
