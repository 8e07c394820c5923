"""A repository from the first run to the gate: run, pytest, accept, gate, break, gate."""

import html
import re
import shlex
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pytest
import yaml

from tests.commands import crosscheck
from tests.installed.conftest import CHECKOUT, Installed
from tests.installed.documents import commands
from tests.standing import shorten_scenarios

SHELL = "bash --noprofile --norc -eo pipefail"

FAKE = """#!/bin/bash
printf '%s %s\\n' "$(basename "$0")" "$*" >> "$CALLED"
"""


@dataclass(frozen=True)
class Job:
    """The result of a job."""

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


REPOSITORY = Path(__file__).parent / "repository"
ROOT = Path(__file__).parents[2]
WORKFLOW = ROOT / "docs" / "ci" / "github-workflow.yml"
ACTION = yaml.safe_load((ROOT / "action.yml").read_text())
HOOKS = ROOT / ".pre-commit-hooks.yaml"


@pytest.mark.release
def test_fresh_repository_is_run_tested_accepted_and_gated(tmp_path: Path) -> None:
    place = tmp_path / "robots"
    system = place / "models" / "cart_pole"
    shutil.copytree(REPOSITORY / "models" / system.name, system)
    shorten_scenarios(system)
    for file in system.glob("robot.urdf*"):
        file.unlink()

    def run(command: str, code: int = 0, **environment: str) -> str:
        if command.startswith("crosscheck"):
            words = shlex.split(command)[1:]
            given: dict[str, str | None] = {"CI": None, "COLUMNS": None, **environment}
            done = crosscheck(*words, cwd=place, known_engine=False, **given)
        else:
            done = CHECKOUT.shell(command, place, **environment)
        assert done.returncode == code, f"{command}\n{done.stdout}{done.stderr}"
        return done.stdout

    run("git init --quiet")
    assert "Both cases agree" in run("crosscheck run models")
    _, excepted = commands((ROOT / "docs" / "tutorial.md").read_text())
    (tested,) = (command.text for command in excepted if command.text.startswith("pytest"))
    assert "3 passed" in run(tested)
    output = run("crosscheck accept --folder models --reason measured")
    assert "Accepted 2 cases of " in output
    assert "0 run" in run("crosscheck gate")

    model = system / "mujoco.xml"
    text = model.read_text()
    model.write_text(text.replace('mass="0.25"', 'mass="0.2501"'))
    line = text[: text.index('mass="0.25"')].count("\n") + 1
    printed = _check_failing_workflow(place, tmp_path / "tools")
    noted = re.findall(r"^::error file=(.*?),line=(\d+),", printed, re.MULTILINE)
    assert set(noted) == {("models/cart_pole/mujoco.xml", str(line))}
    assert "mass of body pole 0.25 -> 0.2501 changed 2" in printed
    # Only a person can accept, not CI.
    run("crosscheck accept --reason no", 2, CI="1")

    # The pre-commit hook rejects the commit too.
    commit = "git -c user.name=a -c user.email=b commit --quiet --all --message "
    hook = next(h for h in yaml.safe_load(HOOKS.read_text()) if h["language"] == "system")
    installs = f"printf '#!/bin/sh\nexec {hook['entry']}\n' > .git/hooks/pre-commit"
    run(f"git add . && {installs} && chmod +x .git/hooks/pre-commit")
    run(f"{commit} wrong", 1)
    run("crosscheck accept --reason 'weighed again'")
    run(f"git add . && {commit} right")
    job = run_job(steps_of(WORKFLOW, "gate"), CHECKOUT, place, tmp_path / "tools")
    assert job.passes
    assert "ok  " in job.stdout
    assert "Report of everything, where the gate failed" not in job.ran


def _check_failing_workflow(place: Path, tools: Path) -> str:
    """Check that the workflow annotates, comments and creates a report; return its output."""
    job = run_job(steps_of(WORKFLOW, "gate"), CHECKOUT, place, tools)
    assert not job.passes
    assert "## crosscheck gate: FAIL" in job.summary
    install, comment = job.called
    assert install.startswith("pip install --constraint constraints.txt physics-crosscheck[")
    body = "reports/gate/summary.md"
    assert comment == f"gh pr comment 7 --body-file {body} --edit-last --create-if-none"
    assert (place / body).read_text() == job.summary
    assert "cause in cart_pole/mujoco.xml" in job.summary
    assert "mass 0.25 -> 0.2501, bound to m\n" in html.unescape(job.summary)
    assert (place / "reports" / "index.html").is_file()
    return job.stdout


def run_action(place: Path, tools: Path, **given: str) -> Job:
    inputs = {name: value["default"] for name, value in ACTION["inputs"].items()} | given
    return run_job(ACTION["runs"]["steps"], CHECKOUT, place, tools, inputs)


@pytest.mark.release
def test_action_runs_the_given_command(tmp_path: Path) -> None:
    place = tmp_path / "robots"
    place.mkdir()
    shutil.copy(ROOT / "docs" / "cases" / "door.urdf", place)
    job = run_action(place, tmp_path / "tools", command="run door.urdf --engine mujoco")
    assert job.called == ("pip install physics-crosscheck[engines]",)
    assert job.ran == ("Install", "Check")
    assert "door.urdf" in job.stdout
    assert (place / "reports" / "index.html").is_file()


def test_action_inputs_are_not_part_of_its_script(tmp_path: Path) -> None:
    hostile = "engines; touch owned $(touch owned) `touch owned`"
    job = run_action(
        tmp_path, tmp_path / "tools", command=hostile, install="a; touch owned",
        constraints="my constraints.txt",
    )  # fmt: skip
    assert not job.passes
    assert not (tmp_path / "owned").exists()
    assert job.called == ("pip install --constraint my constraints.txt a; touch owned",)


def test_workflows_call_existing_make_targets() -> None:
    targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    called: set[str] = set()
    for file in (ROOT / ".github").rglob("*.yml"):
        text = file.read_text()
        yaml.safe_load(text)
        called |= set(re.findall(r"run: make ([\w-]+)", text))
        called |= set(
            yaml.safe_load(text)
            .get("jobs", {})
            .get("suite", {})
            .get("strategy", {})
            .get("matrix", {})
            .get("target", ())
        )
    parts = {"test", "test-slow", "test-release", "test-engines"}
    assert called == parts | {"test-python", "dist"} <= targets
    script = (ROOT / ".ci" / "run").read_text()
    assert parts == set(re.findall(r"^make ([\w-]+)$", script, re.MULTILINE))
