"""Defaults of an MJCF: the attributes of an element, including those of its class.

Each element of a class overwrites the first numbers of an attribute, as many as it states. So
`friction="1"` keeps the torsional friction of its class.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from physics_crosscheck.harness.documents.document import finite_numbers
from physics_crosscheck.harness.documents.elements import XmlElement
from .mjcf_source import MjcfSource

WHOLE = "springlength"
"""The attribute whose single number overwrites both of its class."""

Attributes = Mapping[str, str]
Value = float | str
Values = tuple[Value, ...]


StatedPlace = tuple[XmlElement, str, int]
"""A number of a file: its element, its attribute, and its index there."""


@dataclass(frozen=True)
class Chain:
    """An element of a file after the defaults that it overwrites, which come first."""

    elements: Sequence[XmlElement]

    @property
    def attributes(self) -> Attributes:
        """All attributes, with lists of numbers completed."""
        merged: dict[str, str] = {}
        for element in self.elements:
            for key, text in element.attributes.items():
                words, above = text.split(), merged.get(key, "")
                numeric = finite_numbers(text) and finite_numbers(above) and key != WHOLE
                merged[key] = " ".join([*words, *above.split()[len(words) :]]) if numeric else text
        return merged

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
                count = len(finite_numbers(element.get(key)) or [])
                yield from ((element, key, word) for word in range(first, count))
                first = max(first, len(_stated(element, key)))

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
    for i, value in enumerate(_stated(element, key)[: len(values)]):
        values[i] = value


def _stated(element: XmlElement, key: str) -> list[float]:
    """Return the numbers that an element states; a single length of a spring is its range."""
    numbers = finite_numbers(element.get(key)) or []
    return numbers * 2 if key == WHOLE and len(numbers) == 1 else numbers


class Defaults:
    """The default classes of a file.

    Args:
        source: of the file.
    """

    def __init__(self, source: MjcfSource) -> None:
        self._source = source
        self._classes: dict[str, list[XmlElement]] = {}
        self._main = "main"
        for top in source.root.findall("default"):
            self._main = top.get("class", "main")
            self._read(top, self._classes.get(self._main, []), self._main)

    def _read(self, default: XmlElement, above: Sequence[XmlElement], name: str) -> None:
        self._classes[name] = [*above, *(one for one in default if one.tag != "default")]
        for nested in default.findall("default"):
            self._read(nested, self._classes[name], nested.get("class", ""))

    def chain(self, element: XmlElement, inherited: str, tags: Collection[str]) -> Chain:
        """Return an element with the defaults of its class for some tags.

        Args:
            element: of the file.
            inherited: the `childclass` that applies to it; empty for none.
            tags: of its defaults.
        """
        above = self._classes.get(element.get("class") or inherited or self._main, ())
        return Chain((*(one for one in above if one.tag in tags), element))

    def attributes(self, element: XmlElement, inherited: str = "", tag: str = "") -> Attributes:
        """Return the attributes of an element.

        Args:
            element: of the file.
            inherited: the `childclass` that applies to it.
            tag: of its defaults, if it differs.

        Raises:
            EngineError: for an unknown class.
        """
        name = element.get("class") or inherited or self._main
        if name != "main" and name not in self._classes:
            raise self._source.refused(element, f"its class {name!r} is not among the defaults")
        return self.chain(element, inherited, (tag or element.tag,)).attributes


def bodies_of(source: MjcfSource) -> Iterator[tuple[XmlElement, str]]:
    """Yield bodies, parents first, each with the `childclass` of its content."""
    for world in source.root.findall("worldbody"):
        yield from _below(world, world.get("childclass", ""))


def body_names(source: MjcfSource) -> dict[XmlElement, str]:
    """Return each body's name in a copy: its own, or one by its index."""
    bodies = (body for body, _ in bodies_of(source))
    return {body: body.get("name") or f"body_{i}" for i, body in enumerate(bodies, 1)}


def _below(parent: XmlElement, inherited: str) -> Iterator[tuple[XmlElement, str]]:
    for body in parent.findall("body"):
        childclass = body.get("childclass", inherited)
        yield body, childclass
        yield from _below(body, childclass)


def has_shape_inertia(source: MjcfSource, body: XmlElement) -> bool:
    """Return whether a body's inertia follows from its geoms."""
    mode = source.stated("compiler", "inertiafromgeom", "auto")
    return mode == "true" or (mode == "auto" and body.find("inertial") is None)


def numbers_of(
    source: MjcfSource, element: XmlElement, attributes: Attributes, key: str, otherwise: str
) -> list[float]:
    """Return the numbers of an attribute.

    Raises:
        EngineError: if the text is not numbers.
    """
    text = attributes.get(key, otherwise)
    numbers = finite_numbers(text)
    if numbers is None or not numbers:
        raise source.refused(element, f"<{element.tag} {key}> is {text!r}; expected finite numbers")
    return numbers


def number_of(
    source: MjcfSource, element: XmlElement, attributes: Attributes, key: str, otherwise: str = "0"
) -> float:
    """Return the number of an attribute; zeros may follow.

    Raises:
        EngineError: if the text is not a number, or is a polynomial.
    """
    first, *others = numbers_of(source, element, attributes, key, otherwise)
    if any(others):
        text = attributes.get(key, otherwise)
        raise source.unsupported(
            element, f"<{element.tag} {key}> is {text!r}; polynomials are not supported"
        )
    return first
