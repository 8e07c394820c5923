"""A record with every key in it, made from its type: each list has one entry, nothing is null."""

from __future__ import annotations

import enum
from collections.abc import Iterator
from typing import Any

import msgspec
from msgspec import inspect

from physics_crosscheck.harness.records.base import Record

Path = tuple[str | int, ...]


def example(record: type[Record]) -> Any:
    """The record as plain JSON."""
    return _of(inspect.type_info(record))


PLAIN: dict[type[inspect.Type], Any] = {
    inspect.StrType: "a", inspect.IntType: 1, inspect.FloatType: 0.5, inspect.BoolType: True,
}  # fmt: skip


def _of(wanted: inspect.Type) -> Any:
    match wanted:
        case inspect.StructType(fields=fields):
            return {field.encode_name: _named(field) for field in fields}
        case inspect.UnionType(types=types):
            return _of(next(one for one in types if not isinstance(one, inspect.NoneType)))
        case inspect.VarTupleType(item_type=item) | inspect.ListType(item_type=item):
            return [_of(item)]
        case inspect.TupleType(item_types=items):
            return [_of(item) for item in items]
        case inspect.DictType(value_type=value):
            return {"a": _of(value)}
        case inspect.LiteralType(values=values):
            return values[0]
        case inspect.EnumType(cls=cls) if issubclass(cls, enum.Enum):
            return next(iter(cls)).value
    return PLAIN[type(wanted)]


def _named(field: inspect.Field) -> Any:
    # A point of a sketch is a pair of trees, which the types don't say.
    # The example's case agrees, so that nothing is misread.
    # The one body of its scene is on the one joint, and that is on the world.
    exceptions = {"center": [0.5, 0.5], "mesh": 0, "misread": [], "parent": -1}
    if isinstance(field.type, inspect.IntType):
        exceptions["joint"] = 0
    return exceptions.get(field.encode_name, _of(field.type))


def required(wanted: inspect.Type, here: Path = ()) -> Iterator[Path]:
    """Where every key is that must be there, in the example of a type."""
    match wanted:
        case inspect.StructType(fields=fields):
            for field in fields:
                if field.required:
                    yield (*here, field.encode_name)
                yield from required(field.type, (*here, field.encode_name))
        case inspect.UnionType(types=types):
            kinds = (one for one in types if not isinstance(one, inspect.NoneType))
            yield from required(next(kinds), here)
        case inspect.VarTupleType(item_type=item):
            yield from required(item, (*here, 0))
        case inspect.DictType(value_type=value):
            yield from required(value, (*here, "a"))


def paths(value: Any, here: Path = ()) -> Iterator[Path]:
    """Where every value of plain JSON is, the outermost first."""
    yield here
    if isinstance(value, dict):
        for key, item in value.items():
            yield from paths(item, (*here, key))
    elif isinstance(value, list):
        for i, item in enumerate(value):
            yield from paths(item, (*here, i))


def at(value: Any, path: Path) -> Any:
    """The value at a path."""
    for step in path:
        value = value[step]
    return value


def replaced(value: Any, path: Path, new: Any) -> Any:
    """A copy with another value at a path."""
    if not path:
        return new
    copy = msgspec.json.decode(msgspec.json.encode(value))
    at(copy, path[:-1])[path[-1]] = new
    return copy
