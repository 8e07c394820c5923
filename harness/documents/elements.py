"""XML files as elements with their bytes, read as tolerantly as engines read them.

Engines' parsers, of the TinyXML-2 family, accept blank lines before the declaration, a byte order
mark, Latin-1 (whatever is declared), two hyphens in a comment, and a zero byte at the end.

A copy of an element can be changed; its text is then that of the file with these changes: all other
bytes stay.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from xml.parsers import expat

from .errors import RESTORE, LocationError, RefusedFileError, quote
from .reading import MAX_KEPT_BYTES, MAX_MODEL_BYTES, SourceFile, Span, apply_edits, read_regular

_HEAD = re.compile(rb"\s*<\?xml.*?\?>", re.DOTALL)
_ENCODING = re.compile(rb"encoding\s*=\s*[\"']([\w.-]+)[\"']")
UTF_16 = (b"\xff\xfe", b"\xfe\xff")
"""First bytes of UTF-16 text, which no engine reads."""


_IDENTITIES = ("name", "reference", "joint", "class")
_ATTRIBUTE = re.compile(rb"""\s+([^\s=/>]+)\s*=\s*(?:"([^"]*)"|'([^']*)')""")
_TAG = re.compile(rb"<[^\s/>]+")
_EMPTY = re.compile(rb"\s*/>")
_ELEMENT = re.compile(rb"<([A-Za-z_][^\s/>]*)")

MAX_XML_DEPTH = 300
"""The deepest nesting of elements: engines' parsers fail or crash at some hundreds."""
_DECLARATION = re.compile(rb"<!(?!--|\[CDATA\[)")
_HIDDEN = re.compile(rb"<!--.*?-->|<!\[CDATA\[.*?\]\]>", re.DOTALL)
NO_ATTRIBUTES: Mapping[str, str] = MappingProxyType({})


