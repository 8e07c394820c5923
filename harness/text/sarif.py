"""What a run found as SARIF 2.1.0, which code hosts and editors show at the lines it is about.

https://docs.oasis-open.org/sarif/sarif/v2.1.0/sarif-v2.1.0.html
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path

from harness.records.outcome import Outcome
from harness.records.results import Results
from harness.text.github import Annotation, case_notes
from harness.text.places import shown_line, shown_path

SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/os/schemas/sarif-schema-2.1.0.json"

_RULES = {
    "differs": "the model's motion is not that of the equations",
    "unresolved": "the motion is not known as closely as was asked",
    "failed": "the case could not be run",
    "absent": "the engine is not installed",
    "audit": "a number, a frame or a compiled term is not that of the equations",
}


def sarif(results: Results) -> str:
    """The JSON of a log with one run, whose files are told from where one stands."""
    found = [*_of_cases(results), *_of_audits(results)]
    log = {
        "$schema": SCHEMA,
        "version": "2.1.0",
        "runs": [
            {
                "tool": {
                    "driver": {
                        "name": "crosscheck",
                        "version": str(results.versions.get("physics-crosscheck")),
                        "rules": [
                            {"id": name, "shortDescription": {"text": text}}
                            for name, text in _RULES.items()
                        ],
                    }
                },
                "results": found,
            }
        ],
    }
    return json.dumps(log, indent=1)


def _of_cases(results: Results) -> Iterator[dict[str, object]]:
    for note in case_notes(results):
        outcome = note.title.split(" ", 1)[0]
        yield _result(Outcome(outcome).value.lower(), note)


def _of_audits(results: Results) -> Iterator[dict[str, object]]:
    """Findings that stand in a line, each once."""
    for model in results.models:
        for one in model.findings:
            if one.where is None or model.accepted:
                continue
            where = shown_line(model.folder, one.where)
            note = Annotation(
                level="error",
                file=Path(where.file),
                line=where.line or 1,
                title=f"audit of {model.id}",
                message=one.message,
            )
            yield _result("audit", note)


def _result(rule: str, note: Annotation) -> dict[str, object]:
    return {
        "ruleId": rule,
        "level": "note" if note.level == "notice" else note.level,
        "message": {"text": f"{note.title}: {note.message}"},
        "locations": [
            {
                "physicalLocation": {
                    "artifactLocation": {"uri": _uri(note.file)},
                    "region": {"startLine": note.line},
                }
            }
        ],
    }


def _uri(file: Path) -> str:
    shown = Path(shown_path(file))
    return Path(os.path.abspath(file)).as_uri() if shown.is_absolute() else shown.as_posix()
