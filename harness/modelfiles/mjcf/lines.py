"""Lines of shapes and sites in an MJCF and its includes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import LocationError

_KINDS = ("geom", "site")


def shape_lines(path: Path, names: Sequence[str]) -> Mapping[str, tuple[Path, int]]:
    """Return file and line of each shape, by its place.

    Args:
        path: of the file.
        names: places of all shapes, in the engine's order: bodies depth first. Those without a name
            are matched by this order, if the file repeats no elements.
    """
    try:
        document = Document(path)
        elements = list(_shapes(document.root, path))
    except (LocationError, RecursionError):
        return {}
    lines: dict[str, tuple[Path, int]] = {}
    for kind in _KINDS:
        rows = [one for one in elements if one.tag == kind]
        places = [name for name in names if name.startswith(f"{kind}:")]
        if len(rows) == len(places) and all(map(_fits, rows, places)):
            lines |= {name: _place(one, path) for name, one in zip(places, rows, strict=True)}
        else:
            named = {f"{kind}:{one.get('name')}": one for one in rows if one.get("name")}
            lines |= {name: _place(named[name], path) for name in places if name in named}
    return lines


def _fits(element: XmlElement, place: str) -> bool:
    name = place.partition(":")[2]
    return element.get("name", name) == name


def _place(element: XmlElement, path: Path) -> tuple[Path, int]:
    file, line = element.place
    return file or path, line or 0


def _shapes(root: XmlElement, path: Path) -> Iterator[XmlElement]:
    """Yield the shapes of all `<worldbody>` elements, body by body."""
    worlds = [one for one in _children(root, path) if one.tag == "worldbody"]
    yield from _within([one for world in worlds for one in _children(world, path)], path)


def _within(elements: Sequence[XmlElement], path: Path) -> Iterator[XmlElement]:
    """Yield the shapes of one body, then those of the bodies in it."""
    flat = list(_flat(elements, path))
    yield from (element for element in flat if element.tag in _KINDS)
    for element in flat:
        if element.tag == "body":
            yield from _within(list(_children(element, path)), path)


def _flat(elements: Sequence[XmlElement], path: Path) -> Iterator[XmlElement]:
    """Yield elements and those within their frames."""
    for element in elements:
        yield element
        if element.tag == "frame":
            yield from _flat(list(_children(element, path)), path)


def _children(element: XmlElement, path: Path) -> Iterator[XmlElement]:
    """Yield children, with those of included files in place of `<include>`."""
    for child in element:
        if child.tag == "include":
            yield from _children(Document(path.parent / child.get("file")).root, path)
        else:
            yield child
