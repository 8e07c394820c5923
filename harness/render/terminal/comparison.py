"""Print a comparison of two models in a terminal."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

from msgspec.structs import replace
from rich.console import Console

from physics_crosscheck.harness.documents.reading import FLOAT_DIGITS, USD_SUFFIXES
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.comparison import (
    Compared,
    ComparedModel,
    ComparedProperty,
    ComparisonResult,
    FileDifference,
    FileEdit,
)
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.results.causes import own_file_sentence
from physics_crosscheck.harness.results.messages import with_code
from physics_crosscheck.harness.results.status import counted, listed
from .console import STYLES, WORDS, print_text, print_wrapped

MAX_ROWS = 20
"""Maximum number of each kind; the record has all."""

MAX_NAMES = 3
"""Largest number of equal differences that a line names."""

SHARE = 0.99
"""Share of a discrepancy that makes a difference its cause."""

SIX_DIGITS = 5e-6
"""Maximum relative rounding of a number written with six digits."""

MINOR = 1e-5
"""Relative difference, or effect, below which a difference is minor: one line counts them."""


def print_properties(
    console: Console, comparison: ComparisonResult, compared: Compared, *, is_named: bool = False
) -> None:
    """Print properties that differ with an effect on motions, frames, and the others.

    Args:
        console: to print on.
        comparison: to report.
        compared: by it.
        is_named: whether the verdict names the first property that differs.
    """
    outcome = comparison.outcome
    moving = [one for one in compared.properties if one.moves]
    rest = [one for one in compared.properties if not one.moves and one != compared.decisive]
    frames = [one for one in rest if one.kind == "frame"]
    without_effect = [one for one in rest if one.kind != "frame"]
    agrees = outcome is Outcome.AGREES
    title = "bodies and joints that differ, largest effect first"
    if agrees:
        title = "bodies and joints that differ without an effect on these runs"
    is_single = is_named and outcome is Outcome.DIFFERS and len(moving) == 1 and not compared.turned
    if not is_single or compared.impossible or not is_explained(compared):
        _print_all(console, title, moving)
    if not agrees:
        _print_share(console, comparison, compared)
    _print_all(console, "frames that differ", frames)
    _print_all(console, "differences that these motions leave out", without_effect)


def law_lines(rows: Sequence[ComparedProperty], *, is_short: bool = False) -> list[str]:
    """Return a line per number of the laws that differs, if not short with its effect."""
    alike: dict[tuple[str, str], list[ComparedProperty]] = {}
    for row in rows:
        head, _, tail = row.message.partition(f" of {row.about}: ")
        if not tail:  # only one file has it
            head, tail = "", row.message.removeprefix(f"{row.about}: ")
        effect = "" if is_short and row.effect else f"; {law_effect(row)}"
        alike.setdefault((head, tail + effect), []).append(row)
    lines = []
    for (head, tail), equal in alike.items():
        names = listed([row.about for row in equal], MAX_NAMES)
        lines.append(f"{_where(equal[0], is_short)}{head and f'{head} of '}{names}: {tail}")
    return lines


def law_effect(row: ComparedProperty) -> str:
    """Return what a number of the laws does to a step."""
    if row.effect is None:
        return "effect unknown"
    return f"changes a step by {row.effect:.1e}" if row.effect else "no effect at any drawn state"


def minor_line(count: int) -> str:
    """Return the line that counts minor differences."""
    return f"  {counted(count, 'minor difference')} (below 1e-5), see --json"


def is_explained(compared: Compared) -> bool:
    """Return whether differences between the files are the cause."""
    moving = any(one.moves for one in compared.properties)
    return moving and compared.explained is not None and compared.explained >= SHARE


def _print_all(console: Console, title: str, rows: Sequence[ComparedProperty]) -> None:
    if not rows:
        return
    console.print(f"\n{title}")
    lines = _folded_rows(rows)
    for line in lines[:MAX_ROWS]:
        print_text(console, f"  {line}")
    if len(lines) > MAX_ROWS:
        console.print(f"  and {len(lines) - MAX_ROWS} more, see --json")


def _folded_rows(
    rows: Sequence[ComparedProperty],
    others: Sequence[str] = (),
    last: Sequence[ComparedProperty] = (),
    *,
    is_short: bool = False,
) -> list[str]:
    """Return a line per difference, with others between; equal and minor ones share a line."""
    minor = [row for row in [*rows, *last][1:] if 0 < (row.relative or 0.0) < MINOR]
    lines: list[str] = []
    for group, after in ((rows, others), (last, ())):
        alike: dict[tuple[str, ...], list[ComparedProperty]] = {}
        for row in group:
            if row in minor:
                continue
            named = rf"\b(joint|link|shape) {re.escape(row.about)}: " if row.about else "$^"
            alike.setdefault(tuple(re.split(named, row.message, maxsplit=1)), []).append(row)
        for key, same in alike.items():
            text = same[0].message
            if len(same) > 1 and len(key) == 3:
                names = listed([row.about for row in same], MAX_NAMES)
                text = f"{key[0]}{key[1]}s {names}: {key[2]}"
            lines.append(_where(same[0], is_short) + text)
        lines += after
    if minor:
        lines.append(minor_line(len(minor)).strip())
    return lines


def _where(row: ComparedProperty, is_short: bool = False) -> str:
    """Return the line in A, and the one in B if it differs; `A:4, B:7` if short."""
    lines = [
        f"{side}:{where.line}" if is_short and where.line else line_name(where)
        for side, where in (("A", row.where_a), ("B", row.where_b))
        if where is not None
    ]
    shown = ", ".join(dict.fromkeys(lines))
    return f"{shown}  " if shown else ""


def line_name(where: SourceLine) -> str:
    """Return a file's name and line, without folders."""
    return Path(str(where)).name


