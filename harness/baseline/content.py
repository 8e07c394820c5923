"""Statements of robot files: hashes without comments, format and colors; their changes by line."""

import difflib
import os
import re
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.elements import (
    XmlElement,
    attribute_span,
    end_offset,
    text_span,
)
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.reading import DECIMAL, SourceFile
from physics_crosscheck.harness.engines.registry import engines_reading
from physics_crosscheck.harness.modelfiles.code_reads import digest, digest_of
from physics_crosscheck.harness.modelfiles.numbers import ElementAddresses
from physics_crosscheck.harness.modelfiles.parts import parts
from physics_crosscheck.harness.records.baseline import ChangedLine

_LOOKS = "visual geometry"
"""Purpose of numbers that only pictures show (`Engine.non_physical`)."""

_SAME_DIGITS = 13
"""Digits up to which two numbers are the same: an editor may round the last ones."""

MOST_SHOWN = 100
"""Largest number of characters shown of an element or a line."""

Words = tuple[str, ...]
Statement = tuple[int, str, tuple[tuple[str, Words], ...]]
"""Depth and tag of an element, with the words of its attributes and, without a name, its text."""


def content_hashes(model: Path) -> dict[str, str]:
    """Return hashes of the statements in a robot's files, by names relative to its folder.

    Comments, format, the robot's own name, and what only pictures show do not count; nor does a
    file, such as a mesh, that only pictures need. In a URDF or SDF, neither does order.

    Raises:
        OSError: for a file that can't be read.
    """
    hashes, named, is_xml = dict[Path, str](), set[str](), True
    files = {model: True, **parts(model)}
    for path in (path for path, part in files.items() if part):
        try:
            statements = _statements(Document(path), model.suffix)
        except LocationError:
            hashes[path], is_xml = digest(path), False
            continue
        hashes[path] = digest_of(repr(statements).encode())
        words = (word for *_, rows in statements for _, row in rows for word in row)
        named |= {word.replace("\\", "/").rpartition("/")[2] for word in words}
    for path in files:
        if path not in hashes and (path.name in named or " " in path.name or not is_xml):
            hashes[path] = digest(path)
    return {
        Path(os.path.relpath(path, model.parent)).as_posix(): value
        for path, value in hashes.items()
    }


def _statements(document: Document, suffix: str) -> list[Statement]:
    """Return what a file states, element by element, without what only pictures show."""
    paths, statements = dict[int, str](), list[Statement]()
    for element in _in_order(document.root, is_sorted=suffix in (".urdf", ".sdf")):
        outer = "" if element.parent is None else f"{paths[id(element.parent)]}/"
        path = paths[id(element)] = f"{outer}{element.tag}"
        if _only_looks(path, "", suffix):
            continue
        rows = [
            row
            for row in _rows(element)
            if f"<{path} {row[0]}" not in _TITLES and not _only_looks(path, row[0], suffix)
        ]
        statements.append((element.depth, element.tag, tuple(rows)))
    return statements


_TITLES = ("<robot name", "<mujoco model")
"""Names that nothing refers to."""


def _in_order(element: XmlElement, *, is_sorted: bool) -> Iterator[XmlElement]:
    """Yield an element and those within it; sorted by tag and name in a format without order."""
    yield element
    children = element.children
    if is_sorted:
        children = sorted(children, key=lambda one: (one.tag, one.get("name")))
    for child in children:
        yield from _in_order(child, is_sorted=is_sorted)


@lru_cache(maxsize=4096)
def _only_looks(path: str, key: str, suffix: str) -> bool:
    """Return whether only pictures show an element, or one of its attributes."""
    if key == "group":  # it can select the shapes that have mass
        return False
    return any(
        re.fullmatch(pattern, f"{path}{end}{key}")
        for engine in engines_reading(suffix)
        for pattern, purpose in engine.non_physical.items()
        if purpose == _LOOKS
        for end in ("@", "/@", "/")
    )


def _rows(element: XmlElement) -> Iterator[tuple[str, Words]]:
    """Yield the attributes in the order of their names, then the text, as words."""
    for key in sorted(element.attributes):
        yield key, _words(element.attributes[key])
    if text := _words(element.text):
        yield "", text


def _words(text: str) -> Words:
    """Return the words of a text, with numbers in one spelling."""
    return tuple(
        repr(float(f"{float(word):.{_SAME_DIGITS - 1}e}") + 0.0)
        if DECIMAL.fullmatch(word)
        else word
        for word in text.replace(",", " ").split()
    )


