"""Where a number stands in a file: an address resolved to the bytes that spell it.

Addresses by the file's format:

- XML (MJCF, URDF, SDFormat): `body[rod]/inertial@pos[2]`, `link[rod]/inertial/pose[2]`. The first
  step is any element of that tag, each next one a child of it. A name in brackets is the element's
  `name`, or where it has none its `reference`, `joint` or `class`. `@attribute` is an attribute,
  `[i]` its i-th number, counted from 0; without `@` the element's text is meant, and `[i]` is a
  number of it where no such element has a name.
- Python: the name of a number at the top level, `MASS`.
- TOML: `settings.gravity[2]`, `spring[0].stiffness`.
- A format that an engine says is `written_like` one of these: as there.

`line_of` takes more: an element without `@`, of several the first; a key of TOML with all that is
in it; in Python a call, `PinJoint()`, and an attribute of what it makes, `Space().damping`.

An address means one number. Files are read through their parsers: comments and look-alikes don't
count, and what the parser makes of a number must be what its bytes say.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from physics_crosscheck.harness.engines.registry import readers
from physics_crosscheck.harness.modelfiles.locations.literals import (
    Literal,
    python_literals,
    toml_literals,
    xml_literals,
)
from physics_crosscheck.harness.modelfiles.locations.location import (
    Location,
    LocationError,
    Resolve,
    Source,
)
from physics_crosscheck.harness.modelfiles.locations.python import (
    python_names,
    python_numbers,
    python_offset,
)
from physics_crosscheck.harness.modelfiles.locations.toml import toml_keys, toml_offset
from physics_crosscheck.harness.modelfiles.locations.xml import xml_numbers, xml_offset, xml_paths

__all__ = [
    "Literal",
    "Location",
    "LocationError",
    "find",
    "find_in",
    "line_of",
    "literals",
    "numbers",
]


class _Grammar(NamedTuple):
    """How the numbers of a format are found.

    `addressed` finds the number that an address means, `offset` the first byte that one may mean;
    `all` tells every number, addressed or not; `listed` those of the wanted kinds that have an
    address, None where a format has no kinds.
    """

    addressed: Callable[[Source], Resolve]
    offset: Callable[[Source, str], int | None]
    all: Callable[[Source], Iterator[Literal]]
    listed: Callable[[Source, re.Pattern[str]], Iterator[str]] | None = None


_GRAMMARS = {
    ".xml": _Grammar(xml_paths, xml_offset, xml_literals, xml_numbers),
    ".urdf": _Grammar(xml_paths, xml_offset, xml_literals, xml_numbers),
    ".sdf": _Grammar(xml_paths, xml_offset, xml_literals, xml_numbers),
    ".py": _Grammar(python_names, python_offset, python_literals, python_numbers),
    ".toml": _Grammar(toml_keys, toml_offset, toml_literals),
}


def _grammar(file: Path) -> _Grammar:
    """By the file's ending, or by the one that an engine says it is written like."""
    suffix = file.suffix
    if suffix not in _GRAMMARS:
        like = (e.written_like[suffix] for e in readers(suffix) if suffix in e.written_like)
        suffix = next(like, suffix)
    if suffix not in _GRAMMARS:
        known = ", ".join(_GRAMMARS)
        raise LocationError(
            f"numbers can be located in {known} files, not in {file.suffix} files", file=file
        )
    return _GRAMMARS[suffix]


def line_of(file: Path, address: str) -> int | None:
    """Line of the first number, element or statement that an address means, counted from 1.

    None where nothing in the file is so called, or the file can't be read.
    """
    try:
        grammar = _grammar(file)
        source = _decoded(_read(file), file)
        found = grammar.offset(source, address)
    except LocationError:
        return None
    return None if found is None else source.line(found)


def numbers(file: Path, kinds: str) -> tuple[str, ...]:
    """Addresses of the plain numbers of a model file.

    Args:
        kinds: a regular expression for what numbers of XML are wanted: the element's tag with the
            attribute, as in `joint@damping`, or the tag alone for a number in its text.

    Raises:
        LocationError: for a file that can't be read or parsed, or whose numbers have no kinds.
    """
    listed = _grammar(file).listed
    if listed is None:
        raise LocationError(f"numbers of {file.suffix} files have no kinds", file=file)
    source = _decoded(_read(file), file)
    return tuple(dict.fromkeys(listed(source, re.compile(kinds))))


def literals(file: Path) -> tuple[Literal, ...]:
    """Every number of a file, in its order.

    Raises:
        LocationError: for a file that can't be read or parsed.
    """
    found = _grammar(file).all(_decoded(_read(file), file))
    return tuple(sorted(found, key=lambda one: one.location.start))


def find(file: Path, addresses: Iterable[str]) -> dict[str, Location]:
    """Find the number that each address means.

    Raises:
        LocationError: naming file, line, the nearest candidates and the remedy.
    """
    return find_in(_read(file), file, addresses)


def find_in(data: bytes, file: Path, addresses: Iterable[str]) -> dict[str, Location]:
    """Find the number that each address means in bytes that are, or are to be, those of `file`."""
    grammar = _grammar(file)
    source = _decoded(data, file)
    resolve = grammar.addressed(source)
    return {address: source.place(resolve(address), address) for address in addresses}


def _read(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise LocationError(f"can't be read: {error.strerror}", file=file) from None


def _decoded(data: bytes, file: Path) -> Source:
    try:
        data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise LocationError(
            f"byte {error.start} is not UTF-8; save the file as UTF-8", file=file
        ) from None
    return Source(file, data)
