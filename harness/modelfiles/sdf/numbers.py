"""The numbers of an SDFormat file, and the tree for other values."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack
from functools import cached_property
from pathlib import Path
from types import MappingProxyType

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.number import Number
from physics_crosscheck.harness.documents.sdf.read import chosen_model
from physics_crosscheck.harness.documents.sdf.shapes import is_automatic
from physics_crosscheck.reference.mechanism.assemble import assemble
from physics_crosscheck.reference.mechanism.tree import Tree
from ..numbers import ModelFile, set_temporarily
from .read import read_document

_RELEVANT = re.compile(
    r"sdf/(world/)?(gravity|model/(pose|link/(pose|inertial/.*)|frame/pose"
    r"|joint/(pose|(screw_)?thread_pitch|axis2?/(xyz|dynamics/(damping|spring_\w+)|mimic/.*))))"
)
"""Numbers that affect a tree."""

_SHAPES = re.compile(r"sdf/(world/)?model/link/collision/(pose|density|geometry/.*)")
"""Numbers that affect it too if a link's inertia follows from its shapes."""


class SdfNumbers(ModelFile):
    """The numbers of an SDFormat file that has a tree.

    Args:
        path: of the file.
        model: name of one of several moving models; empty for a single one.
        held: joints that are fixed.
        armatures: as in `Document`.

    Attributes:
        numerals: those that do not belong to another model, in order.
    """

    def __init__(
        self,
        path: Path,
        model: str = "",
        held: Collection[str] = (),
        armatures: Mapping[str, float] = MappingProxyType({}),
    ) -> None:
        self._document, self._chosen, self._held = Document(path), model, held
        super().__init__([self._document])
        self._document.armatures = armatures
        model_element, _ = chosen_model(self._document, model)
        self.numerals = tuple(
            one for one in self.numerals if _model_of(one.element) in (None, model_element)
        )

    @cached_property
    def relevant_numbers(self) -> tuple[int, ...]:
        """Indices of the numbers that may affect the tree."""
        return tuple(i for i, one in enumerate(self.numerals) if _is_relevant(one))

    def tree(self, values: Mapping[int, float]) -> Tree | None:
        """Return the tree with other values of some numbers, by index, or None."""
        document = self._document
        count = len(document.obstacles)
        with ExitStack() as restored:
            for index, value in values.items():
                set_temporarily(self.numerals[index], value, restored)
            robot = read_document(document, self._chosen)
        del document.obstacles[count:]
        if not self._held or robot.tree is None or robot.body_model is None:
            return robot.tree
        return assemble(robot.body_model.without(self._held)).tree


def _above(element: XmlElement) -> Iterator[XmlElement]:
    """Yield an element and its ancestors, outwards."""
    above: XmlElement | None = element
    while above is not None:
        yield above
        above = above.parent


def _model_of(element: XmlElement) -> XmlElement | None:
    """Return the outermost model that contains an element, or None."""
    return next((one for one in [*_above(element)][::-1] if one.tag in ("model", "include")), None)


def _is_relevant(number: Number) -> bool:
    if _RELEVANT.fullmatch(number.path):
        return True
    link = next((above for above in _above(number.element) if above.tag == "link"), None)
    return (
        link is not None
        and _SHAPES.fullmatch(number.path) is not None
        and any(is_automatic(part) for part in link.children)
    )