def element_changes(file: Path, old: str, new: str) -> list[ChangedLine]:
    """Return each changed attribute and element of an XML file; none if a text is not XML."""
    try:
        before, after = (Document(file, text.encode()) for text in (old, new))
    except LocationError:
        return []
    addresses, changes = ElementAddresses(after), list[ChangedLine]()
    last = after.source.line(len(after.data.rstrip()))
    for was, now in _pairs(before.elements, after.elements):
        if was is not None and now is not None:
            changes += _attribute_changes(after, addresses, was, now)
        elif now is not None:
            text = _shown(now, after)
            line = after.line(now)
            changes.append(ChangedLine(line=line, message=f"+ {text}", edit=f"added: {text}"))
        elif was is not None:
            text = _shown(was, before)
            line = min(before.line(was), last)
            changes.append(ChangedLine(line=line, message=f"- {text}", edit=f"removed: {text}"))
    return changes


_Pair = tuple[XmlElement | None, XmlElement | None]


def _pairs(before: Sequence[XmlElement], after: Sequence[XmlElement]) -> Iterator[_Pair]:
    """Yield changed elements in pairs; of one that was added or removed, not those within it."""
    old, new = ([(one.depth, one.tag, *_rows(one)) for one in side] for side in (before, after))
    for tag, a, b, c, d in difflib.SequenceMatcher(None, old, new, autojunk=False).get_opcodes():
        if tag != "equal":
            yield from _paired(before[a:b], after[c:d])


def _paired(before: Sequence[XmlElement], after: Sequence[XmlElement]) -> Iterator[_Pair]:
    """Yield elements of two unequal parts of a file: pairs of one name or tag, then the others."""
    old, new = ([(one.depth, one.tag, one.identity) for one in side] for side in (before, after))
    if [key[:2] for key in old] == [key[:2] for key in new]:
        yield from zip(before, after, strict=True)
        return
    for tag, a, b, c, d in difflib.SequenceMatcher(None, old, new, autojunk=False).get_opcodes():
        if tag == "equal":
            yield from zip(before[a:b], after[c:d], strict=True)
        else:
            yield from ((one, None) for one in _outermost(before[a:b]))
            yield from ((None, one) for one in _outermost(after[c:d]))


def _outermost(elements: Sequence[XmlElement]) -> list[XmlElement]:
    inner = {id(child) for one in elements for child in one.children}
    return [one for one in elements if id(one) not in inner]


def _attribute_changes(
    document: Document, addresses: ElementAddresses, was: XmlElement, now: XmlElement
) -> Iterator[ChangedLine]:
    old, new = dict(_rows(was)), dict(_rows(now))
    source = SourceFile(document.path, document.data)
    for key in [*new, *(key for key in old if key not in new)]:
        if old.get(key) == new.get(key):
            continue
        line = document.line(now)
        if key in new:
            span = attribute_span(now, key, source) if key else text_span(now, source)
            line = document.source.line(span[0])
        address = addresses.address(now, key) + (f"@{key}" if key else "")
        texts = [
            (one.attributes.get(key, "") if key else one.text).replace(",", " ").split()
            for one in (was, now)
        ]
        places = [""]
        if len(texts[0]) == len(texts[1]) > 1:
            places = [f"[{i}]" for i in range(len(texts[0]))]
        else:
            texts = [[" ".join(words)] for words in texts]
        for place, a, b in zip(places, *texts, strict=True):
            if _words(a) != _words(b):
                yield changed_value(line, f"{address}{place}", a, b)


def changed_value(line: int, address: str, old: str, new: str) -> ChangedLine:
    """Describe a changed value; an empty text stands for none."""
    moved = f"{_short(old) or 'none'} -> {_short(new) or 'none'}"
    spoken = spoken_address(address)
    return ChangedLine(line=line, message=f"{address} {moved}", edit=f"{spoken} {moved}", old=old)


def spoken_address(address: str) -> str:
    """Return a readable address of a literal: `joint[x]@damping` becomes `damping of joint x`."""
    *_, name = re.split(r"[@/]", address.removesuffix("@value"))
    owners = re.findall(r"(\w+)\[([^\]@/]*[^\]@/\d][^\]@/]*)\]", address)
    if not owners or name.startswith(f"{owners[-1][0]}["):
        return name
    kind, owner = owners[-1]
    return f"{name} of {kind} {owner}"


def _shown(element: XmlElement, document: Document) -> str:
    """Return the beginning of an element as it is written."""
    end = end_offset(element, SourceFile(document.path, document.data))
    return _short(document.data[element.start : end].decode("utf-8", errors="replace"))


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= MOST_SHOWN else f"{text[:MOST_SHOWN]}..."
