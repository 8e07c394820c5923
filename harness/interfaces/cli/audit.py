"""`crosscheck audit`: literals, compiled terms and engine defaults, without motion."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby

from msgspec import structs
from rich.console import Console

from physics_crosscheck.harness.audits import ModelAudit, audits
from physics_crosscheck.harness.modelfiles.folders import FolderError, check_engines
from physics_crosscheck.harness.planning.options import Options
from physics_crosscheck.harness.records.codes import case_code, part_code
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import nothing_tested
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
from physics_crosscheck.harness.results.messages import explain_hint, with_code
from .exit_codes import AGREE, DIFFER, FAIL
from .targets import resolve_targets, run_options, warn_unknown, with_unknown


def main(options: argparse.Namespace) -> int:
    """Audit the named models and print the findings."""
    check_engines(options.engines)
    wanted = resolve_targets(options.folders, standalone=options.standalone, model=options.model)
    warn_unknown(wanted.named)
    chosen = run_options(Options, options, choice=wanted.choice)
    model_audits = audits(wanted.paths, chosen)
    if not model_audits:
        raise FolderError("no model matches these names and engines; run `crosscheck list` for all")
    if chosen.cache is not None and chosen.cache.problem:
        print(f"crosscheck: {chosen.cache.problem}", file=sys.stderr)
    code = AGREE
    if all(model.absent for model in model_audits):
        print(f"crosscheck: {nothing_tested(m.id.engine for m in model_audits)}", file=sys.stderr)
        code = FAIL
    console, codes = terminal(), list[str]()
    for _, alike in groupby(model_audits, _without_engine):
        code = max(code, _print(console, list(alike), codes, options.details))
    print_hint(console, explain_hint(codes))
    return with_unknown(code, wanted.named)


def _without_engine(model: ModelAudit) -> ModelAudit:
    return replace(model, id=structs.replace(model.id, engine=""))


def _print(console: Console, models: Sequence[ModelAudit], codes: list[str], details: bool) -> int:
    """Print an audit shared by several engines, and note its message codes.

    Args:
        details: whether to list all advice.

    Returns:
        The exit code.
    """
    model = models[0]
    name = structs.replace(model.id, engine=", ".join(one.id.engine for one in models))
    print_status_lines(console, wrapped(str(name), console.width))
    code = AGREE
    if model.absent:
        lines = [f"skipped  {with_code(case_code(Outcome.ABSENT, ''), model.failure)}"]
    elif model.failure:
        lines, code = [f"ERROR    {with_code(part_code(), model.failure)}"], FAIL
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
        found_codes = [one.code for one in model.findings if one.severity == "finding"]
        codes += found_codes
        code = DIFFER if found_codes else AGREE
        codes += [one.code for one in advice]
    for line in lines:
        print_status_lines(console, wrapped(f"  {line}", console.width))
    return code
