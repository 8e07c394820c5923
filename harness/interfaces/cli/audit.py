"""`crosscheck audit`: literals, compiled terms and engine defaults, without motion."""

import argparse
import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from difflib import get_close_matches, unified_diff
from itertools import chain, groupby
from pathlib import Path

from msgspec import structs
from rich.console import Console

from physics_crosscheck.harness.audits import ModelAudit, audits
from physics_crosscheck.harness.documents.reading import USD_SUFFIXES, apply_edits, read_regular
from physics_crosscheck.harness.modelfiles.folders import (
    FORMATS,
    FolderError,
    check_engines,
    is_robot,
)
from physics_crosscheck.harness.planning.options import Options
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.codes import case_code, part_code
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import nothing_tested
from physics_crosscheck.harness.records.write import write_whole
from physics_crosscheck.harness.render.terminal.console import (
    print_hint,
    print_status_lines,
    terminal,
    wrapped,
)
from physics_crosscheck.harness.results.failure import (
    acting_lines,
    advice_lines,
    audit_lines,
    survey_lines,
)
from physics_crosscheck.harness.results.github import concise_line
from physics_crosscheck.harness.results.ignored import CodeFilter
from physics_crosscheck.harness.results.messages import explain_hint, with_code
from physics_crosscheck.harness.results.places import shown_path
from physics_crosscheck.harness.results.visible import visible
from .exit_codes import AGREE, DIFFER, FAIL
from .targets import resolve_targets, run_options, warn_unknown, with_unknown


def main(options: argparse.Namespace) -> int:
    """Audit the named models and print the findings."""
    # A hook of pre-commit passes every file of a commit.
    others = [name for name in options.folders if _is_other_xml(Path(name))]
    if others:
        print(f"crosscheck: skipped, without <mujoco>: {', '.join(others)}", file=sys.stderr)
    names = [name for name in options.folders if name not in others]
    if not names:
        return AGREE
    check_engines(options.engines)
    wanted = resolve_targets(names, standalone=options.standalone, model=options.model)
    warn_unknown(wanted.named)
    chosen = run_options(Options, options, choice=wanted.choice)
    reported = CodeFilter(select=options.select, ignore=options.ignore)
    model_audits = _reported(audits(wanted.paths, chosen), reported)
    if options.fix and fix(model_audits):
        model_audits = _reported(audits(wanted.paths, chosen), reported)
    if not model_audits:
        raise FolderError("no model matches these names and engines; run `crosscheck list` for all")
    if chosen.cache is not None and chosen.cache.problem:
        print(f"crosscheck: {chosen.cache.problem}", file=sys.stderr)
    code = AGREE
    if all(model.absent for model in model_audits):
        print(f"crosscheck: {nothing_tested(m.id.engine for m in model_audits)}", file=sys.stderr)
        code = FAIL
    if options.format == "concise":
        code = max([code, *(_code(model) for model in model_audits)])
        lines = dict.fromkeys(chain(*map(_concise, model_audits)))
        sys.stdout.writelines(f"{line}\n" for line in lines)
    else:
        console, codes = terminal(), list[str]()
        for _, alike in groupby(
            model_audits, lambda one: replace(one, id=structs.replace(one.id, engine=""))
        ):
            code = max(code, _print(console, list(alike), codes, options.details))
        print_hint(console, explain_hint(codes))
    for line in reported.lines():
        print(f"crosscheck: {line}", file=sys.stderr)
    return with_unknown(code, wanted.named)


def _is_other_xml(path: Path) -> bool:
    """Return whether a file is XML of another purpose, such as a launch file.

    A misspelled `<mujco>` and a file without an element are meant as models, and not skipped.
    """
    if path.suffix != ".xml" or not path.is_file() or is_robot(path):
        return False
    text = re.sub(rb"(?s)<!--.*?-->|<[?!][^>]*>", b"", read_regular(path))
    root = re.search(rb"<([\w:.-]+)", text)
    meant = re.findall(r"\w+", FORMATS[".xml"].head.decode())[:1]
    return root is not None and not get_close_matches(
        root[1].decode("latin-1").lower(), meant, cutoff=0.65
    )


