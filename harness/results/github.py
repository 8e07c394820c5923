"""GitHub annotations and step summary, shown on a pull request.

Workflow commands: https://docs.github.com/actions/reference/workflow-commands-for-github-actions
"""

import io
import os
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO, cast

from msgspec.structs import replace

from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.codes import part_code
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results
from .causes import cause_sentences
from .issues import audited_alike, named_models, untold_failures
from .messages import with_code
from .next_steps import ProposedChange, changes_of, stated_changes
from .places import placed, shown_line, shown_path
from .visible import visible

MAX_ANNOTATIONS = 10
"""Maximum number of annotations that GitHub shows per step and level."""

MOST_SUMMARY = 1024 * 1024
"""Maximum size of a step summary in bytes; GitHub drops a longer one."""

_TRUNCATED = "\n\n(cut: the rest is in the artifacts)\n"
_LONGEST = 4000


_RANKS = (Outcome.FAILED, Outcome.DIFFERS, Outcome.UNRESOLVED, Outcome.REFUSED, Outcome.ABSENT)
"""Annotated outcomes, worst first."""


@dataclass(frozen=True, kw_only=True)
class Annotation:
    """An annotation at a place.

    Attributes:
        level: `error`, `warning` or `notice`.
        code: message code; empty without one.
        file: the annotated file.
        line: line in the file, counted from 1; None for the whole file.
        locations: all known locations; the first one is at `line`.
        changes: changes of numbers in files that fix the problem.
        model: the model that the files belong to.
    """

    level: str
    code: str = ""
    file: Path
    line: int | None
    title: str
    message: str
    locations: tuple[SourceLine, ...] = ()
    changes: tuple[ProposedChange, ...] = ()
    model: Model | None = None

    def command(self, root: Path) -> str:
        """Return the workflow command; paths inside the repository are relative."""
        path = self.file.resolve()
        inside = path.relative_to(root) if path.is_relative_to(root) else path
        where = f"file={_property(inside.as_posix())}"
        where += "" if self.line is None else f",line={self.line}"
        title = _property(" ".join(filter(None, (self.code, self.title)))[:200])
        message = _data(self.message[:_LONGEST])
        return f"::{self.level} {where},title={title}::{message}".replace("##[", "## [")

    @property
    def concise(self) -> str:
        """The line `file:line: CODE message`, as editors and other linters expect."""
        where = SourceLine(file=str(self.file), line=self.line)
        return concise_line(where, self.code, self.message)


def concise_line(where: SourceLine, code: str, message: str) -> str:
    """Return `file:line: CODE message`, with a path relative to the working folder."""
    place = replace(where, file=shown_path(where.file))
    return visible(f"{place}: {with_code(code, ' '.join(message.split()))}")


def run_notes(results: Results) -> list[Annotation]:
    """Return one annotation per distinct problem: cases, audits and failures of a model."""
    return [*case_notes(results), *_audit_notes(results), *_failure_notes(results)]


def _audit_notes(results: Results) -> Iterator[Annotation]:
    """Yield one annotation per audit finding, at its line if it has one."""
    for alike in audited_alike(one for one in results.models if not one.accepted):
        model = alike[0]
        for finding in model.findings:
            changes = tuple(stated_changes(model, [finding]))
            new = f"; write {changes[0].new}" if changes else ""
            title = f"audit of {named_models(alike)}"
            yield _finding_note(model, finding, "error", title, new, changes=changes, model=model)


def advice(results: Results) -> list[Annotation]:
    """Return one notice per implausible number, which fails nothing."""
    rows = {
        (model.folder, model.model, one.code, one.message): (model, one)
        for model in results.models for one in model.advice
    }  # fmt: skip
    return [_finding_note(*row, "notice", f"advice on {row[0].id}") for row in rows.values()]


def _finding_note(
    model: Model, finding: AuditFinding, level: str, title: str, more: str = "", /, **fields: Any
) -> Annotation:
    where = [finding.location] if finding.location is not None else []
    fields |= {"level": level, "code": finding.code, "title": title}
    return _note((model.folder, model.model), where, message=f"{finding.message}{more}", **fields)


def _failure_notes(results: Results) -> Iterator[Annotation]:
    """Yield failures of a model that none of its cases reports."""
    for model, what, why in untold_failures(results):
        title = f"{Outcome.FAILED} {what} of {model.id}"
        place = model.folder, model.model
        yield _note(
            place, [], level="error", code=part_code(), title=title, message=why, model=model
        )


def _note(place: tuple[str, str], blamed: Iterable[SourceLine], **fields: Any) -> Annotation:
    """Build an annotation at the first known line."""
    folder = Path(place[0])
    file = folder if folder.is_file() else folder / place[1]
    shown = (shown_line(place[0], where) for where in blamed)
    in_files = tuple(one for one in shown if one.line is not None and Path(one.file).is_file())
    first = (Path(in_files[0].file), in_files[0].line) if in_files else (file, None)
    if not in_files and not file.is_file():
        first = folder, None
    return Annotation(file=first[0], line=first[1], locations=in_files, **fields)


def case_notes(results: Results) -> list[Annotation]:
    """Return one annotation per model that does not agree, worst first, at its cause."""
    bad = [case for case in results.cases if case.outcome in _RANKS and not case.accepted]
    bad.sort(key=lambda case: (_RANKS.index(case.outcome), -_discrepancy(case)))
    worst: dict[tuple[str, str, str], Case] = {}
    for case in bad:
        worst.setdefault(case.key, case)
    return [case_note(case, results.model_of(case)) for case in worst.values()]


