"""GitHub's annotations and step summary: what a person sees on a pull request.

Workflow commands: https://docs.github.com/actions/reference/workflow-commands-for-github-actions
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from harness.records.base import SourceLine
from harness.records.case import Case
from harness.records.model import Model
from harness.records.outcome import Outcome
from harness.records.results import Results
from harness.text.visible import visible

MOST = 10
"""Annotations that GitHub shows of a step and level."""

MOST_SUMMARY = 1024 * 1024
"""Bytes that a step's summary may have; GitHub drops one that has more."""

_CUT = "\n\n(cut: the rest is in the artifacts)\n"
_LONGEST = 4000


_RANKS = (Outcome.FAILED, Outcome.DIFFERS, Outcome.UNRESOLVED, Outcome.REFUSED, Outcome.ABSENT)
"""What is annotated, worst first."""


@dataclass(frozen=True, kw_only=True)
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
        message = _data(self.message[:_LONGEST])
        return f"::{self.level} file={where},line={self.line},title={title}::{message}"


def case_notes(results: Results) -> list[Annotation]:
    """An annotation for each model of a run that does not agree, worst first, at its cause."""
    bad = [case for case in results.cases if case.outcome in _RANKS and not case.accepted]
    bad.sort(key=lambda case: (_RANKS.index(case.outcome), -_discrepancy(case)))
    worst: dict[tuple[str, str, str], Case] = {}
    for case in bad:
        worst.setdefault(case.key, case)
    return [case_note(case, results.model_of(case)) for case in worst.values()]


def case_note(case: Case, model: Model | None) -> Annotation:
    """The annotation of a case that does not agree, at the line of the diagnosed cause.

    Where no cause explains it, the first line that the audit finds something wrong in.
    """
    folder = Path(case.folder)
    file = folder / case.model
    path, line, message = (file if file.is_file() else folder), 1, case.reason
    diagnosis = model.diagnosis if model else None
    blamed: list[SourceLine] = []
    if diagnosis and diagnosis.explained and diagnosis.explanations:
        causes = diagnosis.explanations[0].causes
        message = f"{' and '.join(str(cause) for cause in causes)}: {message}"
        blamed = [one for cause in causes for one in cause.where]
    elif model and (found := model.unexplained_findings):
        message = f"{found[0].message}: {message}"
        blamed = [one.where for one in found if one.where is not None]
    path, line = _first_line(blamed, folder) or (path, line)
    return Annotation(
        level="error" if case.outcome.is_run or case.outcome is Outcome.FAILED else "warning",
        file=path,
        line=line,
        title=f"{case.outcome} {case.id}",
        message=message,
    )


def _first_line(blamed: Sequence[SourceLine], folder: Path) -> tuple[Path, int] | None:
    """The first line that is blamed, of those that are of a file of the folder."""
    for where in blamed:
        file = folder / Path(where.file).name
        if where.line is not None and file.is_file():
            return file, where.line
    return None


def _discrepancy(case: Case) -> float:
    return (case.verdict.discrepancy or 0.0) if case.verdict else 0.0


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


def plain_line(line: str, environment: Mapping[str, str]) -> str:
    """A line for a log that GitHub takes for no workflow command, whatever names stand in it."""
    if environment.get("GITHUB_ACTIONS", "").lower() != "true":
        return line
    shown = line.replace("##[", "## [")
    return f"| {shown}" if shown.lstrip().startswith("::") else shown


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
    text = "".join(c if c in "\r\n" else visible(c) for c in text)
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _data(text).replace(":", "%3A").replace(",", "%2C")
