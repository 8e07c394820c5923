"""URDFs that xacro expands from sources, and the line of the source of each of their elements."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar
from xml.dom import Node, expatbuilder

import msgspec

from physics_crosscheck.harness.documents.document import Document

XACRO = ".xacro"

_MARK = "crosscheck-source"
"""Attribute that carries an element's line through macros; the expanded file lacks it."""

_LINES: dict[str, dict[int, tuple[str, int]]] = {}
"""Source file and line by the line of an expanded file, by its path."""

T = TypeVar("T")


class ExpansionError(ValueError):
    """A source that can't be expanded; the message names the file, the reason and a remedy."""


def expand(source: Path) -> Path:
    """Expand a source for xacro into a URDF in the user's cache, and note the lines.

    `$(find package)` means packages of the environment, or folders above the source.

    Raises:
        ExpansionError: naming the file and the reason.
        ImportError: without xacrodoc.
    """
    import xacro
    from xacrodoc import packages

    whole = source.absolute()
    try:
        # A finder keeps the packages of earlier sources, which may have the same names.
        with _marked_parser(xacro), replaced(packages, "_finder", packages.PackageFinder()):
            packages.walk_up_from(whole)
            tree = xacro.process_file(str(whole), mappings={})
    except Exception as error:  # macros evaluate any Python expression
        raise ExpansionError(f"{source}: xacro: {_one_line(error)}; correct the source") from None
    marks = list(_marks(tree.documentElement))
    target = _target(whole)
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = target.with_name(f".{target.name}.{os.getpid()}")
    temporary.write_text(tree.toprettyxml(indent="  "), encoding="utf-8")
    os.replace(temporary, target)  # another process may read it
    document = Document(target)
    lines = {document.line(one): mark for one, mark in zip(document.elements, marks, strict=True)}
    _LINES[str(target)] = {line: mark for line, mark in lines.items() if mark is not None}
    return target


def expanded_name(source: Path) -> str:
    """Return the name of the URDF of a source: `arm.urdf` of `arm.urdf.xacro` or `arm.xacro`."""
    return f"{source.name.removesuffix(XACRO).removesuffix('.urdf')}.urdf"


def _target(source: Path) -> Path:
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = hashlib.sha256(str(source).encode()).hexdigest()[:12]
    return cache / "physics-crosscheck" / "xacro" / folder / expanded_name(source)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__


@contextmanager
def _marked_parser(xacro: Any) -> Iterator[None]:
    """Make xacro parse files such that each element states its file and line."""

    def parse(text: Any, filename: str | None = None) -> Any:
        if text is not None or filename is None:
            return original(text, filename)
        builder = _MarkingBuilder(filename)
        try:
            with open(filename, "rb") as file:
                return builder.parseFile(file)
        except OSError:
            return original(text, filename)  # raises the error that xacro expects

    original = xacro.parse
    with replaced(xacro, "parse", parse):
        yield


@contextmanager
def replaced(module: Any, name: str, function: object) -> Iterator[None]:
    """Replace a function of a library that has no parameter for it; not for several threads."""
    original = getattr(module, name)
    setattr(module, name, function)
    try:
        yield
    finally:
        setattr(module, name, original)


class _MarkingBuilder(expatbuilder.ExpatBuilderNS):
    """A parser that writes the line of each element into an attribute."""

    def __init__(self, file: str) -> None:
        super().__init__()
        self._file = file

    def start_element_handler(self, name: str, attributes: Any) -> None:
        super().start_element_handler(name, attributes)
        node = self.curNode
        # Macros refuse attributes that are not their parameters.
        if node.nodeType == Node.ELEMENT_NODE and not node.tagName.startswith("xacro:"):
            node.setAttribute(_MARK, f"{self._file}:{self.getParser().CurrentLineNumber}")


def _marks(element: Any) -> Iterator[tuple[str, int] | None]:
    """Yield the source of each element in document order, and remove the marks."""
    file, _, line = element.getAttribute(_MARK).rpartition(":")
    with suppress(Exception):
        element.removeAttribute(_MARK)
    yield (file, int(line)) if file else None
    for child in element.childNodes:
        if child.nodeType == Node.ELEMENT_NODE:
            yield from _marks(child)


def in_source(file: str, line: int | None) -> tuple[str, int] | None:
    """Return file and line of the source of a line of an expanded file, or None."""
    lines = _LINES.get(file)
    if lines is None or line is None:
        return None
    before = [one for one in lines if one <= line]
    return lines[max(before)] if before else None


def relocated(value: T, line_type: type[msgspec.Struct]) -> T:
    """Return a record whose lines of expanded files are those of their sources.

    Args:
        value: a record, or a tuple of records.
        line_type: type of the lines, with the fields `file`, `line`, `span` and `text`.
    """
    return _relocated(value, line_type) if _LINES else value


def _relocated(value: Any, line_type: type[msgspec.Struct]) -> Any:
    if isinstance(value, line_type):
        place = in_source(value.file, value.line)  # type: ignore[attr-defined]
        return value if place is None else line_type(file=place[0], line=place[1])
    if isinstance(value, tuple):
        return type(value)(_relocated(one, line_type) for one in value)
    if isinstance(value, msgspec.Struct):
        fields = {name: getattr(value, name) for name in value.__struct_fields__}
        changed = {key: _relocated(one, line_type) for key, one in fields.items()}
        different = {key: one for key, one in changed.items() if one is not fields[key]}
        return msgspec.structs.replace(value, **different) if different else value
    return value
