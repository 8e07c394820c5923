"""JSON Schemas of the records that are written, and their page, made from the records themselves.

`python -m physics_crosscheck.harness.records.schema docs/schema` writes all; a test fails where
they are not current.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import msgspec

from physics_crosscheck.harness.records.base import Record
from physics_crosscheck.harness.records.baseline import BaselineFile, Gate
from physics_crosscheck.harness.records.comparison import Comparison
from physics_crosscheck.harness.records.fields import File, page
from physics_crosscheck.harness.records.mutation import Mutations
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.records.versions import Versions
from physics_crosscheck.harness.records.write import write_whole

DIALECT = "https://json-schema.org/draft/2020-12/schema"

SCHEMAS: dict[str, type[Record]] = {
    "results": Results,
    "gate": Gate,
    "baseline": BaselineFile,
    "comparison": Comparison,
    "mutations": Mutations,
    "versions": Versions,
}
"""Records by the name of their schema's file, `<name>.schema.json`."""

WRITTEN: dict[str, tuple[str, str]] = {
    "results": ("results.json", "by `crosscheck run`, in the folder of the report"),
    "gate": ("gate.json", "by `crosscheck gate`, in `reports/gate/`"),
    "baseline": ("A baseline", "by `crosscheck accept`, as `reports/baseline/<system>.json`"),
    "comparison": ("A comparison", "by `crosscheck compare --json FILE`"),
    "mutations": ("Mutations", "by `crosscheck mutate --json FILE`"),
    "versions": ("Versions", "by `crosscheck versions --json FILE`"),
}
"""What each file is called, and who writes it."""


def schema(record: type[Record]) -> dict[str, Any]:
    """The JSON Schema (2020-12) of a record."""
    return {"$schema": DIALECT, **msgspec.json.schema(record)}


def schema_text(name: str) -> str:
    """The committed text of a schema."""
    return json.dumps(schema(SCHEMAS[name]), indent=1, ensure_ascii=False) + "\n"


def page_text() -> str:
    """The committed text of the page that tells of every field."""
    return page([File(name, *WRITTEN[name], record=record) for name, record in SCHEMAS.items()])


def main(folder: Path) -> None:
    """Write every schema into a folder, and the page."""
    write_whole(folder / "README.md", page_text())
    for name in SCHEMAS:
        write_whole(folder / f"{name}.schema.json", schema_text(name))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
