"""GitHub's annotations and step summary: what a person sees on a pull request.

Workflow commands: https://docs.github.com/actions/reference/workflow-commands-for-github-actions
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

MOST = 10
"""Annotations that GitHub shows of a step and level."""

MOST_SUMMARY = 1024 * 1024
"""Bytes that a step's summary may have; GitHub drops one that has more."""

_CUT = "\n\n(cut: the rest is in the artifacts)\n"
_LONGEST = 4000


@dataclass(frozen=True)
class Annotation:
    """A note at a place; its level is `error`, `warning` or `notice`, its line counted from 1."""

    level: str
    file: Path
    line: int
    title: str
    message: str

    def command(self, root: Path) -> str:
        """The workflow command, its file relative to the repository's root where it is inside."""
        path = self.file.resolve()
        inside = path.relative_to(root) if path.is_relative_to(root) else path
        where = _property(inside.as_posix())
        title = _property(self.title[:200])
        return (
            f"::{self.level} file={where},line={self.line},title={title}"
            f"::{_data(self.message[:_LONGEST])}"
        )


def case_notes(results: Mapping[str, Any]) -> list[Annotation]:
    """An annotation for each model of a run that does not agree, worst first, at its cause."""
    ranks = ("FAILED", "DIFFERS", "UNRESOLVED", "ABSENT")
    bad = [c for c in results["cases"] if c["outcome"] in ranks and not c.get("accepted")]
    bad.sort(key=lambda c: (ranks.index(c["outcome"]), -(c["discrepancy"] or 0.0)))
    causes = {
        (m["folder"], m["model"], m["engine"]): m["diagnosis"]
        for m in results["models"]
        if (m.get("diagnosis") or {}).get("findings")
    }
    made: dict[tuple[str, str, str], Annotation] = {}
    for case in bad:
        about = case["folder"], case["model"], case["engine"]
        if about in made:
            continue
        folder = Path(case["folder"])
        file = folder / case["model"]
        path, line, message = (file if file.is_file() else folder), 1, case["reason"]
        diagnosis = causes.get(about)
        if diagnosis and diagnosis["explained"]:
            cause = diagnosis["findings"][0]
            message = f"{cause['cause']}: {message}"
            name, _, number = next((w for w in cause["where"] if w), "").rpartition(":")
            if number.isdigit() and (folder / Path(name).name).is_file():
                path, line = folder / Path(name).name, int(number)
        level = "warning" if case["outcome"] == "ABSENT" else "error"
        title = f"{case['outcome']} {case['system']}/{case['model']}/{case['scenario']}"
        made[about] = Annotation(level, path, line, f"{title} [{case['engine']}]", message)
    return list(made.values())


def in_ci(environment: Mapping[str, str] | None = None) -> bool:
    """Whether this runs in continuous integration: CI or GITHUB_ACTIONS is set, and says so."""
    given = os.environ if environment is None else environment
    off = ("", "0", "false", "no", "off")
    return any(given.get(name, "").strip().lower() not in off for name in ("CI", "GITHUB_ACTIONS"))


def commands(found: Sequence[Annotation], environment: Mapping[str, str]) -> list[str]:
    """Lines for a log on GitHub: at most ten, the first ones; none elsewhere."""
    if environment.get("GITHUB_ACTIONS", "").lower() != "true":
        return []
    root = Path(environment.get("GITHUB_WORKSPACE") or Path.cwd()).resolve()
    return [annotation.command(root) for annotation in found[:MOST]]


def write_summary(text: str, environment: Mapping[str, str]) -> None:
    """Append to the step's summary, where there is one, cut to what it may hold.

    Raises:
        OSError: as the file system has it.
    """
    name = environment.get("GITHUB_STEP_SUMMARY")
    if not name:
        return
    path = Path(name)
    room = MOST_SUMMARY - (path.stat().st_size if path.is_file() else 0)
    data = text.encode()
    if len(data) > room:
        keep = max(0, room - len(_CUT.encode()))
        data = data[:keep].decode(errors="ignore").encode() + _CUT.encode()
        data = data if len(data) <= room else b""
    with path.open("ab") as file:
        file.write(data)


def _data(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _data(text).replace(":", "%3A").replace(",", "%2C")
