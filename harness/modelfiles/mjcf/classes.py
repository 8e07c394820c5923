"""Attributes of MJCF elements, with the classes of defaults that they belong to.

Each element of a class overwrites the first numbers of an attribute, as many as it states. So
`friction="1"` keeps the torsional friction of its class.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from physics_crosscheck.harness.documents.document import finite_numbers
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.engines.mjcf_defaults import MAIN
from physics_crosscheck.harness.engines.mjcf_source import ORIENTATIONS, MjcfSource
from physics_crosscheck.reference.mechanism.rotations import (
    DOUBLES,
    Array,
    about_axis,
    cross,
    to_quaternion,
)

Value = float | str
Values = tuple[Value, ...]


@dataclass(frozen=True, kw_only=True)
class StatedClasses:
    """Classes of defaults.

    Attributes:
        main: name of the outermost one.
        chains: for each class the elements that it consists of, outermost first.
    """

    main: str
    chains: Mapping[str, Sequence[XmlElement]]

    @staticmethod
    def from_source(source: MjcfSource) -> StatedClasses:
        """Read the classes of a file."""
        chains: dict[str, list[XmlElement]] = {}
        main = MAIN
        for top in source.root.findall("default"):
            main = top.get("class", MAIN)
            _add_class(chains, top, chains.get(main, []), main)
        return StatedClasses(main=main, chains=chains)

    def chain(self, element: XmlElement, inherited: str, tags: Collection[str]) -> Chain:
        """Return an element with the defaults of its class for some tags.

        Args:
            element: of the file.
            inherited: class of its bodies; empty for none.
            tags: of its defaults.
        """
        above = self.chains.get(element.get("class") or inherited or self.main, ())
        return Chain((*(one for one in above if one.tag in tags), element))


def _add_class(
    chains: dict[str, list[XmlElement]],
    default: XmlElement,
    above: Sequence[XmlElement],
    name: str,
) -> None:
    chains[name] = [*above, *(one for one in default if one.tag != "default")]
    for nested in default.findall("default"):
        _add_class(chains, nested, chains[name], nested.get("class", ""))


class StatedPlace(NamedTuple):
    """A number of a file: its element, its attribute, and its index there."""

    element: XmlElement
    key: str
    word: int


@dataclass(frozen=True)
class Chain:
    """An element of a file after the defaults that it overwrites, which come first."""

    elements: Sequence[XmlElement]

    def word(self, key: str, default: str = "") -> str:
        """Return the last text of an attribute."""
        texts = (one.attributes[key] for one in reversed(self.elements) if key in one.attributes)
        return next(texts, default)

    def states(self, key: str) -> bool:
        """Return whether an element states an attribute."""
        return any(key in one.attributes for one in self.elements)

    def numbers(self, key: str, default: Sequence[float]) -> tuple[float, ...]:
        """Return an attribute's numbers; each element overwrites the first ones."""
        values = list(default)
        for element in self.elements:
            overwrite(values, element, key)
        return tuple(values)

    def number(self, key: str, default: float) -> float:
        """Return the number of an attribute."""
        return self.numbers(key, [default])[0]

    def effective(self, keys: Collection[str]) -> Iterator[StatedPlace]:
        """Yield the numbers of some attributes that no later element overwrites."""
        for key in keys:
            first = 0
            for element in reversed(self.elements):
                count = len(finite_numbers(element.get(key)) or []) if element.get(key) else 0
                yield from (StatedPlace(element, key, word) for word in range(first, count))
                first = max(first, count)

    def limits(
        self, prefix: str, *, automatic: bool, scale: float = 1.0
    ) -> tuple[float, float] | None:
        """Return a range if it limits.

        Args:
            prefix: of `range` and `limited`, such as `ctrl`.
            automatic: whether a range alone limits.
            scale: of its numbers.
        """
        low, high = self.numbers(f"{prefix}range", (0.0, 0.0))
        return is_limit(self.word(f"{prefix}limited", "auto"), (low * scale, high * scale),
                        automatic=automatic)  # fmt: skip


def is_limit(
    word: str, limits: tuple[float, float], *, automatic: bool
) -> tuple[float, float] | None:
    """Return a range if it limits, by the word of `limited`."""
    on = word == "true" or (word == "auto" and automatic and limits[0] < limits[1])
    return limits if on else None


def overwrite(values: list[float], element: XmlElement, key: str) -> None:
    """Overwrite the first numbers with those that an element states, not more than there are."""
    stated = finite_numbers(element.get(key)) if key in element.attributes else None
    for i, value in enumerate((stated or [])[: len(values)]):
        values[i] = value


def radians(source: MjcfSource) -> float:
    """Return the unit of angles, rad."""
    return 1.0 if source.stated("compiler", "angle") == "radian" else math.pi / 180


def orientation(chain: Chain, source: MjcfSource) -> tuple[float, ...]:
    """Return the orientation of an element as a unit quaternion (w, x, y, z)."""
    others = ORIENTATIONS.keys() - {"quat"}
    stated = (others & one.attributes.keys() for one in reversed(chain.elements))
    key = next((key for keys in stated for key in keys), "quat")  # others overrule quaternions
    numbers = np.array(chain.numbers(key, ORIENTATIONS[key]), dtype=float)
    if key == "quat":
        return tuple((numbers / np.linalg.norm(numbers)).tolist())
    if key == "axisangle":
        turn = _about(numbers[:3], numbers[3] * radians(source))
    elif key == "euler":
        turn = np.eye(3)
        sequence = source.stated("compiler", "eulerseq", "xyz")
        for letter, angle in zip(sequence, numbers * radians(source), strict=True):
            step = _about(np.eye(3)["xyz".index(letter.lower())], angle)
            # A lower-case letter is an axis that turns with the element.
            turn = turn @ step if letter.islower() else step @ turn
    elif key == "xyaxes":
        x, y = numbers[:3] / np.linalg.norm(numbers[:3]), numbers[3:]
        y = y - (x @ y) * x
        y = y / np.linalg.norm(y)
        turn = np.stack([x, y, cross(x, y)], axis=1)
    else:
        turn = to_axis(numbers)
    return to_quaternion(turn)


def _about(axis: Array, angle: float) -> Array:
    """Return the rotation about an axis of any length."""
    return about_axis(axis / np.linalg.norm(axis), np.array(angle), DOUBLES)


def to_axis(axis: Array) -> Array:
    """Return the smallest rotation that turns the z axis to another one."""
    normal = cross(np.array([0.0, 0.0, 1.0]), axis)
    sine = float(np.linalg.norm(normal))
    normal = normal if sine else np.array([1.0, 0.0, 0.0])
    return _about(normal, math.atan2(sine, axis[2]))
