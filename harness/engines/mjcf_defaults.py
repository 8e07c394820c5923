"""What the defaults of an MJCF make of an element: its attributes, with those of its class."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping

from physics_crosscheck.harness.engines.mjcf_source import MjcfSource
from physics_crosscheck.harness.engines.source import finite_numbers

MAIN = "main"

MOTORS = ("general", "motor", "position", "velocity", "intvelocity", "damper", "cylinder")
"""Actuators, whose defaults are of one and the same set in MuJoCo."""

BOUNDS = frozenset({"ctrllimited", "ctrlrange", "forcelimited", "forcerange", "group"})
"""What of those pulls at nothing."""

Attributes = Mapping[str, str]


class Defaults:
    """The classes of a file.

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

    def _read(self, default: ET.Element, above: Mapping[str, Attributes], name: str) -> None:
        own = dict(above)
        for one in default:
            if one.tag != "default":
                own[one.tag] = {**own.get(one.tag, {}), **one.attrib}
        self._classes[name] = own
        for nested in default.findall("default"):
            self._read(nested, own, nested.get("class", ""))

    def of(self, element: ET.Element, inherited: str = "", tag: str = "") -> Attributes:
        """The attributes of an element.

        Args:
            element: of the file.
            inherited: the `childclass` that it stands under.
            tag: of its defaults, where that is another one.

        Raises:
            EngineError: for a class that is none.
        """
        name = element.get("class") or inherited or self._main
        if name not in self._classes:
            raise self._source.refused(element, f"its class {name!r} is not among the defaults")
        return {**self._classes[name].get(tag or element.tag, {}), **element.attrib}

    def mixed(self, element: ET.Element, tags: tuple[str, ...]) -> bool:
        """Whether the defaults of its class state something for others of these tags."""
        name = element.get("class") or self._main
        found = self._classes.get(name, {})
        others = {key for tag in tags if tag != element.tag for key in found.get(tag, {})}
        return bool(others - BOUNDS)


def bodies_of(source: MjcfSource) -> Iterator[tuple[ET.Element, str]]:
    """Bodies, parents first, each with the `childclass` of what it holds."""
    for world in source.root.findall("worldbody"):
        yield from _below(world, world.get("childclass", ""))


def body_names(source: MjcfSource) -> dict[ET.Element, str]:
    """Return what each body is called in a copy: its own name, or one by its place among all."""
    bodies = (body for body, _ in bodies_of(source))
    return {body: body.get("name") or f"body_{i}" for i, body in enumerate(bodies)}


def _below(parent: ET.Element, inherited: str) -> Iterator[tuple[ET.Element, str]]:
    for body in parent.findall("body"):
        own = body.get("childclass", inherited)
        yield body, own
        yield from _below(body, own)


def shaped(source: MjcfSource, body: ET.Element) -> bool:
    """Whether a body's inertia follows from its geoms."""
    told = source.stated("compiler", "inertiafromgeom", "auto")
    return told == "true" or (told == "auto" and body.find("inertial") is None)


def numbers_of(
    source: MjcfSource, element: ET.Element, attributes: Attributes, key: str, otherwise: str
) -> list[float]:
    """The numbers of an attribute.

    Raises:
        EngineError: where one is none.
    """
    text = attributes.get(key, otherwise)
    numbers = finite_numbers(text)
    if numbers is None or not numbers:
        raise source.refused(element, f"<{element.tag} {key}> is {text!r}; expected finite numbers")
    return numbers


def number_of(
    source: MjcfSource, element: ET.Element, attributes: Attributes, key: str, otherwise: str = "0"
) -> float:
    """The number of an attribute; zeros may follow.

    Raises:
        EngineError: where it is none, or a polynomial.
    """
    first, *others = numbers_of(source, element, attributes, key, otherwise)
    if any(others):
        text = attributes.get(key, otherwise)
        raise source.unsupported(
            element, f"<{element.tag} {key}> is {text!r}; polynomials are not supported"
        )
    return first