def _print_share(console: Console, comparison: ComparisonResult, compared: Compared) -> None:
    """Print how far the engines are from the equations of both files, if these do not explain it.

    The statements about each engine and its own file replace the distances.
    """
    if compared.explained is None or compared.off is None or is_explained(compared):
        return  # unknown, or the verdict has the share
    if any(model.case is None for model in comparison.models):
        a, b = (float("inf") if distance is None else distance for distance in compared.off)
        also = " too" if compared.properties or compared.differences else ""
        print_text(
            console,
            f"  the engines differ{also}. Distance from the equations of the file:"
            f" {a:.1e} in A, {b:.1e} in B",
        )
    for inertia in compared.impossible:
        print_text(console, f"  {inertia}")


MAX_TERMS = 8
MAX_BRIEF = 10
"""Maximum number of differences without `--details`."""

NOT_COMPARED = "not compared"

MOST_EXPLAINED = 0.5
"""Share of a discrepancy above which a difference is its cause."""

LEAST_EXPLAINED = 0.01
"""Share of a discrepancy below which the files' differences are not its cause."""

TURNED = 0.1
"""Angle of an axis above which it is the first cause, rad: other differences follow from it."""

MAX_WITHOUT_EFFECT = 6
"""Number of differences without an effect that are listed next to those with one."""

VALUES = re.compile(r"(.+): (.*?)([^ (]+|\([^)]*\)) in A, ([^ (]+|\([^)]*\)) in B(.*)")
"""Pattern of a sentence about a property: subject, property, value in A and in B."""


def print_comparison(
    console: Console, comparison: ComparisonResult, *, details: bool = True
) -> None:
    """Print the verdict with its cause and remedy, and what the files state differently.

    Args:
        console: to print on.
        comparison: to report.
        details: whether to print what motions and edits show, and how both models ran.
    """
    compared = _without_rounding(comparison)
    if compared is None:
        _print_failure(console, comparison)
    elif not details and _is_stated(compared):
        _print_brief(console, comparison, compared)
    else:
        for line in filter(None, _print_outcome(console, comparison, compared)):
            print_text(console, line)
        if compared.rounding is not None:
            compared = replace(compared, properties=(), differences=(), laws=None, acting=())
        edit = _edit_that_explains(compared)
        print_properties(console, comparison, compared, is_named=edit is None)
        if compared.decisive is None:
            _print_terms(console, comparison, compared)
        _print_differences(console, comparison.outcome, _without_laws(compared))
        _print_laws(console, compared)
        _print_acting(console, compared)
        _print_own_files(console, comparison)
        _print_models(console, comparison, compared)


