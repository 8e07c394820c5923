"""The place of a number in a file: an address resolved to its bytes.

Addresses by the file's format:

- XML (MJCF, URDF, SDFormat): `body[rod]/inertial@pos[2]`, `link[rod]/inertial/pose[2]`. The first
  step is any element of that tag, each next one a child of it. A name in brackets is the element's
  `name`, or without one its `reference`, `joint` or `class`. `@attribute` is an attribute, `[i]`
  its
  i-th number, counted from 0. Without `@` the address stands for the element's text, and `[i]` for
  a
  number of it if no such element has a name.
- Python: the name of a number at the top level, `MASS`.
- TOML: `settings.gravity[2]`, `spring[0].stiffness`.
- A format that an engine declares to have one of these syntaxes: as above.

`line_of` accepts more: an element without `@`, the first of several; a key of TOML with all its
content; in Python a call, `PinJoint()`, and an attribute of its result, `Space().damping`.

An address stands for one number. Files are parsed, so that comments and look-alikes don't count,
and the parser's value of a number must equal its bytes.
"""

import ast
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from physics_crosscheck.harness.documents.elements import Number, read_elements, read_number
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.reading import DECIMAL, Resolve, SourceFile, read_regular
from physics_crosscheck.harness.engines.registry import engines_reading
from .python import parsed, python_names, python_numbers, python_offset
from .toml import toml_keys, toml_numbers, toml_offset
from .xml import attribute_words, text_words, xml_numbers, xml_offset, xml_paths


def xml_literals(source: SourceFile) -> Iterator[Number]:
    """Yield numbers of attributes and of elements without children."""
    paths: dict[int, str] = {}
    for element in read_elements(source):
        outer = "" if element.parent is None else f"{paths[id(element.parent)]}/"
        path = paths[id(element)] = f"{outer}{element.tag}"
        for name in element.attributes:
            with suppress(LocationError):
                spans, words = attribute_words(element, name, source, name)
                yield from _words(source, spans, words, f"{path}@{name}")
        if element.text.strip() and not element.children:
            with suppress(LocationError):
                spans, words = text_words(element, source, element.tag)
                yield from _words(source, spans, words, path)


def _words(
    source: SourceFile, spans: list[tuple[int, int]], words: list[str], path: str
) -> Iterator[Number]:
    """Yield a list of numbers; text with other words is ignored."""
    if len(spans) == len(words) and all(map(DECIMAL.fullmatch, words)):
        for span, word in zip(spans, words, strict=True):
            yield read_number(source, span, float(word), path, path)


def python_literals(source: SourceFile) -> Iterator[Number]:
    """Yield all numbers in the code."""
    tree, starts = parsed(source)
    for statement in tree.body:
        name = ""
        if isinstance(statement, (ast.Assign, ast.AnnAssign)):
            target = statement.targets[0] if isinstance(statement, ast.Assign) else statement.target
            name = target.id if isinstance(target, ast.Name) else ""
        for node in ast.walk(statement):
            if isinstance(node, ast.Constant) and type(node.value) in (int, float):
                assert isinstance(node.value, (int, float))
                assert node.end_lineno is not None
                assert node.end_col_offset is not None
                start = starts[node.lineno - 1] + node.col_offset
                end = starts[node.end_lineno - 1] + node.end_col_offset
                with suppress(LocationError):
                    yield read_number(source, (start, end), float(node.value), name, name)


def toml_literals(source: SourceFile) -> Iterator[Number]:
    """Yield numbers that are values, or in lists and tables."""
    for key, span, value in toml_numbers(source):
        with suppress(LocationError):
            yield read_number(source, span, value, key, key)


__all__ = [
    "MARKUP",
    "LocationError",
    "find",
    "find_in",
    "line_of",
    "literals",
    "numbers",
    "read_source",
]


