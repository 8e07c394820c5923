"""`crosscheck audit`: literals, compiled terms and engine defaults, without motion."""

from __future__ import annotations

import argparse
import sys

from harness.audits import audits
from harness.cached import Cache
from harness.cli import arguments
from harness.cli.exit_codes import AGREE, DIFFER, FAIL
from harness.cli.missing import tell_missing, with_missing
from harness.files.folders import check_engines, named_folders
from harness.records.results import nothing_tested
from harness.text.findings import audit_lines
from harness.text.visible import visible


def main(options: argparse.Namespace) -> int:
    """Audit every model of the folders and print what was found."""
    check_engines(options.engine)
    named = named_folders(options.folders)
    tell_missing(named)
    cache = None if options.cache is None else Cache(options.cache)
    found = audits(
        named.folders,
        engines=options.engine,
        jobs=options.jobs,
        limits=arguments.limits_of(options),
        cache=cache,
    )
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
    return with_missing(code, named)
