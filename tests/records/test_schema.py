"""JSON Schemas: generated from the records, and as strict as the reader."""

import inspect
import json
import re
from collections.abc import Iterator
from typing import Any

import jsonschema
import msgspec
import pytest

from physics_crosscheck.harness.records.schema import PAGES, SCHEMAS, meanings, page_texts, schema
from physics_crosscheck.records import Record, Results
from tests.records.examples import example, paths, replaced


def structs(wanted: msgspec.inspect.Type) -> Iterator[msgspec.inspect.StructType]:
    """Yield every struct within a type; a struct may be repeated."""
    inner: list[msgspec.inspect.Type] = []
    match wanted:
        case msgspec.inspect.StructType(fields=fields):
            yield wanted
            inner = [field.type for field in fields]
        case msgspec.inspect.UnionType(types=types):
            inner = list(types)
        case (
            msgspec.inspect.VarTupleType(item_type=item) | msgspec.inspect.ListType(item_type=item)
        ):
            inner = [item]
        case msgspec.inspect.DictType(value_type=value):
            inner = [value]
    for kind in inner:
        yield from structs(kind)


@pytest.mark.parametrize("name", SCHEMAS)
def test_objects_forbid_other_keys_and_describe_all_fields(name: str) -> None:
    for definition in schema(SCHEMAS[name])["$defs"].values():
        if definition.get("type") == "object":
            assert definition["additionalProperties"] is False, definition
            assert definition["description"]
    for struct in structs(msgspec.inspect.type_info(SCHEMAS[name])):
        docstring = inspect.getdoc(struct.cls) or ""
        undescribed = [
            field.encode_name
            for field in struct.fields
            if not re.search(rf"\b{field.encode_name}\b", docstring)
        ]
        assert not undescribed, struct.cls.__name__
        assert meanings(struct.cls).keys() == {field.name for field in struct.fields}, struct.cls


@pytest.mark.parametrize("record", SCHEMAS.values(), ids=list(SCHEMAS))
def test_example_is_valid_only_without_extra_keys(record: type[Record]) -> None:
    validator = jsonschema.Draft202012Validator(schema(record))
    good: Any = example(record)
    assert validator.is_valid(good)
    assert validator.is_valid(json.loads(msgspec.json.encode(msgspec.convert(good, record))))
    for path in paths(good):
        value = good
        for step in path:
            value = value[step]
        if isinstance(value, dict) and value.keys() != {"a"}:
            assert not validator.is_valid(replaced(good, path, {**value, "surprise": 1})), path


def test_results_name_their_schema() -> None:
    properties = schema(Results)["$defs"]["Results"]["properties"]
    assert properties["schema"]["enum"] == [5]


def test_pages_have_rows_for_fields_and_sections_for_links() -> None:
    pages = page_texts(PAGES)
    heading = re.compile(r"^## (\w+)\n(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)
    sections = {name: dict(heading.findall(text)) for name, text in pages.items()}
    homes = [struct for found in sections.values() for struct in found]
    assert len(homes) == len(set(homes))
    every = {name: text for found in sections.values() for name, text in found.items()}
    for page in PAGES:
        for record in page.records:
            for struct in structs(msgspec.inspect.type_info(record)):
                rows = re.findall(r"^\| `(\w+)` \|", every[struct.cls.__name__], re.MULTILINE)
                assert rows == [field.encode_name for field in struct.fields]
    for name, text in pages.items():
        for file, anchor in re.findall(r"\]\(([\w-]*\.md)?#(\w+)\)", text):
            assert anchor in {one.lower() for one in sections[file or name]}, (name, file, anchor)
        assert "None" not in text


def test_field_is_described_in_at_most_twenty_words() -> None:
    for page in PAGES:
        for record in page.records:
            for struct in structs(msgspec.inspect.type_info(record)):
                for field, meaning in meanings(struct.cls).items():
                    assert 0 < len(meaning.split()) <= 20, (struct.cls, field)
                    assert meaning[0].isupper() or meaning[0] in "`K", (struct.cls, field)
