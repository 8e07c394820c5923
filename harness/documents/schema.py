"""Names that the schemas of URDF and SDFormat allow, and names of a file that they don't."""

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path

from .elements import XmlElement

_SCHEMAS = Path(__file__).with_name("schemas.toml")

_UNREAD = ("safety_controller", "calibration")
"""Elements of the format that no engine reads."""

CUTOFF = 0.75
"""Smallest similarity of a name and the one that it probably stands for, as difflib measures it."""


Unknown = tuple[tuple[str, str], tuple[Path | None, int | None], str, bool]
"""A tag and its child or attribute (with `@`) that the schema lacks, its file and line, a sentence
with the remedy, and whether engines read the name that is misspelled: then its number is lost."""


def unknown_names(root: XmlElement) -> Iterator[Unknown]:
    """Yield misspelled and misplaced names of a URDF or an SDFormat file, by its first element."""
    allowed = _schemas().get(root.tag, {})
    for element in _listed(root, allowed):
        names = allowed[element.tag]
        places = [(f"@{key}", element.attribute_place(key)) for key in element.attributes]
        attributes = {name for name, _ in places}
        for name, place in (*places, *((child.tag, child.place) for child in element)):
            if name in names or ":" in name or name.startswith("@xmlns"):
                continue
            options = {one for one in names if (one[0] == "@") == (name[0] == "@")}
            close = similar(name, options - attributes)
            parent = "" if close else _holder(name, names, allowed)
            if close or parent:
                hint = f"did you mean {_written(close)}?" if close else ""
                hint = hint or f"it belongs in {parent} of <{element.tag}>"
                sentence = f"{_written(name)} of <{element.tag}> is not in the format, so engines "
                is_lost = bool(close) and element.tag not in _UNREAD
                yield (element.tag, name), place, f"{sentence}ignore it; {hint}", is_lost


def _holder(name: str, names: Iterable[str], allowed: Mapping[str, frozenset[str]]) -> str:
    """Return a child that may have a name, or a child of a child: `<axis>/<dynamics>`."""
    direct = [tag for tag in sorted(names) if tag in allowed]
    paths = [(tag,) for tag in direct] + [(a, b) for a in direct for b in sorted(allowed[a])]
    held = (path for path in paths if name in allowed.get(path[-1], ()))
    return "/".join(map(_written, next(held, ())))


def remedy_with_hint(name: str, names: Iterable[str], remedy: str) -> str:
    """Return a remedy for an unknown name, with a similar name if there is one."""
    close = similar(name, names)
    return f"{remedy}; did you mean {close!r}?" if close else remedy


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