@dataclass(eq=False, slots=True)
class XmlElement:
    """An element of a file, or one that an edit adds to a copy.

    Attributes:
        start, end: its first byte, and that of its end tag, or the one after an empty element.
        text: all text of it, without that of its children.
        source: the file; None for an added element.
        original: the file's element that this one is a copy of, or None.
    """

    tag: str
    attributes: dict[str, str] = field(default_factory=dict)
    start: int = 0
    parent: XmlElement | None = None
    children: list[XmlElement] = field(default_factory=list)
    text: str = ""
    end: int = 0
    source: SourceFile | None = None
    original: XmlElement | None = None

    def __iter__(self) -> Iterator[XmlElement]:
        """Yield its children."""
        return iter(self.children)

    @property
    def place(self) -> tuple[Path | None, int | None]:
        """Its file and line; None for an added element."""
        if self.source is None:
            return None, None
        return self.source.file, self.source.line(self.start)

    def attribute_place(self, key: str) -> tuple[Path | None, int | None]:
        """Return the file and line of an attribute that the file states."""
        if self.source is None:
            return None, None
        return self.source.file, self.source.line(attribute_span(self, key, self.source)[0])

    def get(self, key: str, default: str = "") -> str:
        """Return an attribute, or the default."""
        return self.attributes.get(key, default)

    def set(self, key: str, value: str) -> None:
        """Set an attribute."""
        self.attributes[key] = value

    def iter(self, tag: str | None = None) -> Iterator[XmlElement]:
        """Yield it and everything within it, in the file's order, or only elements of a tag."""
        if tag in (None, self.tag):
            yield self
        for child in self.children:
            yield from child.iter(tag)

    def findall(self, path: str) -> list[XmlElement]:
        """Return elements by their tags, as in `inertial/mass`; `*` stands for any tag."""
        level = [self]
        for tag in path.split("/"):
            level = [child for one in level for child in one.children if tag in ("*", child.tag)]
        return level

    def find(self, path: str) -> XmlElement | None:
        """Return the first element of a path of tags, or None."""
        return next(iter(self.findall(path)), None)

    def findtext(self, path: str) -> str:
        """Return the text of the first element of a path of tags; empty without one."""
        element = self.find(path)
        return "" if element is None else element.text

    def add(
        self, tag: str, attributes: Mapping[str, str] = NO_ATTRIBUTES, text: str = ""
    ) -> XmlElement:
        """Add a child at the end, and return it."""
        return self.append(XmlElement(tag, dict(attributes), text=text))

    def append(self, child: XmlElement) -> XmlElement:
        """Append a child, and return it."""
        return self.insert(len(self.children), child)

    def insert(self, index: int, child: XmlElement) -> XmlElement:
        """Insert a child before another one, and return it."""
        child.parent = self
        self.children.insert(index, child)
        return child

    def remove(self, child: XmlElement) -> None:
        """Remove a child."""
        self.children.remove(child)

    @property
    def content(self) -> object:
        """Its tag, attributes, text and children, without blanks: equal for equal elements."""
        attributes = sorted((key, value.split()) for key, value in self.attributes.items())
        return self.tag, attributes, self.text.split(), [child.content for child in self.children]

    def copy(self) -> XmlElement:
        """Return a copy that can be changed, without a parent."""
        copied = XmlElement(
            self.tag,
            dict(self.attributes),
            self.start,
            text=self.text,
            end=self.end,
            source=self.source,
            original=self.original or (None if self.source is None else self),
        )
        for child in self.children:
            copied.append(child.copy())
        return copied

    def written(self) -> bytes:
        """Return it as XML: the file's bytes with the changes of this copy."""
        from xml.sax.saxutils import escape, quoteattr  # it loads urllib.request

        element = self.original
        if element is None or element.source is None:
            attributes = "".join(f" {key}={quoteattr(one)}" for key, one in self.attributes.items())
            inner = escape(self.text).encode() + b"".join(one.written() for one in self.children)
            return f"<{self.tag}{attributes}>".encode() + inner + f"</{self.tag}>".encode()
        data, edits = element.source.data, sorted(self._edits(element, element.source))
        first, last = element.start, end_offset(element, element.source)
        return apply_edits(data[first:last], ((a - first, b - first, new) for a, b, new in edits))

    def _edits(self, element: XmlElement, source: SourceFile) -> Iterator[tuple[int, int, bytes]]:
        """Yield the changes of a file's element: ranges of bytes, and their replacements."""
        from xml.sax.saxutils import quoteattr

        spans, inner = attribute_spans(element, source)
        for key, (outer, _) in spans.items():
            given = self.attributes.get(key)
            if given != element.attributes[key]:
                yield *outer, b"" if given is None else f" {key}={quoteattr(given)}".encode()
        added = "".join(
            f" {key}={quoteattr(one)}" for key, one in self.attributes.items() if key not in spans
        ).encode()
        here, kept = set(map(id, element.children)), {id(one.original): one for one in self}
        new = b"".join(one.written() for one in self if id(one.original) not in here)
        for child in element:
            if id(child) in kept:
                yield from kept[id(child)]._edits(child, source)
            else:
                yield child.start, end_offset(child, source), b""
        if new and (empty := _EMPTY.match(source.data, inner)):
            yield inner, empty.end(), added + b">" + new + f"</{self.tag}>".encode()
            return
        yield inner, inner, added
        yield element.end, element.end, new

    @property
    def identity(self) -> str | None:
        """The attribute that distinguishes it: its name, or its reference."""
        return next((self.attributes[k] for k in _IDENTITIES if k in self.attributes), None)

    @property
    def depth(self) -> int:
        """The number of steps from the root, including the root's own."""
        return 1 if self.parent is None else 1 + self.parent.depth

    def spelled(self, steps: int) -> str:
        """Return an address of it with this many steps."""
        step = self.tag if self.identity is None else f"{self.tag}[{self.identity}]"
        if steps == 1 or self.parent is None:
            return step
        return f"{self.parent.spelled(steps - 1)}/{step}"


