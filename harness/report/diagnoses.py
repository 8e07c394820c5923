"""What the report says of a model that differs: the cause, what else it may be, and the line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from harness.report.text import percent, sci, shown
from harness.text.causes import cause_sentences

Record = Mapping[str, Any]


@dataclass(frozen=True)
class Line:
    """One line of a file."""

    number: int
    text: str
    marked: bool


@dataclass(frozen=True)
class FindingView:
    """One hypothesis, or a pair, in the order of the ranking."""

    cause: str
    kind: str
    nominal: str
    estimate: str
    left: str
    tied: str
    where: str


@dataclass(frozen=True)
class DiagnosisView:
    """What is wrong with one model in one engine.

    Attributes:
        id: its permalink.
        sentence: the cause.
        explained: whether it leaves no more than the uncertainty.
        findings: ranked.
        files: the model file, or its sidecar, with the lines about the marked ones; None stands
            for what is left out.
        audit: what was found by reading, (severity, message, where).
        cases: permalinks of the cases that differ, with their scenarios.
        pack: id of its numbers and plots; empty without.
    """

    id: str
    system: str
    model: str
    engine: str
    sentence: str
    explained: bool
    findings: tuple[FindingView, ...]
    files: tuple[tuple[str, tuple[Line | None, ...]], ...]
    audit: tuple[tuple[str, str, str], ...]
    cases: tuple[tuple[str, str], ...]
    pack: str


CONTEXT = 4
"""Lines shown before and after a marked one."""


def diagnosis_view(
    model: Record, identity: str, pack: str, cases: Sequence[tuple[str, str]]
) -> DiagnosisView:
    """The view of a model's diagnosis and audit.

    Args:
        model: its record.
        identity: its permalink.
        pack: id of its numbers and plots; empty without.
        cases: (permalink, scenario) of the cases that differ.
    """
    diagnosis = model.get("diagnosis") or {}
    findings = diagnosis.get("findings", ())
    audit = [entry for entry in model.get("audit", ()) if entry["severity"] == "finding"]
    named = list(findings[0]["where"]) if findings and diagnosis.get("explained") else []
    named += [entry["where"] for entry in audit]
    return DiagnosisView(
        id=identity,
        system=shown(model["system"]),
        model=shown(model["model"]),
        engine=shown(model["engine"]),
        sentence=sentence(model),
        explained=bool(diagnosis.get("explained")),
        findings=tuple(_finding(one) for one in findings),
        files=_files(model, named),
        audit=tuple((shown(e["kind"]), shown(e["message"]), _short(e["where"])) for e in audit),
        cases=tuple(cases),
        pack=pack,
    )


def sentence(model: Record) -> str:
    """The cause in one sentence; what is known instead where there is none."""
    diagnosis = model.get("diagnosis")
    audit = [entry for entry in model.get("audit", ()) if entry["severity"] == "finding"]
    if diagnosis is None:
        return shown(audit[0]["message"]) if audit else ""
    if not diagnosis.get("findings"):
        return f"Not diagnosed: {shown(diagnosis.get('reason') or 'no hypothesis fits')}."
    best = diagnosis["findings"][0]
    if not diagnosis["explained"]:
        return (
            f"Unexplained: the best single cause, {shown(best['cause'])}, leaves"
            f" {percent(best['remaining'])} of the discrepancy."
        )
    causes = cause_sentences(best)[:-1]
    return f"{shown(' and '.join(causes))}."


def _finding(one: Record) -> FindingView:
    errors = one["standard_error"]
    return FindingView(
        cause=shown(one["cause"]),
        kind=shown(one["kind"]),
        nominal=", ".join(_number(value) for value in one["nominal"]),
        estimate=", ".join(
            f"{_number(value)} ± {sci(error)}"
            for value, error in zip(one["estimate"], errors, strict=True)
        ),
        left=sci(one["remaining"]),
        tied=", ".join(shown(name) for name in one["tied_with"]),
        where=", ".join(_short(place) for place in one["where"] if place),
    )


def _number(value: float | None) -> str:
    return "?" if value is None else f"{value:.9g}"


def _short(where: str) -> str:
    """`file:line` without the folders."""
    return shown(where.replace("\\", "/").rsplit("/", 1)[-1])


def _files(model: Record, places: Sequence[str]) -> tuple[tuple[str, tuple[Line | None, ...]], ...]:
    """The model file and its sidecar, those of them that a place names."""
    name = model["model"]
    texts = {name: model["text"], f"{name}.toml": model.get("sidecar", "")}
    found = ((file, _lines(text, _marked(places, file))) for file, text in texts.items())
    return tuple((shown(file), lines) for file, lines in found if lines)


def _marked(places: Sequence[str], file: str) -> set[int]:
    found = set()
    for place in places:
        name, _, line = place.rpartition(":")
        if name.endswith(file) and line.isdigit():
            found.add(int(line))
    return found


def _lines(text: str, marked: set[int]) -> tuple[Line | None, ...]:
    rows: list[Line | None] = []
    for number, row in enumerate(text.splitlines(), 1):
        if any(abs(number - one) <= CONTEXT for one in marked):
            rows.append(Line(number, shown(row), number in marked))
        elif rows and rows[-1] is not None:
            rows.append(None)
    return tuple(rows)
