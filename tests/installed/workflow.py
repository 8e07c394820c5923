"""The shell steps of a GitHub workflow, run as GitHub runs them."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import yaml

from tests.installed.conftest import Installed

SHELL = "bash --noprofile --norc -eo pipefail"

FAKE = """#!/bin/bash
printf '%s %s\\n' "$(basename "$0")" "$*" >> "$CALLED"
"""


@dataclass(frozen=True)
class Job:
    """The result of a job.

    Attributes:
        passes: whether no required step failed.
        ran: names of the steps that were run, or their commands.
        called: calls of faked programs, a line each.
        summary: the job's summary.
        stdout: output of all steps.
    """

    passes: bool
    ran: tuple[str, ...]
    called: tuple[str, ...]
    summary: str
    stdout: str


def run_job(
    steps: list[dict[str, Any]],
    installed: Installed,
    place: Path,
    tools: Path,
    inputs: Mapping[str, str] = MappingProxyType({}),
) -> Job:
    """Run a job's steps in a checkout, for a pull request; `pip` and `gh` are only recorded."""
    tools.mkdir(exist_ok=True)
    for name in ("pip", "gh"):
        (tools / name).write_text(FAKE)
        (tools / name).chmod(0o755)
    called, summary = tools / "called", tools / "summary"
    for file in (called, summary):
        file.write_text("")
    passes, ran, stdout = True, [], ""
    for i, step in enumerate(steps):
        if "run" not in step or not _is_run(step.get("if", "success()"), passes):
            continue
        script = tools / f"step{i}.sh"
        script.write_text(step["run"])
        env = {key: _substitute(value, inputs) for key, value in step.get("env", {}).items()}
        done = installed.shell(
            f"PATH='{tools}':$PATH {SHELL} '{script}'",
            place,
            CI="true",
            GITHUB_ACTIONS="true",
            GITHUB_STEP_SUMMARY=str(summary),
            CALLED=str(called),
            **env,
        )
        ran.append(step.get("name", step["run"]))
        stdout += done.stdout
        passes = passes and (done.returncode == 0 or step.get("continue-on-error", False))
    return Job(
        passes, tuple(ran), tuple(called.read_text().splitlines()), summary.read_text(), stdout
    )


def steps_of(file: Path, job: str) -> list[dict[str, Any]]:
    steps: list[dict[str, Any]] = yaml.safe_load(file.read_text())["jobs"][job]["steps"]
    return steps


def _is_run(condition: str, passes: bool) -> bool:
    conditions = {
        "success()": passes,
        "failure()": not passes,
        "always()": True,
        "github.event_name == 'pull_request'": True,
    }
    return all(conditions[part.strip()] for part in condition.split("&&"))


def _substitute(value: str, inputs: Mapping[str, str]) -> str:
    values = {f"inputs.{name}": text for name, text in inputs.items()}
    values |= {"github.token": "token", "github.event.pull_request.number": "7"}
    return re.sub(r"\$\{\{\s*(.*?)\s*\}\}", lambda match: values[match[1]], value)
