"""The numbers of an SDFormat file, and the tree that results where some of them are others."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path

from physics_crosscheck.harness.engines.sdf_shapes import is_automatic
from physics_crosscheck.harness.modelfiles.document import Document
from physics_crosscheck.harness.modelfiles.locations.xml import RawElement
from physics_crosscheck.harness.modelfiles.numbers import Numeral, numerals, put, with_values
from physics_crosscheck.harness.modelfiles.sdf.read import chosen_model, read_document
from physics_crosscheck.reference.mechanism.tree import Tree

_SAYING = re.compile(
    r"sdf/(world/)?(gravity|model/(pose|link/(pose|inertial/.*)|frame/pose"
    r"|joint/(pose|axis/(xyz|dynamics/(damping|spring_\w+)|mimic/.*))))"
)
"""Numbers that a tree is made of."""

_SHAPES = re.compile(r"sdf/(world/)?model/link/collision/(pose|density|geometry/.*)")
"""The same where a link's inertia follows from its shapes."""


class SdfNumbers:
    """The numbers of an SDFormat file that has a tree.

    Args:
        path: of the file.
        model: which of several models that move; empty: the only one.

    Attributes:
        numerals: those that do not belong to another model, in the file's order.
        saying: indices of those that may say something of the tree.
        unread: none, since a file that is no XML is refused.
    """

    unread: tuple[str, ...] = ()

    def __init__(self, path: Path, model: str = "") -> None:
        self._document, self._chosen = Document(path), model
        own, _ = chosen_model(self._document, model)
        self.numerals: tuple[Numeral, ...] = tuple(
            one for one in numerals(self._document) if _model_of(one.element) in (None, own)
        )
        self.saying = tuple(i for i, one in enumerate(self.numerals) if _is_relevant(one))

    def tree(self, values: Mapping[int, float]) -> Tree | None:
        """The tree with other values of some numbers, by their index; None where there is none."""
        document = self._document
        known = len(document.obstacles)
        with ExitStack() as restored:
            for index, value in values.items():
                put(self.numerals[index], value, restored)
            tree = read_document(document, self._chosen).tree
        del document.obstacles[known:]
        return tree

    def taken(self) -> tuple[tuple[str, Tree], ...]:
        """None: no engine compiles it."""
        return ()

    def texts(self, values: Mapping[int, float]) -> Mapping[Path, bytes]:
        """The file with other values of some numbers."""
        return {self._document.path: with_values(self._document.data, self.numerals, values)}


def _above(element: RawElement) -> Iterator[RawElement]:
    """Yield an element and those in which it stands, outwards."""
    above: RawElement | None = element
    while above is not None:
        yield above
        above = above.parent


def _model_of(element: RawElement) -> RawElement | None:
    """Return the outermost model in which an element stands; None where it stands in none."""
    return next((one for one in [*_above(element)][::-1] if one.tag in ("model", "include")), None)


def _is_relevant(one: Numeral) -> bool:
    if _SAYING.fullmatch(one.path):
        return True
    link = next((above for above in _above(one.element) if above.tag == "link"), None)
    return (
        link is not None
        and _SHAPES.fullmatch(one.path) is not None
        and any(is_automatic(part.attributes.get("auto")) for part in link.children)
    )