def _without_rounding(comparison: ComparisonResult) -> Compared | None:
    """Return the comparison; of USD files that differ, without numbers that differ by rounding."""
    compared = comparison.compared
    if compared is None or compared.rounding is not None or not _is_usd(comparison):
        return compared
    rows = (row for row in compared.properties if not 0 < (row.relative or 0) <= FLOAT_DIGITS)
    return replace(compared, properties=tuple(rows))


def _is_usd(comparison: ComparisonResult) -> bool:
    return any(Path(model.model).suffix in USD_SUFFIXES for model in comparison.models)


def _is_stated(compared: Compared) -> bool:
    """Return whether what the files state explains the verdict."""
    return (
        compared.decisive is not None or not _is_unexplained(compared) or not compared.discrepancy
    )


def _print_brief(console: Console, comparison: ComparisonResult, compared: Compared) -> None:
    """Print the verdict, what got lost or changed from A to B, and the motions' difference."""
    fix, *motions = _print_outcome(console, comparison, compared)
    if compared.rounding is None:
        _print_stated(console, comparison, compared, fix)
    for line in motions[:1]:
        print_text(console, line.strip())
    ok = [model for model in comparison.models if model.case and model.case.passes]
    if len(ok) == len(comparison.models):
        names = " and ".join(dict.fromkeys(model.engine for model in ok))
        verb = "follow" if " and " in names else "follows"
        print_text(console, f"{names} {verb} the equations of each file; --details prints the runs")
    else:
        _print_own_files(console, comparison)
    for note in _folded(compared.notes, comparison.models):
        if not note.startswith(NOT_COMPARED) and "has no sidecar" not in note:
            print_text(console, note, "dim")
    if line := _not_compared(compared):
        print_text(console, line)


def _print_stated(
    console: Console, comparison: ComparisonResult, compared: Compared, fix: str
) -> None:
    """Print the differences of the files, the remedy, and what the differences act as."""
    moving = [one for one in compared.properties if one.moves]
    others = [one for one in compared.properties if not one.moves]
    laws = law_lines(compared.laws or (), is_short=True)
    lines = _folded_rows(moving, laws, others, is_short=True)
    if len(lines) > 1:
        console.print("lost or changed from A to B, by the files")
        for line in lines[:MAX_BRIEF]:
            print_text(console, f"  {line}")
        if len(lines) > MAX_BRIEF:
            console.print(f"  and {len(lines) - MAX_BRIEF} more; --details lists them")
    if fix:
        print_text(console, fix)
    if len(lines) <= 1 and compared.decisive is None and not (fix and is_explained(compared)):
        if not lines:
            _print_terms(console, comparison, compared)
        _print_differences(console, comparison.outcome, _without_laws(compared))
    _print_acting(console, compared)


def _print_own_files(console: Console, comparison: ComparisonResult) -> None:
    """Print each engine against the equations of its own file, unless the verdict names it."""
    cause = _own_cause(comparison)
    models = [
        model
        for model in comparison.models
        if model.case is not None and own_file_sentence(model) != cause
    ]
    if models:
        console.print("\neach engine against the equations of its own file")
    sentences = dict.fromkeys(
        (model.case.outcome, own_file_sentence(model)) for model in models if model.case
    )
    for outcome, sentence in sentences:
        lead = f"{WORDS[outcome]}  "
        print_wrapped(console, sentence, lead=lead, style=STYLES[outcome], indent=2)


def _print_laws(console: Console, compared: Compared) -> None:
    """Print the numbers of the laws that differ, except the one that the verdict names."""
    rows = [row for row in compared.laws or () if row != compared.decisive]
    lines = law_lines(rows)
    if lines:
        console.print("\nlimits, friction, contacts and drives that differ")
    for line in lines[:MAX_TERMS]:
        print_wrapped(console, line, lead="  ", indent=4)
    if len(lines) > MAX_TERMS:
        print_text(console, f"  and {len(lines) - MAX_TERMS} more, see --json")


