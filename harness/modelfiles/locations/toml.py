"""Numbers in TOML, by keys such as `spring[0].stiffness`."""

import re
import tomllib
from collections.abc import Iterator
from typing import Any

from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.reading import (
    Resolve,
    SourceFile,
    Span,
    TomlError,
    nearest,
    toml_document,
)

_BARE = re.compile(r"[A-Za-z0-9_-]+")
_STRING = re.compile(
    r'"""(?:\\.|[^\\])*?"""(?:"{0,2})' r"|'''.*?'''(?:'{0,2})" r'|"(?:\\.|[^"\\])*"' r"|'[^']*'",
    re.DOTALL,
)
_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_SPACE = re.compile(r"[ \t]*")
_SCALAR = re.compile(r"\d{4}-\d\d-\d\d [\d:.Z+-]+|[^\s,\]}#]+")
_PART = re.compile(rf"(?:{_BARE.pattern}|{_STRING.pattern})|\[\d{{1,9}}\]|\.", re.DOTALL)

_Key = tuple[str | int, ...]


def toml_keys(source: SourceFile) -> Resolve:
    """Return a resolver of numbers by key; tomllib parses them, and a scan finds their bytes."""
    text, data = _read(source)
    values = _toml_values(text)
    numbers = {key: span for key, span in values.items() if _is_number(_value_at(data, key))}

    def offset(index: int) -> int:
        return len(text[:index].encode("utf-8"))

    def resolve(address: str) -> tuple[Span, float]:
        key = _toml_key(address)
        if key is None:
            raise source.error(address, "is not an address; write it like 'spring[0].stiffness'")
        if key not in numbers:
            near = nearest(address, map(_spell_key, numbers)) or "none"
            raise source.error(
                address,
                f"does not name a number; nearest: {near}",
                offset(values[key][0]) if key in values else None,
            )
        start, end = numbers[key]
        return (offset(start), offset(end)), float(_value_at(data, key))

    return resolve


def toml_numbers(source: SourceFile) -> Iterator[tuple[str, Span, float]]:
    """Yield every number with its key and its bytes."""
    text, data = _read(source)
    done = before = 0
    for key, (start, end) in _toml_values(text).items():  # in their order in the file
        before, done = before + len(text[done:start].encode("utf-8")), start
        if _is_number(value := _value_at(data, key)):
            yield _spell_key(key), (before, before + len(text[start:end].encode("utf-8"))), value


def toml_offset(source: SourceFile, address: str) -> int | None:
    """Return the first byte of a key's value, or of the first value in it; None without one."""
    text, _ = _read(source)
    key = _toml_key(address)
    if key is None:
        return None
    spans = [span for k, span in _toml_values(text).items() if k[: len(key)] == key]
    return len(text[: min(spans)[0]].encode("utf-8")) if spans else None


def _read(source: SourceFile) -> tuple[str, dict[str, Any]]:
    text = source.data.decode("utf-8")
    try:
        return text, toml_document(text)
    except TomlError as error:
        raise LocationError(f"{source.file}{error}") from None


def _toml_values(text: str) -> dict[_Key, Span]:
    """Return the span of each value of a well-formed document."""
    spans: dict[_Key, Span] = {}
    last: dict[_Key, int] = {}
    table: _Key = ()
    position = _skip(_BLANK, text, 0)
    while position < len(text):
        if text[position] == "[":
            brackets = 2 if text.startswith("[[", position) else 1
            key, position = _read_key(text, position + brackets)
            table = ()
            for i, part in enumerate(key):
                table += (part,)
                if brackets == 2 and i == len(key) - 1:
                    last[table] = last.get(table, -1) + 1
                if table in last:
                    table += (last[table],)
            position += brackets
        else:
            key, position = _read_key(text, position)
            position = _read_value(text, _skip(_SPACE, text, position + 1), (*table, *key), spans)
        position = _skip(_BLANK, text, position)
    return spans


def _read_key(text: str, position: int) -> tuple[_Key, int]:
    """Return a dotted key, and the position of the sign after it."""
    parts: list[str] = []
    while True:
        position = _skip(_SPACE, text, position)
        match = _BARE.match(text, position) or _STRING.match(text, position)
        assert match is not None  # tomllib has parsed the document
        parts.append(_unquote(match[0]))
        position = _skip(_SPACE, text, match.end())
        if text[position] != ".":
            return tuple(parts), position
        position += 1


def _read_value(text: str, position: int, key: _Key, spans: dict[_Key, Span]) -> int:
    """Record the span of a value, or of those in it; return its end."""
    if match := _STRING.match(text, position):
        spans[key] = match.span()
        return match.end()
    if text[position] not in "[{":
        match = _SCALAR.match(text, position)
        assert match is not None  # tomllib has parsed the document
        spans[key] = match.span()
        return match.end()
    array = text[position] == "["
    position, index = _skip(_BLANK, text, position + 1), 0
    while text[position] not in "]}":
        inner: _Key = (index,)
        if not array:
            inner, position = _read_key(text, position)
            position = _skip(_SPACE, text, position + 1)
        position = _skip(_BLANK, text, _read_value(text, position, (*key, *inner), spans))
        if text[position] == ",":
            position = _skip(_BLANK, text, position + 1)
        index += 1
    return position + 1


def _skip(pattern: re.Pattern[str], text: str, position: int) -> int:
    match = pattern.match(text, position)
    return position if match is None else match.end()


def _unquote(part: str) -> str:
    return part if _BARE.fullmatch(part) else str(tomllib.loads(f"key = {part}")["key"])


def _toml_key(address: str) -> _Key | None:
    parts = [m[0] for m in _PART.finditer(address)]
    if "".join(parts) != address or not parts:
        return None
    key: list[str | int] = []
    dotted = True
    for part in parts:
        if part == ".":
            if dotted:
                return None
            dotted = True
        elif part[0] == "[":
            if dotted:
                return None
            key.append(int(part[1:-1]))
        else:
            if not dotted:
                return None
            try:
                key.append(_unquote(part))
            except tomllib.TOMLDecodeError:  # a quoted key may not contain control characters
                return None
            dotted = False
    return None if dotted else tuple(key)


def _spell_key(key: _Key) -> str:
    spelled = ""
    for part in key:
        if isinstance(part, int):
            spelled += f"[{part}]"
        else:
            plain = part if _BARE.fullmatch(part) else f'"{part}"'
            spelled += f".{plain}" if spelled else plain
    return spelled


def _value_at(data: Any, key: _Key) -> Any:
    for part in key:
        data = data[part]
    return data


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
