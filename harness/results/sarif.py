"""Results of a run as SARIF 2.1.0, which code hosts and editors show at source lines.

https://docs.oasis-open.org/sarif/sarif/v2.1.0/sarif-v2.1.0.html
"""

import json
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path
from urllib.parse import quote, urlsplit

from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.codes import Code, codes
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.results import Results
from .github import Annotation, run_notes
from .next_steps import ProposedChange
from .places import column, is_spelled, shown_path
from .visible import visible

SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/os/schemas/sarif-schema-2.1.0.json"


def sarif(results: Results) -> str:
    """Return the JSON of a log with one run, with paths relative to the working folder."""
    notes = run_notes(results)
    names = sorted({note.code for note in notes})
    driver: dict[str, object] = {"name": "crosscheck", "rules": [_rule(codes()[c]) for c in names]}
    if version := results.versions.get("physics-crosscheck"):
        driver["version"] = version
    run = {
        "tool": {"driver": driver},
        "columnKind": "unicodeCodePoints",
        "newlineSequences": ["\r\n", "\r", "\n"],
        "results": [_result(note, names) for note in notes],
    }
    return json.dumps({"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}, indent=1)


def _rule(code: Code) -> dict[str, object]:
    """Return a message as a rule, with the address of its page (section 3.49.12) if known."""
    text = f"{code.title} {code.cause} What to do: {code.remedy}"
    rule: dict[str, object] = {
        "id": code.code,
        "name": code.name,
        "shortDescription": {"text": _message(code.title)},
        "help": {"text": _message(text)},
    }
    address = page_address(code.code)
    return {**rule, "helpUri": address} if address else rule


def page_address(code: str) -> str:
    """Return the web address of a message's page; empty if the package names no documentation.

    The address comes from the installed package, from the project URL "Documentation".
    """
    try:
        urls = metadata("physics-crosscheck").get_all("Project-URL") or ()
    except PackageNotFoundError:
        return ""
    for url in urls:
        label, _, address = (part.strip() for part in url.partition(","))
        if label.lower() == "documentation" and urlsplit(address).scheme in ("http", "https"):
            return f"{address.rstrip('/')}/messages/{code}.html"
    return ""


def _result(note: Annotation, names: Sequence[str]) -> dict[str, object]:
    """Return a result with all locations if each must change, else the first and related ones."""
    artifact = {"artifactLocation": {"uri": _uri(note.file)}}
    places = list(_places(note)) or [{"physicalLocation": artifact}]
    count = len(places) if note.changes else 1
    result: dict[str, object] = {
        "ruleId": note.code,
        "ruleIndex": names.index(note.code),
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
    """Yield each known location once."""
    seen: list[object] = []
    for where in note.locations:
        region = _region(where, note.model) or {"startLine": where.line}
        place = {"artifactLocation": {"uri": _uri(Path(where.file))}, "region": region}
        if place not in seen:
            seen.append(place)
            yield {"physicalLocation": place}


def _fix(changes: Iterable[ProposedChange], model: Model | None) -> dict[str, object] | None:
    """Return all replacements as one fix; None if a file no longer contains an old text."""
    files: dict[str, list[object]] = {}
    fix_parts = []
    for change in changes:
        fix_parts.append(f"change {change}")
        for where in change.locations:
            region = _region(where, model)
            if region is None:
                return None
            replacement = {"deletedRegion": region, "insertedContent": {"text": change.new}}
            files.setdefault(_uri(Path(where.file)), []).append(replacement)
    if not files:
        return None
    return {
        "description": {"text": _message("; ".join(fix_parts))},
        "artifactChanges": [
            {"artifactLocation": {"uri": uri}, "replacements": replacements}
            for uri, replacements in files.items()
        ],
    }


def _region(where: SourceLine, model: Model | None) -> dict[str, object] | None:
    """Return the span of a number; None if the model's files lack this text at the location."""
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
    """Return a plain text message without links and placeholders (sections 3.11.5, 6)."""
    text = "".join(c if c == "\n" else visible(c) for c in text)
    return re.sub(r"([{}])", r"\1\1", text.replace("](", "] ("))


def _uri(file: Path) -> str:
    shown = Path(shown_path(file))
    if shown.is_absolute():
        return Path(os.path.abspath(file)).as_uri()
    return quote(os.fsencode(shown.as_posix()))
