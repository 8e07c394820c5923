"""Defaults of an MJCF: the attributes of an element, including those of its class."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from physics_crosscheck.harness.documents.document import finite_numbers
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.engines.mjcf_source import MjcfSource

MAIN = "main"

Attributes = Mapping[str, str]


class Defaults:
    """The default classes of a file.

    Args:
        source: of the file.
    """

    def __init__(self, source: MjcfSource) -> None:
        self._source = source
        self._classes: dict[str, dict[str, Attributes]] = {MAIN: {}}
        self._main = MAIN
        for top in source.root.findall("default"):
            self._main = top.get("class", MAIN)
            self._read(top, self._classes.get(self._main, {}), self._main)

    def _read(self, default: XmlElement, above: Mapping[str, Attributes], name: str) -> None:
        merged = dict(above)
        for element in default:
            if element.tag != "default":
                merged[element.tag] = _overwritten(merged.get(element.tag, {}), element)
        self._classes[name] = merged
        for nested in default.findall("default"):
            self._read(nested, merged, nested.get("class", ""))

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
        if name not in self._classes:
            raise self._source.refused(element, f"its class {name!r} is not among the defaults")
        return _overwritten(self._classes[name].get(tag or element.tag, {}), element)


def _overwritten(above: Attributes, element: XmlElement) -> Attributes:
    """Return the attributes of an element, which overwrites the first numbers of its class."""
    merged = {**above, **element.attributes}
    for key in above.keys() & element.attributes.keys():
        words, rest = element.attributes[key].split(), above[key].split()
        if len(rest) > len(words) and finite_numbers(merged[key]) and finite_numbers(above[key]):
            merged[key] = " ".join([*words, *rest[len(words) :]])
    return merged


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
