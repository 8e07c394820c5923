"""A gate's findings as lines for a terminal or a log, and as Markdown for a step summary."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from physics_crosscheck.harness.baseline.changes import Status
from physics_crosscheck.harness.baseline.classify import Change
from physics_crosscheck.harness.gate.file_diffs import FileDiff
from physics_crosscheck.harness.gate.result import GateResult
from physics_crosscheck.harness.text.causes import cause_sentences
from physics_crosscheck.harness.text.status import counted
from physics_crosscheck.harness.text.visible import visible_lines

QUIET = (Status.SAME,)
"""Cases of which a log says nothing but their number."""

MOST_TOLD = 200
"""Cases told in a log or a summary: beyond, the results say more."""

_MARKUP = re.compile(r"[<>|`*~\[\]!\\$#]|(?<![^\W_])_|_(?![^\W_])")
"""Characters that Markdown, or GitHub's formulas, read as markup."""

_REFERENCE = re.compile(r"@|&#35;(?=\d)|www(?=\.)|https?(?=:)|ftp(?=:)")
"""What begins a mention, a reference to an issue or a link, in what is shown already: a comment
behind it ends it."""


def gate_lines(found: GateResult) -> list[str]:
    """Plain lines: each case that is not simply as accepted, what changed in the files, a total."""
    lines = []
    told = [change for change in found.changes if change.status not in QUIET]
    for change in told[:MOST_TOLD]:
        lines += change_lines(change)
    if len(told) > MOST_TOLD:
        lines.append(f"and {len(told) - MOST_TOLD} more")
    for diff in found.file_diffs:
        lines += diff_lines(diff)
    lines += _causes(found)
    lines += [f"FAILED {failure}" for failure in found.failures]
    return [*lines, total(found)]


def change_lines(change: Change) -> list[str]:
    """What became of a case."""
    kinds = f" ({', '.join(change.kinds)})" if change.kinds else ""
    told = [f"  {sentence}" for sentence in sentences(change)]
    return [f"{change.status.upper()} {change.id}{kinds}", *told]


def diff_lines(diff: FileDiff) -> list[str]:
    """What changed in a file."""
    models = f" (for {', '.join(diff.models)})" if diff.models != (diff.name,) else ""
    lines = [f"changed file of {diff.system}: {diff.name}{models}"]
    lines += [f"  {_relative(one.file)}:{one.line}: {one.message}" for one in diff.lines]
    return [*lines, f"  and {counted(diff.more, 'line')} more"] if diff.more else lines


def total(found: GateResult) -> str:
    """One line: how many cases of each kind, how many were run, and the verdict."""
    counts = Counter(change.status for change in found.changes)
    parts = [f"{counts[status]} {status}" for status in Status if counts[status]]
    ran = sum(change.case is not None for change in found.changes)
    verdict = "the gate passes" if found.passes else "the gate fails"
    if not found.changes:
        return "no case at all: the gate fails"
    told = f"{counted(len(found.changes), 'case')}: {', '.join(parts)}"
    return f"{told}; {ran} run, {found.seconds:.1f} s: {verdict}"


def summary(found: GateResult) -> str:
    """The findings as Markdown."""
    lines = [f"## crosscheck gate: {'passes' if found.passes else 'fails'}", "", total(found), ""]
    told = [change for change in found.changes if change.status not in QUIET]
    if told:
        lines += ["| case | | what changed | |", "|---|---|---|---|"]
        for change in told[:MOST_TOLD]:
            said = "<br>".join(_cell(sentence) for sentence in sentences(change))
            kinds = ", ".join(change.kinds)
            lines.append(f"| {_cell(str(change.id))} | {change.status} | {kinds} | {said} |")
        if len(told) > MOST_TOLD:
            lines += ["", f"and {len(told) - MOST_TOLD} more"]
    for diff in found.file_diffs:
        lines += ["", f"**{_cell(diff.system)}/{_cell(diff.name)}**", ""]
        lines += [
            f"- {_code(f'{_relative(one.file)}:{one.line}')} {_cell(one.message)}"
            for one in diff.lines
        ]
        if diff.more:
            lines.append(f"- and {counted(diff.more, 'line')} more")
    causes = [*_causes(found), *(f"FAILED {failure}" for failure in found.failures)]
    if causes:
        lines += ["", *(f"- {_cell(cause.strip())}" for cause in causes)]
    return "\n".join(lines) + "\n"


def sentences(change: Change) -> Sequence[str]:
    """What is told of a case; of a known difference, the reason it was accepted with first."""
    if change.status is Status.KNOWN and change.entry is not None:
        return [f"{change.entry.outcome}, accepted: {change.entry.reason}", *change.messages]
    return change.messages


def _causes(found: GateResult) -> list[str]:
    """What the diagnosis says of models that differ."""
    lines: list[str] = []
    for model in found.results.models if found.results else ():
        diagnosis = model.diagnosis
        if diagnosis and diagnosis.explained and diagnosis.explanations:
            lines.append(f"cause in {model.id}")
            lines += [f"  {said}" for said in cause_sentences(diagnosis.explanations[0])]
    return lines


def _relative(path: Path) -> str:
    try:
        return path.resolve().relative_to(Path.cwd()).as_posix()
    except ValueError:
        return path.as_posix()


def _cell(text: str) -> str:
    """Text of one line as Markdown shows it: no markup, link, mention or reference to an issue."""
    text = " ".join(visible_lines(text)).replace("&", "&amp;")
    text = _MARKUP.sub(lambda found: f"&#{ord(found[0])};", text)
    return _REFERENCE.sub(r"\g<0><!-- -->", text)


def _code(text: str) -> str:
    """Text of one line as a code span, whose fence is longer than any run of backticks in it."""
    text = " ".join(visible_lines(text))
    fence = "`" * (1 + max(map(len, re.findall("`+", text)), default=0))
    pad = " " if "`" in text else ""
    return f"{fence}{pad}{text}{pad}{fence}"
