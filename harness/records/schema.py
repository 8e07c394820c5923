"""JSON Schemas and reference pages of the result files, generated from the records.

A page has a section per struct and a row per field, from docstrings. The site has all of them
(`interfaces.cli.reference`).
"""

import inspect
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import msgspec
from msgspec import inspect as types

from .base import Record
from .baseline import BaselineFile, Gate
from .comparison import ComparisonResult
from .model import Model
from .mutation import Mutations
from .outcome import Outcome
from .results import Results
from .sweep import SweepPlan, SweepRow
from .system import SystemResult

HOME = "results"
"""The page that explains the outcomes."""

_CONVENTIONS = (
    "\n\nUnits are SI. A `?` after a type means that the value can be null. A number is null if it"
    " is not finite."
)

_ENTRY = re.compile(r"^    (\w[\w, ]*?): ", re.MULTILINE)

_PLAIN: dict[type[types.Type], str] = {
    types.StrType: "text", types.IntType: "whole number", types.FloatType: "number",
    types.BoolType: "true or false", types.AnyType: "anything",
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class FilePage:
    """The page of one kind of file.

    Attributes:
        name: of the page, `<name>.md`.
        title: heading of the page.
        reader: who needs the page, and for what; one or two sentences.
        written: which command writes the file, and where; a sentence.
        records: the structs that the file contains, outermost first.
    """

    name: str
    title: str
    reader: str
    written: str
    records: tuple[type[Record], ...]


def page_texts(pages: Sequence[FilePage]) -> dict[str, str]:
    """Return the text of each page by its file name; a shared struct is on the first page."""
    homes: dict[type, str] = {}
    page_structs: dict[str, list[types.StructType]] = {page.name: [] for page in pages}
    for page in pages:
        for record in page.records:
            for struct in _structs(types.type_info(record)):
                if struct.cls not in homes:
                    homes[struct.cls] = page.name
                    page_structs[page.name].append(struct)
    return {f"{page.name}.md": _page(page, page_structs[page.name], homes) for page in pages}


def _page(page: FilePage, structs: Sequence[types.StructType], homes: Mapping[type, str]) -> str:
    links = {
        cls: f"[{cls.__name__}]({'' if home == page.name else f'{home}.md'}#{cls.__name__.lower()})"
        for cls, home in homes.items()
    }
    links[Outcome] = f"[outcome]({'' if page.name == HOME else f'{HOME}.md'}#outcome)"
    parts = [f"# {page.title}\n\n{page.reader} {page.written}{_CONVENTIONS}"]
    if (schema := page.name.partition("-")[0]) in SCHEMAS:
        file = f"{schema}.schema.json"
        parts.append(f" The JSON Schema is [`{file}`](../schema/{file}).")
    parts.append("\n\n")
    parts.extend(_section(struct, links) for struct in structs)
    if page.name == HOME:
        rows = "".join(f"| `{one}` | {one.meaning} |\n" for one in Outcome)
        parts.append(f"## Outcome\n\n| value | meaning |\n|---|---|\n{rows}")
    return "".join(parts).rstrip() + "\n"


def meanings(record: type) -> dict[str, str]:
    """Return the description of each field, from the Attributes of a struct's docstring."""
    text = inspect.getdoc(record) or ""
    _, _, listed = text.partition("Attributes:\n")
    pieces = _ENTRY.split(listed)[1:]
    return {
        name: " ".join(meaning.split())
        for names, meaning in zip(pieces[::2], pieces[1::2], strict=True)
        for name in names.split(", ")
    }


def _section(struct: types.StructType, links: Mapping[type, str]) -> str:
    text, _, _ = (inspect.getdoc(struct.cls) or "").partition("Attributes:\n")
    described = meanings(struct.cls)
    rows = "".join(
        f"| `{field.encode_name}` | {_type(field.type, links)} | {_cell(described[field.name])} |\n"
        for field in struct.fields
    )
    head = "| field | type | meaning |\n|---|---|---|\n"
    return f"## {struct.cls.__name__}\n\n{text.strip()}\n\n{head}{rows}\n"


def _cell(text: str) -> str:
    return re.sub(r"\bNone\b", "null", text.removesuffix(".")).replace("|", "\\|")


def _structs(wanted: types.Type) -> Iterator[types.StructType]:
    """Yield every struct in a type, outermost first; some more than once."""
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


def _type(wanted: types.Type, links: Mapping[type, str]) -> str:
    """Return a type in words, structs and outcomes as links."""
    match wanted:
        case types.StructType(cls=cls):
            return links[cls]
        case types.UnionType(types=several):
            words = [_type(one, links) for one in several if not isinstance(one, types.NoneType)]
            null = ", or null" if words[0].startswith("list") else "?"
            return " or ".join(words) + null * (len(words) < len(several))
        case types.VarTupleType(item_type=item) | types.ListType(item_type=item):
            return f"list of {_type(item, links).replace('list of', 'lists of', 1)}"
        case types.TupleType(item_types=items):
            return " and ".join(_type(item, links) for item in items)
        case types.DictType(value_type=value):
            return f"{_type(value, links)}, by name"
        case types.LiteralType(values=values):
            return ", ".join(f"`{value}`" if value else '`""`' for value in values)
        case types.EnumType(cls=cls):
            return links.get(cls) or ", ".join(f"`{one.value}`" for one in cls)
    return _PLAIN[type(wanted)]


DIALECT = "https://json-schema.org/draft/2020-12/schema"

SCHEMAS: dict[str, type[Record]] = {
    "results": Results,
    "gate": Gate,
    "baseline": BaselineFile,
    "comparison": ComparisonResult,
    "mutations": Mutations,
}
"""Records by the name of their schema file, `<name>.schema.json`."""

PAGES = (
    FilePage(
        name="results-systems",
        title="results.json: systems",
        reader="Scripts that read derived equations or scenarios need this page. It describes every"
        " field under `systems` in [`results.json`](results.md).",
        written="`crosscheck run` writes one entry per system.",
        records=(SystemResult,),
    ),
    FilePage(
        name="results-models",
        title="results.json: models",
        reader="Scripts that read audits, diagnoses or linearizations need this page. It describes"
        " every field under `models` in [`results.json`](results.md).",
        written="`crosscheck run` writes one entry per model file and engine.",
        records=(Model,),
    ),
    FilePage(
        name="results",
        title="results.json",
        reader="Scripts that evaluate runs need this page. It describes every field of a run's"
        " results.",
        written="`crosscheck run` writes `results.json` into the folder of the report.",
        records=(Results,),
    ),
    FilePage(
        name="gate",
        title="gate.json",
        reader="Scripts that evaluate a gate in CI need this page. It describes every field of the"
        " gate's result.",
        written="`crosscheck gate` writes `gate.json` into `reports/gate/`.",
        records=(Gate,),
    ),
    FilePage(
        name="baseline",
        title="Baseline files",
        reader="Reviewers of a changed baseline need this page. It describes every field of an"
        " accepted result.",
        written="`crosscheck accept` writes one file per system folder,"
        " `reports/baseline/<system>.json`, and one per robot file.",
        records=(BaselineFile,),
    ),
    FilePage(
        name="comparison",
        title="Comparison files",
        reader="Scripts that compare two models need this page. It describes every field of the"
        " comparison.",
        written="`crosscheck compare --json FILE` writes the file.",
        records=(ComparisonResult,),
    ),
    FilePage(
        name="mutations",
        title="Mutation files",
        reader="Scripts that measure how many faults a check detects need this page. It describes"
        " every field of the result.",
        written="`crosscheck mutate --json FILE` writes the file.",
        records=(Mutations,),
    ),
    FilePage(
        name="sweep",
        title="Sweep rows",
        reader="Anyone who evaluates a sweep needs this page. It describes every column of the"
        " table.",
        written="`crosscheck sweep` writes the rows as Parquet files into `DIR/rows`, and the plan"
        " as JSON into `DIR/plan.json`.",
        records=(SweepRow, SweepPlan),
    ),
)
"""The reference pages; a struct that two files share is on the first of their pages."""


def schema(record: type[Record]) -> dict[str, Any]:
    """Return the JSON Schema (2020-12) of a record."""
    return {"$schema": DIALECT, **_described(msgspec.json.schema(record))}


def _described(part: Any) -> Any:
    """Return a schema with docstrings without their indent, which Python 3.13 does not keep."""
    if isinstance(part, list):
        return [_described(one) for one in part]
    if not isinstance(part, dict):
        return part
    text = part.get("description")
    cleaned = {"description": inspect.cleandoc(text)} if isinstance(text, str) else {}
    return {name: _described(one) for name, one in part.items()} | cleaned


def schema_text(name: str) -> str:
    """Return the text of a schema file."""
    return json.dumps(schema(SCHEMAS[name]), indent=1, ensure_ascii=False) + "\n"
