"""Acceptance from pytest, and the fixture for a project's own tests."""

from __future__ import annotations

import pytest

from physics_crosscheck.harness.baseline.store import read_baseline
from physics_crosscheck.records import Outcome
from tests.pytest_plugin.conftest import Project
from tests.standing import without

pytest_plugins = ("pytester",)


@pytest.mark.slow
def test_selected_cases_are_accepted_with_the_reason(project: Project) -> None:
    path = project.add() / "mujoco.xml"
    project.edit(path, 'stiffness="47.0"', 'stiffness="47.5"')
    done = project.run(
        "--crosscheck", "models", "-k", "free", "--crosscheck-accept", "a  stiffer spring"
    )
    done.assert_outcomes(passed=1, deselected=3)
    done.stdout.fnmatch_lines(
        ["Accepted 1 case of *", "  mass_spring_damper/mujoco.xml/free [[]mujoco]"]
    )
    accepted = read_baseline(project.path / "reports" / "baseline")["mass_spring_damper"]
    ((case_id, entry),) = accepted.cases.items()
    assert (case_id.scenario, entry.outcome) == ("free", Outcome.DIFFERS)
    assert entry.reason == "a stiffer spring"
    again = project.run("--crosscheck", "models", "-k", "free or step")
    again.assert_outcomes(passed=1, failed=1, deselected=2)


def test_failed_cases_are_not_accepted(project: Project) -> None:
    path = project.add() / "mujoco.xml"
    path.write_text("<mujoco")
    done = project.run("--crosscheck", "models", "-k", "free", "--crosscheck-accept", "broken")
    done.assert_outcomes(failed=1, deselected=3)
    assert not list((project.path / "reports").glob("baseline/*.json"))


@pytest.mark.parametrize(
    ("ci", "reason", "message"), [("true", "right", "is refused in CI"), ("", "  ", "is empty")]
)
def test_accepting_needs_a_reason_and_is_rejected_in_ci(
    project: Project, monkeypatch: pytest.MonkeyPatch, ci: str, reason: str, message: str
) -> None:
    monkeypatch.setenv("CI", ci)
    project.add()
    done = project.run("--crosscheck", "models", "--crosscheck-accept", reason)
    assert done.ret == pytest.ExitCode.USAGE_ERROR
    done.stderr.fnmatch_lines([f"*--crosscheck-accept*{message}*"])


def test_fixture_uses_command_line_options_and_caches_results(project: Project) -> None:
    path = project.add() / "mujoco.xml"
    without(path.parent, "step", "resonance")
    project.edit(path, 'stiffness="47.0"', 'stiffness="47.000047"')
    (project.path / "test_mine.py").write_text(
        """
def test_agrees(crosscheck):
    result = crosscheck("models/msd")
    assert result, str(result)

def test_options(crosscheck):
    result = crosscheck("models/msd")
    assert result is crosscheck("models/msd")
    assert result.resolution == 1e-5
    assert not crosscheck("models/msd", resolution=1e-8)

def test_unknown(crosscheck):
    crosscheck("nowhere")
"""
    )
    done = project.run("test_mine.py", "--crosscheck-resolution", "1e-5")
    done.assert_outcomes(passed=1, failed=2)
    done.stdout.fnmatch_lines(["*mujoco.xml:*: joint[[]x]@stiffness is 47.000047*"])
    done.stdout.fnmatch_lines(["*FolderError: *nowhere*"])