def case_note(case: Case, model: Model | None) -> Annotation:
    """Return the annotation of a case that does not agree, at the line of the diagnosed cause.

    Without a diagnosed cause, use the line of the first audit finding.
    """
    message, blamed = case.reason, list(case.locations)
    diagnosis, code = model.diagnosis if model else None, case.code
    changes: list[ProposedChange] = []
    if model and diagnosis and diagnosis.explained and diagnosis.explanations:
        best = placed(diagnosis.explanations[0], model.folder)
        message = f"{' and '.join(cause_sentences(best)[:-1])}: {message}"
        blamed = [one for cause in best.causes for one in cause.locations]
        code = best.causes[0].code
        changes = changes_of(model)
        if len(changes) < len(best.causes):
            changes = []  # one of two causes alone does not fix the model
    elif model and (unexplained := model.unexplained_findings):
        message = f"{unexplained[0].message}: {message}"
        blamed = [one.location for one in unexplained if one.location is not None]
    return _note(
        (case.folder, case.model),
        blamed,
        level="error" if case.outcome.is_run or case.outcome is Outcome.FAILED else "warning",
        code=code,
        title=f"{case.outcome} {case.id}",
        message=message,
        changes=tuple(changes),
        model=model,
    )


def _discrepancy(case: Case) -> float:
    return (case.verdict.discrepancy or 0.0) if case.verdict else 0.0


def in_ci(environment: Mapping[str, str] | None = None) -> bool:
    """Return whether CI or GITHUB_ACTIONS is set to a true value."""
    given = os.environ if environment is None else environment
    off = ("", "0", "false", "no", "off")
    return any(given.get(name, "").strip().lower() not in off for name in ("CI", "GITHUB_ACTIONS"))


def on_github(environment: Mapping[str, str]) -> bool:
    """Return whether the output is a log that GitHub searches for workflow commands."""
    return environment.get("GITHUB_ACTIONS", "").lower() == "true"


def commands(annotations: Sequence[Annotation], environment: Mapping[str, str]) -> list[str]:
    """Return the first ten workflow commands on GitHub; an empty list elsewhere."""
    if not on_github(environment):
        return []
    root = Path(environment.get("GITHUB_WORKSPACE") or Path.cwd()).resolve()
    return [annotation.command(root) for annotation in annotations[:MAX_ANNOTATIONS]]


def plain_line(line: str) -> str:
    """Change a line so that no name in it makes GitHub read it as a workflow command."""
    shown = line.replace("##[", "## [")
    return f"| {shown}" if shown.lstrip().startswith("::") else shown


def harmless_json(text: str) -> str:
    """Return equivalent JSON in which GitHub finds no workflow command."""
    return text.replace("##[", "##\\u005b")


class LogStream(io.TextIOBase):
    """A stream to a GitHub log in which only intended lines are workflow commands.

    Attributes:
        inner: the stream to write to, in whole lines.
    """

    def __init__(self, inner: TextIO) -> None:
        self.inner = inner
        self._pending, self._within = "", False

    def isatty(self) -> bool:
        """Return whether the inner stream is a terminal."""
        return self.inner.isatty()

    def fileno(self) -> int:
        """Return the descriptor of the inner stream."""
        return self.inner.fileno()

    def write(self, text: str) -> int:
        """Write the complete lines."""
        *whole, self._pending = (self._pending + text).split("\n")
        for line in whole:
            self.inner.write(f"{self._plain(line)}\n")
            self._within = False
        return len(text)

    def flush(self) -> None:
        """Write an incomplete line too, unless more text could turn it into a command."""
        text = self._pending
        if text.strip() not in ("", ":") and not text.endswith("#"):
            self._write_begun()
        self.inner.flush()

    def end(self) -> None:
        """Write the remaining text."""
        self._write_begun()
        self.inner.flush()

    def command(self, line: str) -> None:
        """Write an intended workflow command at the start of a line."""
        if self._pending or self._within:
            self.write("\n")
        self.inner.write(f"{line}\n")

    def _write_begun(self) -> None:
        self.inner.write(self._plain(self._pending))
        self._within = self._within or bool(self._pending)
        self._pending = ""

    def _plain(self, line: str) -> str:
        first, *rest = line.split("\r")  # also ends a line in the log
        first = first.replace("##[", "## [") if self._within else plain_line(first)
        return "\r".join([first, *map(plain_line, rest)])


def print_commands(lines: Iterable[str]) -> None:
    """Print workflow commands that GitHub must execute."""
    for line in lines:
        if isinstance(sys.stdout, LogStream):
            sys.stdout.command(line)
        else:
            print(line)


@contextmanager
def plain_logs() -> Iterator[None]:
    """Keep workflow commands in names out of the standard streams within this context.

    Regular files are quoted as well, since a later step may print them.
    """
    kept = sys.stdout, sys.stderr
    logs = [LogStream(stream) for stream in kept]
    sys.stdout, sys.stderr = (cast(TextIO, log) for log in logs)
    try:
        yield
    finally:
        for log in logs:
            log.end()
        sys.stdout, sys.stderr = kept


def write_summary(text: str, environment: Mapping[str, str]) -> None:
    """Append to the step summary if there is one, truncated to GitHub's size limit.

    Raises:
        OSError: if the file can't be written.
    """
    name = environment.get("GITHUB_STEP_SUMMARY")
    if not name:
        return
    path = Path(name)
    room = MOST_SUMMARY - (path.stat().st_size if path.is_file() else 0)
    data = text.encode()
    if len(data) > room:
        kept_bytes = max(0, room - len(_TRUNCATED.encode()))
        data = data[:kept_bytes].decode(errors="ignore").encode() + _TRUNCATED.encode()
        data = data if len(data) <= room else b""
    with path.open("ab") as file:
        file.write(data)


def _data(text: str) -> str:
    text = "".join(c if c in "\r\n" else visible(c) for c in text)
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _data(text).replace(":", "%3A").replace(",", "%2C")