def _without_laws(compared: Compared) -> Compared:
    """Return the comparison without edits that no motion shows and that other rows name."""
    rows = (*(compared.laws or ()), *(row for row in compared.properties if not row.moves))
    lines = {str(where) for row in rows for where in (row.where_a, row.where_b)}
    kept = tuple(
        one
        for one in compared.differences
        if one.moved != 0.0
        or not all({str(edit.where_a), str(edit.where_b)} & lines for edit in one.edits)
    )
    return replace(compared, differences=kept)


def _print_acting(console: Console, compared: Compared) -> None:
    """Print the quantities that the files act as differently; those with a cause first."""
    if compared.acting:
        console.print("\nwhat the numbers act as")
    rows = sorted(compared.acting, key=lambda row: not row.cause)
    for row in rows[:MAX_TERMS]:
        values = (_acting_value(value, row.unit) for value in (row.a, row.b))
        text = "{}: {} {} in A, {} in B".format(row.subject, row.quantity, *values)
        cause = f": {row.cause}" if row.cause else ""
        print_wrapped(console, text + cause, lead="  ", indent=4)
    if len(rows) > MAX_TERMS:
        print_text(console, f"  and {len(rows) - MAX_TERMS} more")


def _acting_value(value: float | None, unit: str) -> str:
    return "none" if value is None else f"{value:.4g} {unit}".rstrip()


def _print_failure(console: Console, comparison: ComparisonResult) -> None:
    text = with_code(comparison.code, comparison.reason)
    print_wrapped(console, text, lead=f"{WORDS[Outcome.FAILED]}  ", style=STYLES[Outcome.FAILED])
    for line in comparison.stdout.splitlines()[-6:]:
        print_text(console, f"  | {line}")


def _print_models(console: Console, comparison: ComparisonResult, compared: Compared) -> None:
    """Print the compared files, engines and runs, and the parts that were not compared."""
    console.print()
    for label, model in zip("AB", comparison.models, strict=True):
        components = ", ".join(f"{g:g}" for g in model.gravity or ())
        gravity = f", gravity ({components})" if components else ""
        print_text(console, f"{label}  {model.model} in {model.engine}{gravity}")
    runs = counted(compared.runs.count, "run")
    print_text(
        console,
        f"   {runs} of {compared.runs.length:.3g} s from states of {compared.states_of},"
        f" {compared.runs.driven} of them with known forces",
        "dim",
    )
    if compared.left_out:
        names = ", ".join(compared.left_out)
        print_text(console, f"   without a partner in {compared.states_of}: {names}", "dim")
    for note in (*_folded(compared.notes, comparison.models), *compared.map):
        if not note.startswith(NOT_COMPARED):
            print_text(console, f"   {note}", "dim")
    if line := _not_compared(compared):
        print_text(console, line)


def _folded(notes: Sequence[str], models: Sequence[ComparedModel]) -> list[str]:
    """Return notes; of equal ones about both files, only the first."""
    a, b = (Path(model.model).name for model in models)
    repeated = {note.replace(a, b) for note in notes if a in note}
    shown = []
    for note in notes:
        if note in repeated and a not in note:
            continue
        both = a in note and a != b and note.replace(a, b) in notes
        shown.append(f"{note} (the same for {b})" if both else note)
    return shown


def _not_compared(compared: Compared) -> str:
    """Return a line on what the runs omit, and which differences they cannot show."""
    begin = f"{NOT_COMPARED}: "
    parts = [note.removeprefix(begin) for note in compared.notes if note.startswith(begin)]
    silent = [one for one in compared.untested if not one.startswith(NOT_COMPARED)]
    if silent:
        parts.append(f"{counted(len(silent), 'difference')} that no run shows")
    text = "; ".join(parts).replace("limits of position", "joint limits")
    return f"{begin}{text}" if parts else ""


