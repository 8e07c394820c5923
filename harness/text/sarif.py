"""What a run found as SARIF 2.1.0, which code hosts and editors show at the lines it is about.

https://docs.oasis-open.org/sarif/sarif/v2.1.0/sarif-v2.1.0.html
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from urllib.parse import quote

from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.text.github import Annotation, run_notes
from physics_crosscheck.harness.text.next_steps import Change
from physics_crosscheck.harness.text.places import column, is_spelled, shown_path
from physics_crosscheck.harness.text.visible import visible

SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/os/schemas/sarif-schema-2.1.0.json"

_RULES = {
    "differs": "the model's motion is not that of the equations",
    "unresolved": "the motion is not known as closely as was asked",
    "failed": "the case could not be run",
    "absent": "the engine is not installed",
    "audit": "a number, a frame or a compiled term is not that of the equations",
}


def sarif(results: Results) -> str:
    """Return the JSON of a log with one run, whose files are relative to the working folder."""
    driver: dict[str, object] = {
        "name": "crosscheck",
        "rules": [
            {"id": name, "shortDescription": {"text": text}} for name, text in _RULES.items()
        ],
    }
    if version := results.versions.get("physics-crosscheck"):
        driver["version"] = version
    run = {
        "tool": {"driver": driver},
        "columnKind": "unicodeCodePoints",
        "newlineSequences": ["\r\n", "\r", "\n"],
        "results": [_result(note) for note in run_notes(results)],
    }
    return json.dumps({"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}, indent=1)


def _result(note: Annotation) -> dict[str, object]:
    """A result at all its places where each must change, else at the first with the rest beside."""
    artifact = {"artifactLocation": {"uri": _uri(note.file)}}
    places = list(_places(note)) or [{"physicalLocation": artifact}]
    count = len(places) if note.changes else 1
    result: dict[str, object] = {
        "ruleId": note.rule,
        "ruleIndex": list(_RULES).index(note.rule),
        "level": "note" if note.level == "notice" else note.level,
        "message": {"text": _message(f"{note.title}: {note.message}")},
        "locations": places[:count],
    }
    if places[count:]:
        result["relatedLocations"] = places[count:]
    if fix := _fix(note.changes, note.model):
        result["fixes"] = [fix]
    return result


def _places(note: Annotation) -> Iterator[dict[str, object]]:
    """The locations that are known, each once."""
    seen: list[object] = []
    for where in note.locations:
        region = _region(where, note.model) or {"startLine": where.line}
        place = {"artifactLocation": {"uri": _uri(Path(where.file))}, "region": region}
        if place not in seen:
            seen.append(place)
            yield {"physicalLocation": place}


def _fix(changes: Iterable[Change], model: Model | None) -> dict[str, object] | None:
    """All replacements together; None where a file no longer has the text of one."""
    files: dict[str, list[object]] = {}
    told = []
    for change in changes:
        told.append(f"change {change}")
        for where in change.locations:
            region = _region(where, model)
            if region is None:
                return None
            replacement = {"deletedRegion": region, "insertedContent": {"text": change.new}}
            files.setdefault(_uri(Path(where.file)), []).append(replacement)
    if not files:
        return None
    return {
        "description": {"text": _message("; ".join(told))},
        "artifactChanges": [
            {"artifactLocation": {"uri": uri}, "replacements": replacements}
            for uri, replacements in files.items()
        ],
    }


def _region(where: SourceLine, model: Model | None) -> dict[str, object] | None:
    """The characters of a number; None where the model's files have no such text there."""
    if model is None:
        return None
    for name, text in ((model.model, model.text), (f"{model.model}.toml", model.sidecar)):
        if is_spelled(where, name, text.encode()):
            start = column(where, text)
            end = start + len(where.text)
            return {
                "startLine": where.line, "startColumn": start,
                "endLine": where.line, "endColumn": end,
            }  # fmt: skip
    return None


def _message(text: str) -> str:
    """A plain text message in which nothing is a link or a placeholder (sections 3.11.5, 6)."""
    text = "".join(c if c == "\n" else visible(c) for c in text)
    return re.sub(r"([{}])", r"\1\1", text.replace("](", "] ("))


def _uri(file: Path) -> str:
    shown = Path(shown_path(file))
    if shown.is_absolute():
        return Path(os.path.abspath(file)).as_uri()
    return quote(os.fsencode(shown.as_posix()))
