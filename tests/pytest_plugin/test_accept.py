"""Accepting from pytest, and the fixture for tests of a project's own."""

from __future__ import annotations

import pytest

from physics_crosscheck.harness.baseline.store import read_baseline
from physics_crosscheck.harness.records.outcome import Outcome
from tests.pytest_plugin.conftest import Project
from tests.standing import without

pytest_plugins = ("pytester",)


@pytest.mark.slow
def test_what_the_selected_cases_do_is_accepted_with_the_reason(project: Project) -> None:
    path = project.add() / "mujoco.xml"
    project.edit(path, 'stiffness="47.0"', 'stiffness="47.5"')
    done = project.run(
        "--crosscheck", "models", "-k", "free", "--crosscheck-accept", "a  stiffer spring"
    )
    done.assert_outcomes(passed=1, deselected=3)
    done.stdout.fnmatch_lines(
        ["Accepted 1 case of *", "  mass_spring_damper/mujoco.xml/free [[]mujoco]"]
    )
    kept = read_baseline(project.path / "reports" / "baseline")["mass_spring_damper"]
    ((one, entry),) = kept.cases.items()
    assert (one.scenario, entry.outcome) == ("free", Outcome.DIFFERS)
    assert entry.reason == "a stiffer spring"
    again = project.run("--crosscheck", "models", "-k", "free or step")
    again.assert_outcomes(passed=1, failed=1, deselected=2)


def test_what_could_not_be_run_is_not_accepted(project: Project) -> None:
    path = project.add() / "mujoco.xml"
    path.write_text("<mujoco")
    done = project.run("--crosscheck", "models", "-k", "free", "--crosscheck-accept", "broken")
    done.assert_outcomes(failed=1, deselected=3)
    assert not list((project.path / "reports").glob("baseline/*.json"))


@pytest.mark.parametrize(
    ("ci", "reason", "said"), [("true", "right", "is refused in CI"), ("", "  ", "is empty")]
)
def test_accepting_is_a_persons_decision_with_a_reason(
    project: Project, monkeypatch: pytest.MonkeyPatch, ci: str, reason: str, said: str
) -> None:
    monkeypatch.setenv("CI", ci)
    project.add()
    done = project.run("--crosscheck", "models", "--crosscheck-accept", reason)
    assert done.ret == pytest.ExitCode.USAGE_ERROR
    done.stderr.fnmatch_lines([f"*--crosscheck-accept*{said}*"])


def test_the_fixture_runs_models_on_the_terms_of_the_command_line_once(project: Project) -> None:
    path = project.add() / "mujoco.xml"
    without(path.parent, "step", "resonance")
    project.edit(path, 'stiffness="47.0"', 'stiffness="47.000047"')
    (project.path / "test_mine.py").write_text(
        """
def test_agrees(crosscheck):
    found = crosscheck("models/msd")
    assert found, str(found)

def test_terms(crosscheck):
    found = crosscheck("models/msd")
    assert found is crosscheck("models/msd")
    assert found.resolution == 1e-5
    assert not crosscheck("models/msd", resolution=1e-8)

def test_unknown(crosscheck):
    crosscheck("nowhere")
"""
    )
    done = project.run("test_mine.py", "--crosscheck-resolution", "1e-5")
    done.assert_outcomes(passed=1, failed=2)
    done.stdout.fnmatch_lines(["*mujoco.xml:*: joint[[]x]@stiffness is 47.000047*"])
    done.stdout.fnmatch_lines(["*FolderError: *nowhere*"])