def _print_outcome(console: Console, comparison: ComparisonResult, compared: Compared) -> list[str]:
    """Print the verdict with the first cause; return the remedy, and lines on the motions."""
    outcome = comparison.outcome
    text, remedy, motions = verdict_sentences(comparison, compared)
    text = text if outcome is Outcome.AGREES else with_code(comparison.code, text)
    print_wrapped(console, text, lead=f"{WORDS[outcome]}  ", style=STYLES[outcome], indent=2)
    return [remedy and f"Fix: {remedy}", *(f"  {line}" for line in motions)]


def verdict_sentences(
    comparison: ComparisonResult, compared: Compared
) -> tuple[str, str, list[str]]:
    """Return the verdict with the first cause, the remedy or "", and lines on the motions."""
    outcome, size = comparison.outcome, _size(compared.discrepancy)
    size = f"{size}, uncertainty {_size(compared.uncertainty)}"
    names = [Path(model.model).name for model in comparison.models]
    if outcome is Outcome.AGREES:
        engines = " and ".join(dict.fromkeys(model.engine for model in comparison.models))
        both = " and ".join(dict.fromkeys(names))
        move = f"{both} moves alike in {engines}" if both == names[0] else f"{both} move alike"
        if compared.rounding is None:
            return f"{move}: difference {size}", "", []
        digits = f"rounding to {int(math.log10(5.0 / compared.rounding))} digits"
        digits = "equal to 7 digits, the format's" if _is_usd(comparison) else digits
        rounded = f"numbers differ by up to {_size(compared.rounding)}, {digits}"
        return f"{both}: {rounded}; motions differ by {size}", "", []
    if compared.decisive is not None:
        share = f" ({law_effect(compared.decisive)})" if compared.decisive.kind == "law" else ""
        cause, remedy = _property_cause(compared.decisive, share, names)
        return cause, remedy, [f"motions without such forces are alike: difference {size}"]
    cause, remedy = _cause(compared, names) if outcome is Outcome.DIFFERS else ("", "")
    text = (engine := _own_cause(comparison)) or cause or comparison.reason
    if outcome is not Outcome.DIFFERS:
        return text, "", [f"difference {size}, on {compared.component}"]
    several = (
        [f"by joint: {_by_joint(compared)}"] if len(compared.joints) > 1 and not engine else []
    )
    motions = [f"motions differ by {size}, on {compared.component}", *several]
    return text, remedy, motions


def _cause(compared: Compared, names: Sequence[str]) -> tuple[str, str]:
    """Return the most important difference in a sentence, with lines and values, and the remedy."""
    if compared.turned:
        turned = ", ".join(compared.turned)
        verb = "turns" if len(compared.turned) == 1 else "turn"
        remedy = (
            f"map it with --joints, or reverse the axis (then {_size(compared.left_when_turned)}"
        )
        return f"{turned} {verb} the other way in B", f"{remedy} remains)"
    moving = [one for one in compared.properties if one.moves]
    if moving and moving[0].kind in ("kind", "axis") and (moving[0].relative or 0.0) > TURNED:
        return _property_cause(moving[0], _explained_share(compared, len(moving)), names)
    if (edit := _edit_that_explains(compared)) is not None:
        return _edit_cause(edit.edits[0], _share(edit.explained or 0.0))
    if moving and not _is_unexplained(compared):
        return _property_cause(moving[0], _explained_share(compared, len(moving)), names)
    return (compared.terms[0].message, "") if _is_cause_a_term(compared) else ("", "")


def _own_cause(comparison: ComparisonResult) -> str:
    """Return why an engine differs from its file, if the files are not the cause; "" if unknown."""
    compared = comparison.compared
    if comparison.outcome is not Outcome.DIFFERS or compared is None:
        return ""
    if not _is_unexplained(compared):
        return ""
    explained = (m for m in comparison.models if m.diagnosis is not None and m.diagnosis.explained)
    return next(map(own_file_sentence, explained), "")


def _is_cause_a_term(compared: Compared) -> bool:
    """Return whether a measured term is the best known cause."""
    return bool(compared.terms) and _is_unexplained(compared)