def attribute_spans(
    element: XmlElement, source: SourceFile
) -> tuple[dict[str, tuple[Span, Span]], int]:
    """Return the bytes of each attribute and of its value, and the end of the last one."""
    tag = _TAG.match(source.data, element.start)
    assert tag is not None  # the parser has found an element here
    spans, position = dict[str, tuple[Span, Span]](), tag.end()
    while match := _ATTRIBUTE.match(source.data, position):
        inner = match.span(2 if match[2] is not None else 3)
        spans[match[1].decode("utf-8")] = match.span(), inner
        position = match.end()
    return spans, position


def end_offset(element: XmlElement, source: SourceFile) -> int:
    """Return the byte after an element."""
    empty = _EMPTY.match(source.data, attribute_spans(element, source)[1])
    return empty.end() if empty else source.data.index(b">", element.end) + 1


def attribute_span(element: XmlElement, attribute: str, source: SourceFile) -> Span:
    """Return the span of an attribute's value."""
    return attribute_spans(element, source)[0][attribute][1]


def text_span(element: XmlElement, source: SourceFile) -> Span:
    """Return the span between an element's tags."""
    return source.data.index(b">", attribute_spans(element, source)[1]) + 1, element.end


def check_harmless(source: SourceFile) -> None:
    """Refuse XML that could harm a reader, well-formed or not.

    Raises:
        RefusedFileError: for a DTD, or elements nested too deeply; with its line.
    """
    bare = _HIDDEN.sub(lambda hidden: b" " * len(hidden[0]), source.data)
    if declaration := _DECLARATION.search(bare):
        raise _declares(source, source.line(declaration.start()))
    if bare.count(b"<") > MAX_XML_DEPTH:
        try:
            read_elements(source)
        except RefusedFileError:
            raise
        except LocationError:
            return  # the engine's parser reports the error


def _declares(source: SourceFile, line: int) -> RefusedFileError:
    return RefusedFileError("refused: it declares entities or a DTD", file=source.file, line=line)


def read_elements(source: SourceFile) -> tuple[XmlElement, ...]:
    """Return every element of a file, in order, with entity expansion off.

    Files that were read last are kept, by their bytes: change only copies of elements.

    Raises:
        RefusedFileError: for a DTD or too many nested elements; with its line.
        LocationError: for a file that is not XML.
    """
    is_large = len(source.data) > MAX_KEPT_BYTES
    return _parse(source) if is_large else _kept_elements(source)


def read_repaired(source: SourceFile) -> tuple[SourceFile, tuple[XmlElement, ...]]:
    """Return a file's elements, and the file that they are in: repaired if its own bytes are not
    XML.

    Raises:
        LocationError: as `read_elements`.
    """
    if source.data.startswith(UTF_16):
        error = LocationError("its encoding is UTF-16", file=source.file, line=1)
        raise error.with_remedy("save the file as UTF-8")
    try:
        source.data.decode("utf-8")
        return source, read_elements(source)
    except RefusedFileError:
        raise
    except (LocationError, UnicodeDecodeError):
        repaired = SourceFile(source.file, repaired_xml(source.data))
        return repaired, read_elements(repaired)


@lru_cache(maxsize=8)
def _kept_elements(source: SourceFile) -> tuple[XmlElement, ...]:
    return _parse(source)