def _reported(model_audits: Iterable[ModelAudit], codes: CodeFilter) -> tuple[ModelAudit, ...]:
    """Return audits without ignored findings."""
    return tuple(replace(m, findings=tuple(codes.reported(m.findings))) for m in model_audits)


def _code(model: ModelAudit) -> int:
    """Return the exit code of an audit."""
    if model.absent:
        return AGREE
    is_wrong = any(one.severity == "finding" for one in model.findings)
    return FAIL if model.failure else DIFFER if is_wrong else AGREE


def _concise(model: ModelAudit) -> Iterator[str]:
    """Yield `file:line: CODE message` for a failure, and each finding and advice."""
    target = model.target
    whole = SourceLine(file=str(target / model.id.model if target.is_dir() else target))
    if model.failure and not model.absent:
        yield concise_line(whole, part_code(), model.failure)
    for finding in model.findings:
        if finding.severity != "note":
            yield concise_line(finding.location or whole, finding.code, finding.message)


def fix(model_audits: Iterable[ModelAudit]) -> bool:
    """Write the numbers that findings state into their files, print the change; return if any.

    A file that has changed since it was read stays as it is, and so does USD, below a new layer.
    """
    repairs: dict[str, dict[tuple[int, int], tuple[str, str]]] = {}
    for finding in chain.from_iterable(model.findings for model in model_audits):
        where = finding.location
        if finding.replacement and where is not None and where.span is not None:
            repairs.setdefault(where.file, {})[where.span] = where.text, finding.replacement
    fixed = False
    for target, findings in {one.target: one.findings for one in model_audits}.items():
        if target.suffix not in USD_SUFFIXES:
            continue
        from physics_crosscheck.harness.checks.plausibility.usd import repaired

        if text := repaired(target, findings):
            layer = target.with_suffix(".fixed.usda")
            write_whole(layer, text.encode())
            print(f"wrote {shown_path(str(layer))}, a layer over {target.name}")
    for file, spans in repairs.items():
        before, name = read_regular(Path(file)), shown_path(file)
        if any(before[slice(*span)] != old.encode() for span, (old, _) in spans.items()):
            print(f"crosscheck: {file} has changed since it was read; not fixed", file=sys.stderr)
            continue
        after = apply_edits(before, ((*span, new.encode()) for span, (_, new) in spans.items()))
        write_whole(Path(file), after)
        old_rows, new_rows = (text.decode().splitlines() for text in (before, after))
        for row in unified_diff(old_rows, new_rows, name, name, n=0, lineterm=""):
            print(visible(row))
        fixed = True
    return fixed


def _print(console: Console, models: Sequence[ModelAudit], codes: list[str], details: bool) -> int:
    """Print an audit shared by several engines, and note its message codes."""
    model = models[0]
    name = structs.replace(model.id, engine=", ".join(one.id.engine for one in models))
    print_status_lines(console, wrapped(str(name), console.width))
    code = _code(model)
    if model.absent:
        lines = [f"skipped  {with_code(case_code(Outcome.ABSENT, ''), model.failure)}"]
    elif model.failure:
        lines = [f"ERROR    {with_code(part_code(), model.failure)}"]
        codes.append(part_code())
    else:
        lines = (
            survey_lines(model.findings, model.left_out, mechanics=model.mechanics)
            if model.bodies
            else audit_lines(model.findings)
        )
        advice = [one for one in model.findings if one.severity == "advice"]
        shown = advice_lines(advice, details=details)
        lines = [*lines, *(f"{'advice':<8} {line}" for line in shown), *acting_lines(model.acting)]
        wrong = [one for one in model.findings if one.severity == "finding"]
        codes += [one.code for one in (*wrong, *advice)]
    for line in lines:
        print_status_lines(console, wrapped(f"  {line}", console.width))
    return code
