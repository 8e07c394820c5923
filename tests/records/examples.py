"""Example records with every key, generated from their types: one entry per list, no nulls."""

import enum
from collections.abc import Iterator
from typing import Any

import msgspec
from msgspec import inspect

from physics_crosscheck.records import Record

Path = tuple[str | int, ...]


def example(record: type[Record]) -> Any:
    """Return a complete example of a record as plain JSON."""
    return _example_value(inspect.type_info(record))


PLAIN: dict[type[inspect.Type], Any] = {
    inspect.StrType: "a", inspect.IntType: 1, inspect.FloatType: 0.5, inspect.BoolType: True,
}  # fmt: skip


def _example_value(wanted: inspect.Type) -> Any:
    match wanted:
        case inspect.StructType(fields=fields):
            return {field.encode_name: _named(field) for field in fields}
        case inspect.UnionType(types=types):
            return _example_value(
                next(kind for kind in types if not isinstance(kind, inspect.NoneType))
            )
        case inspect.VarTupleType(item_type=item) | inspect.ListType(item_type=item):
            return [_example_value(item)]
        case inspect.TupleType(item_types=items):
            return [_example_value(item) for item in items]
        case inspect.DictType(value_type=value):
            return {"a": _example_value(value)}
        case inspect.LiteralType(values=values):
            return values[0]
        case inspect.EnumType(cls=cls) if issubclass(cls, enum.Enum):
            return next(iter(cls)).value
    return PLAIN[type(wanted)]


def _named(field: inspect.Field) -> Any:
    # A point of a sketch is a pair of expression trees, which the types do not express.
    # The example's case agrees, so it has no misread numbers and wrong contacts.
    # The only body of its scene is attached to the only joint, whose parent is the world.
    exceptions = {"center": [0.5, 0.5], "mesh": 0, "misread": [], "parent": -1,
                  "contact_faults": []}  # fmt: skip
    if isinstance(field.type, inspect.IntType):
        exceptions["joint"] = 0
    return exceptions.get(field.encode_name, _example_value(field.type))


def required(wanted: inspect.Type, here: Path = ()) -> Iterator[Path]:
    """Yield the path of every required key in the example of a type."""
    match wanted:
        case inspect.StructType(fields=fields):
            for field in fields:
                if field.required:
                    yield (*here, field.encode_name)
                yield from required(field.type, (*here, field.encode_name))
        case inspect.UnionType(types=types):
            kinds = (kind for kind in types if not isinstance(kind, inspect.NoneType))
            yield from required(next(kinds), here)
        case inspect.VarTupleType(item_type=item):
            yield from required(item, (*here, 0))
        case inspect.DictType(value_type=value):
            yield from required(value, (*here, "a"))


def paths(value: Any, here: Path = ()) -> Iterator[Path]:
    """Yield the path of every value of plain JSON, outermost first."""
    yield here
    if isinstance(value, dict):
        for key, item in value.items():
            yield from paths(item, (*here, key))
    elif isinstance(value, list):
        for i, item in enumerate(value):
            yield from paths(item, (*here, i))


def value_at(value: Any, path: Path) -> Any:
    for step in path:
        value = value[step]
    return value


def replaced(value: Any, path: Path, new: Any) -> Any:
    """Return a copy with a new value at a path."""
    if not path:
        return new
    copy = msgspec.json.decode(msgspec.json.encode(value))
    value_at(copy, path[:-1])[path[-1]] = new
    return copy