def _is_unexplained(compared: Compared) -> bool:
    """Return whether the files explain no difference, or next to nothing of it."""
    moving = any(one.moves for one in compared.properties)
    moving = moving and (compared.explained is None or compared.explained >= LEAST_EXPLAINED)
    return not (compared.turned or moving or _edit_that_explains(compared))


def _edit_that_explains(compared: Compared) -> FileDifference | None:
    """Return the first edit that alone explains most of the difference."""
    for difference in compared.differences:
        if (
            len(difference.edits) == 1
            and not difference.not_tried
            and (difference.explained or 0.0) > MOST_EXPLAINED
        ):
            return difference
    return None


def _edit_cause(edit: FileEdit, share: str) -> tuple[str, str]:
    a, b = _line_names(edit.where_a, edit.where_b)
    cause = f"{a} {edit.what}: {edit.a}, {b}: {edit.b} ({share} of the difference)"
    missing = "nothing" in (edit.a, edit.b)
    return cause, "" if missing else f"set {a} to {edit.b}, or {b} to {edit.a}"


def _line_names(where_a: SourceLine, where_b: SourceLine) -> tuple[str, str]:
    """Return both lines, with as many folders as files of the same name need to differ."""
    if where_a.file == where_b.file:
        return line_name(where_a), line_name(where_b)
    parts = [Path(str(where)).parts for where in (where_a, where_b)]
    files = [Path(where.file).parts for where in (where_a, where_b)]
    longest = max(map(len, parts))
    count = next(n for n in range(1, longest + 1) if files[0][-n:] != files[1][-n:])
    a, b = ("/".join(one[-count:]) for one in parts)
    return a, b


def _explained_share(compared: Compared, count: int) -> str:
    """Return the share of a difference that the properties explain, or ""."""
    if compared.explained is None or compared.explained <= 0:
        return ""
    others = f" with {counted(count - 1, 'other')}" if count > 1 else ""
    return f" ({_share(compared.explained)} of the difference{others})"


def values_of(row: ComparedProperty) -> tuple[str, str, str]:
    """Return the name of a property and its values in A and B; "" if the sentence has no values."""
    match = VALUES.fullmatch(row.message)
    if match is None:
        return "", "", ""
    subject, what, here, there, _ = match.groups()
    return f"{what.strip()} of {subject}" if what else subject, here, there


def _property_cause(row: ComparedProperty, share: str, names: Sequence[str]) -> tuple[str, str]:
    a, b = (
        line_name(where) if where else name
        for where, name in zip((row.where_a, row.where_b), names, strict=True)
    )
    if row.where_a is not None and row.where_b is not None:
        a, b = _line_names(row.where_a, row.where_b)
    label, here, there = values_of(row)
    if not label:
        return f"{a}, {b}: {row.message}{share}", ""
    cause = f"{a} {label}: {here}, {b}: {there}{share}"
    if row.remedy or {"none", "some"} & {here, there}:
        return cause, row.remedy
    return cause, f"set {label} to {there} in {a}, or to {here} in {b}"


def _size(value: float | None) -> str:
    return "0" if value == 0 else f"{float('inf') if value is None else value:.1e}"


def _by_joint(compared: Compared) -> str:
    sizes = [float("inf") if size is None else size for size in compared.by_component]
    n = len(compared.joints)
    worst = {name: max(sizes[i], sizes[n + i]) for i, name in enumerate(compared.joints)}
    order = sorted(worst, key=lambda name: -_rounded(worst[name]))
    apart = [name for name in order if worst[name] > 0]
    return ", ".join(f"{name} {worst[name]:.1e}" for name in apart[:MAX_ROWS])


def _rounded(size: float) -> float:
    """Round to six digits, so that the order of equal values does not depend on rounding."""
    return float(f"{size:.5e}")


