"""The numbers of an SDFormat file, and the tree that results where some of them are others."""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path

from harness.robots.document import Document
from harness.robots.numerals import Numeral, numerals, put, with_values
from harness.robots.sdf import read_document
from reference.multibody.tree import Tree

_SAYING = re.compile(
    r"sdf/(world/)?(gravity|model/(pose|link/(pose|inertial/.*)|frame/pose"
    r"|joint/(pose|axis/(xyz|dynamics/(damping|spring_\w+)|mimic/.*))))"
)
"""Numbers that a tree is made of."""


class SdfNumbers:
    """The numbers of an SDFormat file that has a tree.

    Args:
        path: of the file.

    Attributes:
        numerals: all of them, in the file's order.
        saying: indices of those that may say something of the tree.
    """

    def __init__(self, path: Path) -> None:
        self._document = Document(path)
        self.numerals: tuple[Numeral, ...] = numerals(self._document)
        self.saying = tuple(i for i, one in enumerate(self.numerals) if _SAYING.fullmatch(one.path))

    def tree(self, values: Mapping[int, float]) -> Tree | None:
        """The tree with other values of some numbers, by their index; None where there is none."""
        document = self._document
        known = len(document.obstacles)
        with ExitStack() as restored:
            for index, value in values.items():
                put(self.numerals[index], value, restored)
            tree = read_document(document).tree
        del document.obstacles[known:]
        return tree

    def texts(self, values: Mapping[int, float]) -> Mapping[Path, bytes]:
        """The file with other values of some numbers."""
        return {self._document.path: with_values(self._document.data, self.numerals, values)}
