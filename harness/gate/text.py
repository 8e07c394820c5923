"""A gate's findings as lines for a terminal or a log, and as Markdown for a step summary."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from harness.baseline.changes import Change, Status
from harness.gate.gate import GateResult
from harness.text.github import Annotation, case_notes

QUIET = (Status.SAME,)
"""Cases of which a log says nothing but their number."""

MOST_TOLD = 200
"""Cases told in a log or a summary: beyond, the results say more."""


def gate_lines(found: GateResult) -> list[str]:
    """Plain lines: each case that is not simply as accepted, what changed in the files, a total."""
    lines = []
    told = [change for change in found.changes if change.status not in QUIET]
    for change in told[:MOST_TOLD]:
        kinds = f" ({', '.join(change.kinds)})" if change.kinds else ""
        lines.append(f"{change.status.upper()} {change.case}{kinds}")
        lines += [f"  {sentence}" for sentence in _sentences(change)]
    if len(told) > MOST_TOLD:
        lines.append(f"and {len(told) - MOST_TOLD} more")
    for story in found.stories:
        models = f" (for {', '.join(story.models)})" if story.models != (story.name,) else ""
        lines.append(f"changed file of {story.system}: {story.name}{models}")
        lines += [f"  {_relative(spot.file)}:{spot.line}: {spot.said}" for spot in story.spots]
        if story.more:
            lines.append(f"  and {story.more} lines more")
    lines += _causes(found)
    return [*lines, total(found)]


def total(found: GateResult) -> str:
    """One line: how many cases of each kind, how many were run, and the verdict."""
    counts = Counter(change.status for change in found.changes)
    parts = [f"{counts[status]} {status}" for status in Status if counts[status]]
    ran = sum(change.record is not None for change in found.changes)
    verdict = "the gate passes" if found.passes else "the gate fails"
    if not found.changes:
        return "no case at all: the gate fails"
    return (
        f"{len(found.changes)} cases: {', '.join(parts)}; {ran} run, {found.seconds:.1f} s:"
        f" {verdict}"
    )


def notes(found: GateResult) -> list[Annotation]:
    """An annotation for each changed model and declaration, worst first, at the changed line."""
    made: dict[tuple[str, str, Status], Annotation] = {}
    for change in found.changes:
        if change.status in (Status.SAME, Status.WITHIN, Status.KNOWN):
            continue
        model = change.key.split("/", 1)[0]
        about = (change.system, model, change.status)
        if about in made:
            continue
        path, line, said = _place(found, change)
        same = [c for c in found.changes if (c.system, c.key.split("/", 1)[0], c.status) == about]
        others = f" (and {len(same) - 1} cases more)" if len(same) > 1 else ""
        message = "; ".join([*_sentences(change), *([said] if said else [])])
        level = "notice" if change.status is Status.IMPROVED else "error"
        title = f"{change.status}: {change.case}{others}"
        made[about] = Annotation(level, path, line, title, message)
    return list(made.values())


def summary(found: GateResult) -> str:
    """The findings as Markdown."""
    lines = [f"## crosscheck gate: {'passes' if found.passes else 'fails'}", "", total(found), ""]
    told = [change for change in found.changes if change.status not in QUIET]
    if told:
        lines += ["| case | | what changed | |", "|---|---|---|---|"]
        for change in told[:MOST_TOLD]:
            said = "<br>".join(_cell(sentence) for sentence in _sentences(change))
            kinds = ", ".join(change.kinds)
            lines.append(f"| {_cell(change.case)} | {change.status} | {kinds} | {said} |")
        if len(told) > MOST_TOLD:
            lines += ["", f"and {len(told) - MOST_TOLD} more"]
    for story in found.stories:
        lines += ["", f"**{_cell(story.system)}/{_cell(story.name)}**", ""]
        lines += [
            f"- `{_relative(spot.file)}:{spot.line}` {_cell(spot.said)}" for spot in story.spots
        ]
        if story.more:
            lines.append(f"- and {story.more} lines more")
    causes = _causes(found)
    if causes:
        lines += ["", *(f"- {_cell(cause.strip())}" for cause in causes)]
    return "\n".join(lines) + "\n"


def _sentences(change: Change) -> Sequence[str]:
    if change.status is Status.KNOWN and change.entry is not None:
        return [f"{change.entry['outcome']}, accepted: {change.entry['reason']}", *change.told]
    return change.told


def _causes(found: GateResult) -> list[str]:
    """What the diagnosis says of models that differ."""
    if found.results is None:
        return []
    # Imported here: it brings the verdicts, and with them sympy.
    from harness.text.causes import cause_sentences

    lines = []
    for model in found.results["models"]:
        diagnosis = model.get("diagnosis") or {}
        if diagnosis.get("findings") and diagnosis["explained"]:
            lines.append(f"cause in {model['system']}/{model['model']} [{model['engine']}]")
            lines += [f"  {sentence}" for sentence in cause_sentences(diagnosis["findings"][0])]
    return lines


def _place(found: GateResult, change: Change) -> tuple[Path, int, str]:
    """Where a change is to be shown: the diagnosed cause, a changed spot, or the model file."""
    model = change.key.split("/", 1)[0]
    if change.record is not None and change.record["outcome"] == "DIFFERS":
        for note in case_notes({"cases": [change.record], "models": found.diagnosed}):
            if note.line > 1:
                return note.file, note.line, note.message
    first = ["system.py", model] if "equations" in change.kinds else [model, f"{model}.toml"]
    mine = [s for s in found.stories if s.system == change.system and model in s.models]
    for story in sorted(mine, key=lambda s: first.index(s.name) if s.name in first else 2):
        for spot in story.spots:
            return spot.file, spot.line, spot.said
    scan = found.folders.get(change.system)
    if scan is None:
        return Path("."), 1, ""
    return (scan.folder / model if (scan.folder / model).is_file() else scan.folder), 1, ""


def _relative(path: Path) -> str:
    try:
        return path.resolve().relative_to(Path.cwd()).as_posix()
    except ValueError:
        return path.as_posix()


def _cell(text: str) -> str:
    for old, new in (
        ("&", "&amp;"),
        ("<", "&lt;"),
        (">", "&gt;"),
        ("|", "\\|"),
        ("`", "&#96;"),
        ("\n", " "),
    ):
        text = text.replace(old, new)
    return text