def _parse(source: SourceFile) -> tuple[XmlElement, ...]:
    parser = expat.ParserCreate()
    elements: list[XmlElement] = []
    open_: list[XmlElement] = []

    def declare(_version: str, encoding: str | None, _standalone: int) -> None:
        if encoding and encoding.lower() not in ("utf-8", "us-ascii"):
            problem = f"its encoding is {encoding}; save the file as UTF-8"
            raise LocationError(problem, file=source.file, line=1)

    def refuse(*_: object) -> None:
        raise _declares(source, parser.CurrentLineNumber)

    def begin(tag: str, attributes: dict[str, str]) -> None:
        if len(open_) == MAX_XML_DEPTH:
            problem = f"refused: more than {MAX_XML_DEPTH} nested elements"
            raise RefusedFileError(problem, file=source.file, line=parser.CurrentLineNumber)
        parent = open_[-1] if open_ else None
        element = XmlElement(tag, attributes, parser.CurrentByteIndex, parent, source=source)
        if parent is not None:
            parent.children.append(element)
        elements.append(element)
        open_.append(element)

    def read(text: str) -> None:
        open_[-1].text += text

    def finish(_tag: str) -> None:
        open_.pop().end = parser.CurrentByteIndex

    parser.buffer_text = True  # one call for each text, not for each of its lines
    parser.XmlDeclHandler = declare
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    parser.StartElementHandler = begin
    parser.CharacterDataHandler = read
    parser.EndElementHandler = finish
    try:
        parser.Parse(source.data, True)
    except expat.ExpatError as error:
        raise _syntax_error(source.file, source.data, error, [one.tag for one in open_]) from None
    return tuple(elements)


def is_whole(file: Path) -> bool:
    """Return whether a file ends with the end tag of its first element, without parsing it."""
    try:
        data = read_regular(file, MAX_MODEL_BYTES).rstrip()
    except OSError:
        return False
    root = _ELEMENT.search(data)
    return root is not None and data.endswith(b"</" + root[1] + b">") and b"\0" not in data


def xml_problem(file: Path, *, strict: bool) -> str:
    """Return why a file is not XML, with its line and the remedy.

    Args:
        file: a model file; a file that can't be read, or is refused, is reported elsewhere.
        strict: whether only well-formed XML is accepted. Otherwise an engine's own parser decides,
            unless the file has no element at all, is binary, or ends inside an element.

    Returns:
        A sentence that begins with the file; empty if it may be XML.
    """
    try:
        data = read_regular(file, MAX_MODEL_BYTES)
        read_repaired(SourceFile(file, data))
    except RefusedFileError:
        pass
    except LocationError as error:
        plain, truncated = repaired_xml(data), error.remedy == RESTORE
        if strict or truncated or b"\0" in plain or not _ELEMENT.search(plain):
            return f"{error}; {error.remedy}"
    except OSError:
        pass
    return ""


_TRUNCATED = (
    expat.errors.XML_ERROR_NO_ELEMENTS,
    expat.errors.XML_ERROR_UNCLOSED_TOKEN,
    expat.errors.XML_ERROR_UNCLOSED_CDATA_SECTION,
)


def _syntax_error(
    file: Path, data: bytes, error: expat.ExpatError, unclosed: Sequence[str]
) -> LocationError:
    """Return the error of a file that is not XML, with its line."""
    text, place = expat.ErrorString(error.code), f"column {error.offset + 1}"
    if not data.strip():
        return LocationError("not XML: the file has no element", file=file, line=1)
    if b"\0" in data:
        return LocationError(
            f"not XML at {place}: the file is binary", file=file, line=error.lineno
        )
    if text in _TRUNCATED and unclosed:
        sentence = f"the file ends before </{unclosed[0]}>"
        if len(unclosed) > 1:
            sentence += f", inside <{unclosed[-1]}>"
        line = data.rstrip().count(b"\n") + 1
        return LocationError(sentence, file=file, line=line).with_remedy(RESTORE)
    return LocationError(f"not XML at {place}: {text}", file=file, line=error.lineno)


def repaired_xml(data: bytes) -> bytes:
    """Return the file as UTF-8, with the content on its original lines."""
    plain = _decoded(data).encode("utf-8").rstrip(b"\0 \t\r\n") + b"\n"
    if head := _HEAD.match(plain):
        plain = _blank(head[0]) + plain[head.end() :]
    return _HIDDEN.sub(lambda m: m[0] if m[0].startswith(b"<![") else _blank(m[0]), plain)


