"""A page of the files that are written, made from docstrings: a section a struct, a row a field."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from msgspec import inspect as types

from physics_crosscheck.harness.records.base import Record

_HEAD = """# Files that are written

Field by field, made from the records (`harness/records/`) as the JSON Schemas beside this page are.
Units are SI. `?` after a type: null is allowed; a number is null where it has no finite value. A
field that is not known is refused.

"""

_ENTRY = re.compile(r"^    (\w[\w, ]*?): ", re.MULTILINE)

_PLAIN: dict[type[types.Type], str] = {
    types.StrType: "text", types.IntType: "whole number", types.FloatType: "number",
    types.BoolType: "true or false", types.AnyType: "anything",
}  # fmt: skip


@dataclass(frozen=True)
class File:
    """A kind of file.

    Attributes:
        schema: name of its schema's file, `<schema>.schema.json`.
        title: what it is called.
        written: by which command, and where.
        record: what stands in it.
    """

    schema: str
    title: str
    written: str
    record: type[Record]


def page(files: Sequence[File]) -> str:
    """The page; a struct that stands in two files is told with the first."""
    told: set[type] = set()
    parts = [_HEAD]
    for file in files:
        link = f"[`{file.schema}.schema.json`]({file.schema}.schema.json)"
        parts.append(f"## {file.title}\n\nWritten {file.written}; {link}.\n\n")
        for struct in _structs(types.type_info(file.record)):
            if struct.cls not in told:
                told.add(struct.cls)
                parts.append(_section(struct))
    return "".join(parts).rstrip() + "\n"


def meanings(record: type) -> dict[str, str]:
    """What the docstring of a struct says of each field, under Attributes."""
    told = inspect.getdoc(record) or ""
    _, _, listed = told.partition("Attributes:\n")
    pieces = _ENTRY.split(listed)[1:]
    return {
        name: " ".join(meaning.split())
        for names, meaning in zip(pieces[::2], pieces[1::2], strict=True)
        for name in names.split(", ")
    }


def _section(struct: types.StructType) -> str:
    text, _, _ = (inspect.getdoc(struct.cls) or "").partition("Attributes:\n")
    told = meanings(struct.cls)
    rows = "".join(
        f"| `{field.encode_name}` | {_type(field.type)} | {_cell(told[field.name])} |\n"
        for field in struct.fields
    )
    head = "| field | type | meaning |\n|---|---|---|\n"
    return f"### {struct.cls.__name__}\n\n{text.strip()}\n\n{head}{rows}\n"


def _cell(text: str) -> str:
    return re.sub(r"\bNone\b", "null", text.removesuffix(".")).replace("|", "\\|")


def _structs(wanted: types.Type) -> Iterator[types.StructType]:
    """Every struct that a type holds, the outermost first; some more than once."""
    if isinstance(wanted, types.StructType):
        yield wanted
    for inner in _inner(wanted):
        yield from _structs(inner)


def _inner(wanted: types.Type) -> Sequence[types.Type]:
    match wanted:
        case types.StructType(fields=fields):
            return [field.type for field in fields]
        case types.UnionType(types=several):
            return several
        case types.VarTupleType(item_type=item) | types.ListType(item_type=item):
            return [item]
        case types.DictType(value_type=value):
            return [value]
    return []


def _type(wanted: types.Type) -> str:
    """A type in words."""
    match wanted:
        case types.StructType(cls=cls):
            return f"[{cls.__name__}](#{cls.__name__.lower()})"
        case types.UnionType(types=several):
            words = [_type(one) for one in several if not isinstance(one, types.NoneType)]
            null = ", or null" if words[0].startswith("list") else "?"
            return " or ".join(words) + null * (len(words) < len(several))
        case types.VarTupleType(item_type=item) | types.ListType(item_type=item):
            return f"list of {_type(item).replace('list of', 'lists of', 1)}"
        case types.TupleType(item_types=items):
            return " and ".join(map(_type, items))
        case types.DictType(value_type=value):
            return f"{_type(value)}, by name"
        case types.LiteralType(values=values):
            return ", ".join(f"`{value}`" for value in values)
        case types.EnumType(cls=cls):
            return ", ".join(f"`{one.value}`" for one in cls)
    return _PLAIN[type(wanted)]
