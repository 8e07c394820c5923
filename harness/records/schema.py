"""JSON Schemas and reference pages of the result files, generated from the records.

`python -m physics_crosscheck.harness.records.schema docs/schema` writes the schemas into this
folder and the pages into `docs/reference`. A test fails if they are out of date.
"""

from __future__ import annotations

import inspect
import json
import sys
from pathlib import Path
from typing import Any

import msgspec

from physics_crosscheck.harness.records.base import Record
from physics_crosscheck.harness.records.baseline import BaselineFile, Gate
from physics_crosscheck.harness.records.comparison import ComparisonResult
from physics_crosscheck.harness.records.fields import FilePage, page_texts
from physics_crosscheck.harness.records.history import Past
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.mutation import Mutations
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.records.sweep import SweepPlan, SweepRow
from physics_crosscheck.harness.records.system import SystemResult
from physics_crosscheck.harness.records.versions import Versions
from physics_crosscheck.harness.records.write import write_whole

DIALECT = "https://json-schema.org/draft/2020-12/schema"

SCHEMAS: dict[str, type[Record]] = {
    "results": Results,
    "gate": Gate,
    "baseline": BaselineFile,
    "comparison": ComparisonResult,
    "mutations": Mutations,
    "versions": Versions,
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
        schema="results",
    ),
    FilePage(
        name="results-models",
        title="results.json: models",
        reader="Scripts that read audits, diagnoses or linearizations need this page. It describes"
        " every field under `models` in [`results.json`](results.md).",
        written="`crosscheck run` writes one entry per model file and engine.",
        records=(Model,),
        schema="results",
    ),
    FilePage(
        name="results",
        title="results.json",
        reader="Scripts that evaluate runs need this page. It describes every field of a run's"
        " results.",
        written="`crosscheck run` writes `results.json` into the folder of the report.",
        records=(Results,),
        schema="results",
    ),
    FilePage(
        name="gate",
        title="gate.json",
        reader="Scripts that evaluate a gate in CI need this page. It describes every field of the"
        " gate's result.",
        written="`crosscheck gate` writes `gate.json` into `reports/gate/`.",
        records=(Gate,),
        schema="gate",
    ),
    FilePage(
        name="baseline",
        title="Baseline files",
        reader="Reviewers of a changed baseline need this page. It describes every field of an"
        " accepted result.",
        written="`crosscheck accept` writes one file per system folder,"
        " `reports/baseline/<system>.json`, and one per robot file.",
        records=(BaselineFile,),
        schema="baseline",
    ),
    FilePage(
        name="comparison",
        title="Comparison files",
        reader="Scripts that compare two models need this page. It describes every field of the"
        " comparison.",
        written="`crosscheck compare --json FILE` writes the file.",
        records=(ComparisonResult,),
        schema="comparison",
    ),
    FilePage(
        name="mutations",
        title="Mutation files",
        reader="Scripts that measure how many faults a check detects need this page. It describes"
        " every field of the result.",
        written="`crosscheck mutate --json FILE` writes the file.",
        records=(Mutations,),
        schema="mutations",
    ),
    FilePage(
        name="versions",
        title="Version comparison files",
        reader="Scripts that track engine upgrades need this page. It describes every field of the"
        " comparison of versions.",
        written="`crosscheck versions --json FILE` writes the file.",
        records=(Versions,),
        schema="versions",
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
    FilePage(
        name="history",
        title="History of runs",
        reader="Scripts that plot results over time need this page. It describes every field of the"
        " run history.",
        written="`crosscheck run` appends one JSON line per case to `history/cases.jsonl` in the"
        " folder of the report.",
        records=(Past,),
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


def main(folder: Path) -> None:
    """Write the schemas into a folder, and the pages into `reference` next to it."""
    for name in SCHEMAS:
        write_whole(folder / f"{name}.schema.json", schema_text(name))
    for name, text in page_texts(PAGES).items():
        write_whole(folder.parent / "reference" / name, text)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
