"""Every number in a file, with or without an address, and its context."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from contextlib import suppress

from physics_crosscheck.harness.documents.elements import read_elements
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.location import DECIMAL, SourceFile
from physics_crosscheck.harness.documents.number import Number, read_number
from .python import parsed
from .toml import toml_numbers
from .xml import attribute_words, text_words


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
