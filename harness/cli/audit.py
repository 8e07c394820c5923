"""`crosscheck audit`: literals, compiled terms and engine defaults, without motion."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from physics_crosscheck.harness.audits import audits
from physics_crosscheck.harness.cached import Cache
from physics_crosscheck.harness.cli import arguments
from physics_crosscheck.harness.cli.asked import Asked, meant_by
from physics_crosscheck.harness.cli.exit_codes import AGREE, DIFFER, FAIL
from physics_crosscheck.harness.cli.missing import tell_missing, with_missing
from physics_crosscheck.harness.files.folders import FolderError, NamedFolders, check_engines
from physics_crosscheck.harness.records.results import nothing_tested
from physics_crosscheck.harness.text.findings import audit_lines
from physics_crosscheck.harness.text.visible import visible


def main(options: argparse.Namespace) -> int:
    """Audit the models that are named and print what was found."""
    check_engines(options.engine)
    wanted = _asked_for(options.folders)
    tell_missing(wanted.named)
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
        raise FolderError("no model has such a name in such an engine; `crosscheck list` has all")
    if cache is not None and cache.trouble:
        print(f"crosscheck: {cache.trouble}", file=sys.stderr)
    code = AGREE
    if all(model.absent for model in found):
        print(f"crosscheck: {nothing_tested(m.id.engine for m in found)}", file=sys.stderr)
        code = FAIL
    for model in found:
        print(model.id)
        if model.failure:
            print(f"  {'absent' if model.absent else 'failed'}   {visible(model.failure)}")
            code = code if model.absent else FAIL
            continue
        for text in audit_lines(model.findings):
            print(f"  {visible(text)}")
        if any(finding.severity == "finding" for finding in model.findings):
            code = max(code, DIFFER)
    return with_missing(code, wanted.named)


def _asked_for(names: Sequence[str]) -> Asked:
    """Folders and models in them; files that no equations stand beside are names that mean nothing.

    Raises:
        FolderError: where nothing else is named.
    """
    found = meant_by(names, alone=False)
    faults = {**found.named.faults, **{str(file): _alone(file) for file in found.robots}}
    if not found.folders:
        raise FolderError("; ".join(faults.values()))
    return replace(found, named=NamedFolders(found.named.folders, faults))


def _alone(file: Path) -> str:
    name, shown = visible(str(file)), visible(shlex.quote(str(file)))
    return (
        f"{name}: no sidecar says what its numbers should be; `crosscheck run {shown}` runs it"
        " against the equations of its own bodies"
    )
