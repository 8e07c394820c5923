"""`crosscheck audit`: literals, compiled terms and engine defaults, without motion."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from physics_crosscheck.harness.audits import ModelAudit, audits
from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.exit_codes import AGREE, DIFFER, FAIL
from physics_crosscheck.harness.interfaces.cli.targets import (
    Targets,
    resolve_targets,
    warn_unknown,
    with_unknown,
)
from physics_crosscheck.harness.modelfiles.folders import FolderError, NamedFolders, check_engines
from physics_crosscheck.harness.planning.cache import Cache
from physics_crosscheck.harness.records.codes import case_code, part_code
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import nothing_tested
from physics_crosscheck.harness.render.terminal.console import (
    print_hint,
    print_status_lines,
    terminal,
    wrapped,
)
from physics_crosscheck.harness.results.findings import audit_lines
from physics_crosscheck.harness.results.messages import explain_hint, with_code
from physics_crosscheck.harness.results.visible import visible


def main(options: argparse.Namespace) -> int:
    """Audit the named models and print the findings."""
    check_engines(options.engine)
    wanted = _select_targets(options.folders)
    warn_unknown(wanted.named)
    cache = None if options.cache is None else Cache(options.cache)
    found = audits(
        wanted.folders,
        engines=options.engine,
        jobs=options.jobs,
        limits=arguments.limits_of(options),
        cache=cache,
        choice=wanted.choice,
    )
    if not found:
        raise FolderError("no model matches these names and engines; run `crosscheck list` for all")
    if cache is not None and cache.trouble:
        print(f"crosscheck: {cache.trouble}", file=sys.stderr)
    code = AGREE
    if all(model.absent for model in found):
        print(f"crosscheck: {nothing_tested(m.id.engine for m in found)}", file=sys.stderr)
        code = FAIL
    for model in found:
        if model.failure:
            code = code if model.absent else FAIL
        elif any(finding.severity == "finding" for finding in model.findings):
            code = max(code, DIFFER)
    _print(found)
    return with_unknown(code, wanted.named)


def _print(models: Sequence[ModelAudit]) -> None:
    """Print the findings of each model, or why it has none."""
    console, codes = terminal(), []
    for model in models:
        if model.absent:
            lines = [f"skipped  {with_code(case_code(Outcome.ABSENT, ''), model.failure)}"]
        elif model.failure:
            lines = [f"ERROR    {with_code(part_code(), model.failure)}"]
            codes.append(part_code())
        else:
            lines = audit_lines(model.findings)
            codes += [one.code for one in model.findings if one.severity == "finding"]
        print_status_lines(console, wrapped(str(model.id), console.width))
        for line in lines:
            print_status_lines(console, wrapped(f"  {line}", console.width))
    print_hint(console, explain_hint(codes))


def _select_targets(names: Sequence[str]) -> Targets:
    """Return folders and models in them; files without a sidecar count as unknown targets.

    Raises:
        FolderError: if nothing else is named.
    """
    found = resolve_targets(names, standalone=False)
    faults = {**found.named.faults, **{str(file): _no_sidecar(file) for file in found.robots}}
    if not found.folders:
        raise FolderError("; ".join(faults.values()))
    return replace(found, named=NamedFolders(found.named.folders, faults))


def _no_sidecar(file: Path) -> str:
    name, shown = visible(str(file)), visible(shlex.quote(str(file)))
    return (
        f"{name}: it has no sidecar, so an audit has no reference for its numbers;"
        f" `crosscheck run {shown}` checks it against the equations of its own bodies"
    )
