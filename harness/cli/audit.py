"""`crosscheck audit`: literals, compiled terms and engine defaults, without motion."""

from __future__ import annotations

import argparse

from harness.audit.plan import audits
from harness.cli import arguments
from harness.cli.exit_codes import AGREE, DIFFER, FAIL
from harness.files.folders import check_engines, system_folders
from harness.text.findings import audit_lines
from harness.text.visible import visible


def add(command: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    arguments.folders(command, some=True)
    arguments.engine(command)
    arguments.limits(command)
    arguments.jobs(command)


def main(options: argparse.Namespace) -> int:
    """Audit every model of the folders and print what was found."""
    check_engines(options.engine)
    folders = system_folders(options.folders)
    limits = arguments.limits_of(options)
    code = AGREE
    for model in audits(folders, engines=tuple(options.engine), jobs=options.jobs, limits=limits):
        print(model.id)
        if model.failure:
            print(f"  failed   {visible(model.failure)}")
            code = FAIL
            continue
        for text in audit_lines(model.findings):
            print(f"  {visible(text)}")
        if any(finding.severity == "finding" for finding in model.findings):
            code = max(code, DIFFER)
    return code