def _decoded(data: bytes) -> str:
    """Return the text; undecodable bytes become distinct characters, so that names differ."""
    head = _HEAD.match(data)
    declared = _ENCODING.search(head[0]) if head else None
    for encoding in ("utf-8-sig", declared[1].decode("ascii") if declared else "utf-8"):
        try:
            return data.decode(encoding)
        except (UnicodeError, LookupError):
            continue
    return data.decode("latin-1")


def _blank(text: bytes) -> bytes:
    return re.sub(rb"[^\r\n]", b" ", text)


_NUMBER = re.compile(r"[+-]?(?:\d[\d_]*\.?[\d_]*|\.\d[\d_]*)(?:[eE][+-]?\d+)?", re.ASCII)


@dataclass(frozen=True, kw_only=True)
class Number:
    """A number as written in a file.

    Attributes:
        file: that contains it.
        text: the number as written, including its sign.
        start, end: its first byte in the document, and the one after its last.
        line: of its first character, counted from 1; None for a number without text, as in a binary
            file, or a default.
        column: of its first character, counted from 1; 0 if it has none.
        address: a unique address in its file.
        path: the tags that lead to it and its attribute, as in `robot/link/inertial/mass@value`; in
            TOML its key; in Python the name that it is assigned to, or empty.
        scale: the size that relative changes refer to: its own, or the largest of its list.
        within: the element that contains it; None in a file that is not XML.
        key: the attribute; empty for text.
        word: index in the attribute.
        omitted: number of bytes of the file before the document.
    """

    file: Path
    text: str
    start: int = 0
    end: int = 0
    line: int | None = None
    column: int = 0
    address: str = ""
    path: str = ""
    scale: float = 1.0
    within: XmlElement | None = None
    key: str = ""
    word: int = 0
    omitted: int = 0

    @property
    def value(self) -> float:
        """The number."""
        return float(self.text)

    @property
    def span(self) -> Span | None:
        """Its first byte in the file, and the one after its last; None without a line."""
        return None if self.line is None else (self.start + self.omitted, self.end + self.omitted)

    @property
    def place(self) -> str:
        """Its line, or its address if it has none, after a colon."""
        return f":{self.line or self.address}"

    @property
    def element(self) -> XmlElement:
        """The XML element that contains it."""
        assert self.within is not None
        return self.within

    def __str__(self) -> str:
        return f"{self.file}{self.place}"


def read_number(
    source: SourceFile, span: Span, value: float, address: str, path: str = ""
) -> Number:
    """Return a number if its bytes equal the parser's value.

    Raises:
        LocationError: with its line.
    """
    start, end = span
    text = source.text(span)
    if not _NUMBER.fullmatch(text):
        raise source.error(address, f"is {quote(text)}; expected a decimal number", start)
    if float(text) != value:
        raise source.error(address, f"is written {quote(text)} but read as {value!r}", start)
    return Number(
        file=source.file, start=start, end=end, line=source.line(start),
        column=source.column(start), text=text, address=address, path=path,
    )  # fmt: skip


def replace_numbers(
    texts: Mapping[Path, bytes], words: Iterable[tuple[Number, str]]
) -> dict[Path, bytes]:
    """Return files' bytes with numbers replaced by other words.

    Raises:
        LocationError: for a number without a line, which no bytes state.
    """
    changes: dict[Path, list[tuple[int, int, bytes]]] = {}
    for place, word in words:
        if place.line is None:
            raise LocationError(f"{quote(place.address)} is not written there", file=place.file)
        changes.setdefault(place.file, []).append((place.start, place.end, word.encode()))
    return {file: apply_edits(data, changes.get(file, ())) for file, data in texts.items()}
