"""Names that the schemas of URDF and SDFormat allow, and names of a file that they don't."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from .elements import XmlElement

_SCHEMAS = Path(__file__).with_name("schemas.toml")

CUTOFF = 0.75
"""Smallest similarity of a name and the one that it probably stands for, as difflib measures it."""


@dataclass(frozen=True, kw_only=True)
class UnknownName:
    """An element or attribute that the schema does not have at its place.

    Attributes:
        element: that has this child or attribute.
        name: a tag, or an attribute with a leading `@`.
        close: name that it probably stands for, in the same form; empty if none is similar.
        parent: tags of the child that may have it; empty if it is not just in another place.
        place: its file and line.
    """

    element: XmlElement
    name: str
    close: str
    parent: str
    place: tuple[Path | None, int | None]

    @property
    def sentence(self) -> str:
        """The problem and its remedy, such as `did you mean damping?`."""
        inside = f"<{self.element.tag}>"
        shown, close = (_written(one) for one in (self.name, self.close))
        hint = f"it belongs in {self.parent} of {inside}"
        hint = hint if self.parent else f"did you mean {close}?"
        return f"{shown} of {inside} is not in the format, so engines ignore it; {hint}"


def unknown_names(root: XmlElement) -> Iterator[UnknownName]:
    """Yield misspelled and misplaced names of a URDF or an SDFormat file, by its first element."""
    allowed = _schemas().get(root.tag, {})
    for element in _listed(root, allowed):
        names = allowed[element.tag]
        present = {f"@{key}" for key in element.attributes}
        rows = [(f"@{key}", element.attribute_place(key)) for key in element.attributes]
        rows += [(child.tag, child.place) for child in element]
        for name, place in rows:
            if name in names or ":" in name or name.startswith("@xmlns"):
                continue
            options = [one for one in names if one[0] == "@" or name[0] != "@"]
            close = similar(name, [one for one in options if one not in present])
            parent = "" if close else _holder(name, names, allowed)
            if close or parent:
                yield UnknownName(
                    element=element, name=name, close=close, parent=parent, place=place
                )


def _holder(name: str, names: Iterable[str], allowed: Mapping[str, frozenset[str]]) -> str:
    """Return a child that may have a name, or a child of a child: `<axis>/<dynamics>`."""
    direct = {tag: allowed[tag] for tag in sorted(names) if tag in allowed}
    for tag, inner in direct.items():
        if name in inner:
            return f"<{tag}>"
    deeper = ((tag, one) for tag, inner in direct.items() for one in sorted(inner))
    held = (f"<{tag}>/<{one}>" for tag, one in deeper if name in allowed.get(one, ()))
    return next(held, "")


def similar(name: str, names: Iterable[str]) -> str:
    """Return the name most similar to a misspelled one, or an empty text."""
    from difflib import get_close_matches

    by_small = {one.lower(): one for one in names}
    close = get_close_matches(name.lower(), by_small, n=1, cutoff=CUTOFF)
    return by_small[close[0]] if close else ""


def _listed(element: XmlElement, allowed: Mapping[str, frozenset[str]]) -> Iterator[XmlElement]:
    """Yield an element and those below it whose content the schema lists."""
    if element.tag in allowed:
        yield element
        for child in element:
            yield from _listed(child, allowed)


def _written(name: str) -> str:
    return name[1:] if name.startswith("@") else f"<{name}>"


@lru_cache(maxsize=1)
def _schemas() -> Mapping[str, Mapping[str, frozenset[str]]]:
    tables = tomllib.loads(_SCHEMAS.read_text(encoding="utf-8"))
    return {
        language: {tag: frozenset(names.split()) for tag, names in rows.items()}
        for language, rows in tables.items()
    }