class _Grammar(NamedTuple):
    """The functions that find the numbers of a format.

    `addressed` finds the number of an address, `offset` the first byte of an address. `all` yields
    every number, addressed or not. `listed` yields the numbers of the wanted kinds that have an
    address; formats without kinds lack it.
    """

    addressed: Callable[[SourceFile], Resolve]
    offset: Callable[[SourceFile, str], int | None]
    all: Callable[[SourceFile], Iterator[Number]]
    listed: Callable[[SourceFile, re.Pattern[str]], Iterator[str]] | None = None


MARKUP = (".xml", ".urdf", ".sdf")
"""Suffixes of model files that are XML."""

_XML = _Grammar(xml_paths, xml_offset, xml_literals, xml_numbers)
_GRAMMARS = {
    **dict.fromkeys(MARKUP, _XML),
    ".py": _Grammar(python_names, python_offset, python_literals, python_numbers),
    ".toml": _Grammar(toml_keys, toml_offset, toml_literals),
}


def _grammar(file: Path) -> _Grammar:
    """Return the grammar of a file's suffix, or of the suffix whose syntax an engine declares."""
    suffix = file.suffix
    if suffix not in _GRAMMARS:
        like = (e.syntax[suffix] for e in engines_reading(suffix) if suffix in e.syntax)
        suffix = next(like, suffix)
    if suffix not in _GRAMMARS:
        suffixes = ", ".join(_GRAMMARS)
        raise LocationError(
            f"numbers can be located in {suffixes} files, not in {file.suffix} files", file=file
        )
    return _GRAMMARS[suffix]


def line_of(file: Path, address: str) -> int | None:
    """Return the line of the first number, element or statement of an address, counted from 1.

    None if the file can't be read or the address does not exist.
    """
    try:
        grammar = _grammar(file)
        source = read_source(file)
        offset = grammar.offset(source, address)
    except LocationError:
        return None
    return None if offset is None else source.line(offset)


def numbers(file: Path, kinds: str) -> tuple[str, ...]:
    """Return addresses of the plain numbers of a model file.

    Args:
        kinds: a regular expression of XML numbers: the element's tag with the attribute, as in
            `joint@damping`, or the tag alone for a number in its text.

    Raises:
        LocationError: for a file that can't be read or parsed, or whose numbers have no kinds.
    """
    listed = _grammar(file).listed
    if listed is None:
        raise LocationError(f"numbers of {file.suffix} files have no kinds", file=file)
    source = read_source(file)
    return tuple(dict.fromkeys(listed(source, re.compile(kinds))))


def literals(file: Path) -> tuple[Number, ...]:
    """Return every number of a file, in order.

    Raises:
        LocationError: for a file that can't be read or parsed.
    """
    result = _grammar(file).all(read_source(file))
    return tuple(sorted(result, key=lambda one: one.start))


def find(file: Path, addresses: Iterable[str]) -> dict[str, Number]:
    """Find the number of each address.

    Raises:
        LocationError: naming file, line, the nearest candidates and the remedy.
    """
    return find_in(read_source(file).data, file, addresses)


def find_in(data: bytes, file: Path, addresses: Iterable[str]) -> dict[str, Number]:
    """Find the number of each address in the present or future bytes of `file`."""
    grammar = _grammar(file)
    source = _decoded(data, file)
    resolve = grammar.addressed(source)
    return {address: read_number(source, *resolve(address), address) for address in addresses}


def read_source(file: Path) -> SourceFile:
    """Read a file that is UTF-8.

    Raises:
        LocationError: for a file that can't be read, or is not UTF-8.
    """
    try:
        return _decoded(read_regular(file), file)
    except OSError as error:
        raise LocationError(f"can't be read: {error.strerror or error}", file=file) from None


def _decoded(data: bytes, file: Path) -> SourceFile:
    try:
        data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise LocationError(
            f"byte {error.start} is not UTF-8; save the file as UTF-8", file=file
        ) from None
    return SourceFile(file, data)