def _print_terms(console: Console, comparison: ComparisonResult, compared: Compared) -> None:
    outcome = comparison.outcome
    is_named = outcome is Outcome.DIFFERS and _is_cause_a_term(compared)
    is_named = is_named and not _own_cause(comparison)
    shown = compared.terms[1:] if is_named else compared.terms  # the verdict names the first
    if shown:
        title = f"{'other ' if is_named else ''}measured terms that differ, largest effect first"
        console.print(f"\n{title}")
        for term in shown[:MAX_TERMS]:
            print_text(console, f"  {term.message}")
        if len(shown) > MAX_TERMS:
            console.print(f"  and {len(shown) - MAX_TERMS} more, see --json")
    elif compared.terms:
        return
    elif outcome is Outcome.DIFFERS and not (
        compared.turned or is_explained(compared) or _own_cause(comparison)
    ):
        console.print("\nno single measured term differs beyond its uncertainty")


def _print_differences(console: Console, outcome: Outcome, compared: Compared) -> None:
    """Print the tested edits; minor ones, and those without an effect, as counts."""
    named = outcome is Outcome.DIFFERS and not compared.turned
    if named and compared.differences == (_edit_that_explains(compared),):
        return  # the verdict names it
    if not compared.differences:
        return
    agrees = outcome is Outcome.AGREES
    shown = [
        difference
        for difference in compared.differences
        if not agrees or len(difference.edits) == 1
    ]
    still = [
        difference for difference in shown if difference.moved == 0.0 and not difference.not_tried
    ]
    if agrees or len(still) <= MAX_WITHOUT_EFFECT:
        still = []
    minor = [difference for difference in shown if _is_minor(difference)]
    shown = [
        difference for difference in shown if difference not in still and difference not in minor
    ]
    if shown:
        console.print("\nwhere the files differ, A -> B")
    for difference in shown[:MAX_ROWS]:
        print_text(console, "  " + "  ".join(filter(None, _cells(difference, agrees))))
    if len(shown) > MAX_ROWS:
        console.print(f"  and {len(shown) - MAX_ROWS} more, see --json")
    if minor:
        print_text(console, minor_line(len(minor)))
    if still:
        print_text(
            console, f"  {len(still)} more differences have no effect on these runs, see --json"
        )
    if compared.untried:
        print_text(console, f"  not tried alone: {counted(compared.untried, 'more difference')}")


def _is_minor(difference: FileDifference) -> bool:
    """Return whether a difference is rounding or has a small effect, and is not the cause."""
    if (
        len(difference.edits) != 1
        or (difference.explained or 0.0) > MOST_EXPLAINED
        or difference.not_tried
    ):
        return False
    if difference.moved is not None and 0.0 < difference.moved < MINOR:
        return True
    try:
        a, b = float(difference.edits[0].a), float(difference.edits[0].b)
    except ValueError:
        return False
    return abs(a - b) <= SIX_DIGITS * max(abs(a), abs(b))


def _cells(difference: FileDifference, agrees: bool) -> tuple[str, str, str]:
    if len(difference.edits) > 1:
        return "", f"all {len(difference.edits)} together:", _effect(difference, agrees)
    (edit,) = difference.edits
    return _lines(edit), f"{edit.what}: {edit.a} -> {edit.b}", _effect(difference, agrees)


def _lines(edit: FileEdit) -> str:
    """Return the line in A; B's line if the numbers differ or A has no such line."""
    a, b = (Path(str(where)).name for where in (edit.where_a, edit.where_b))
    if edit.a == "nothing" and edit.where_a.line is None:
        return b
    return a if a == b or edit.where_a.line == edit.where_b.line else f"{a}, {b}"


def _effect(difference: FileDifference, agrees: bool) -> str:
    if difference.not_tried:
        return f"not tried: {difference.not_tried}"
    if difference.moved == 0.0:
        return "no effect on these runs"
    if agrees:
        return f"changes motions by {_size(difference.moved)}, which other edits cancel"
    share = _share(difference.explained or 0.0)
    return f"{share} of the difference, changes motions by {_size(difference.moved)}"


def _share(explained: float) -> str:
    if explained <= 0.0005:
        return "0 %"
    return f"{100 * min(explained, 1.0):.3g} %"
