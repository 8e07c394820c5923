"""`check`, the function for users' own tests, and `--crosscheck-accept`."""

import json
import math
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from physics_crosscheck import check
from physics_crosscheck.harness.baseline.store import read_baseline
from physics_crosscheck.harness.engines.pinocchio import PinocchioEngine
from physics_crosscheck.harness.engines.pymunk import PymunkEngine
from physics_crosscheck.harness.modelfiles.folders import FolderError, builtin
from physics_crosscheck.harness.records.schema import schema
from physics_crosscheck.harness.records.write import encoded
from physics_crosscheck.harness.results.failure import audit_lines, diagnosis_lines
from physics_crosscheck.records import Outcome, Results
from tests.faults.known_folder import environment, known_folder
from tests.models import edited
from tests.pytest_plugin.conftest import Project
from tests.robots.files import ARM, LAMP, UNLIMITED
from tests.standing import keep_default_engines, shorten_scenarios, without

ROOT = Path(__file__).parents[2]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Create a folder with one model of wrong stiffness and a correct one."""
    folder = tmp_path / "mine"
    shutil.copytree(builtin() / "mass_spring_damper", folder)
    keep_default_engines(folder)
    without(folder, "step")
    shorten_scenarios(folder, 8)
    edited(folder / "mujoco.xml", 'stiffness="47.0"', 'stiffness="47.000047"')
    return folder


def test_agreeing_results_have_numbers_and_match_the_schema(folder: Path) -> None:
    result = check(folder, engines=["pymunk"])
    assert result
    assert result.agree
    assert {case.engine for case in result.cases} == {"pymunk"}
    case = result.case(result.cases[0].scenario)
    assert case.outcome is Outcome.AGREES
    assert case.verdict is not None
    assert case.full_run is not None
    numbers = case.verdict.discrepancy, case.verdict.uncertainty, case.full_run.global_error
    e, u, error = (-1.0 if value is None else value for value in numbers)
    assert 0 < e < u < 1e-9
    assert 0 < error < 1
    assert "Both cases agree to" in str(result)
    jsonschema.validate(json.loads(encoded(result)), schema(Results))


def test_wrong_model_does_not_agree_and_the_text_gives_the_cause(folder: Path) -> None:
    result = check(folder, engines=["mujoco"])
    assert not result
    assert not result.agree
    case = result.case("free", model="mujoco.xml")
    assert case.outcome is Outcome.DIFFERS
    assert not case.passes
    assert result.case("free", model="robot.urdf").passes
    wrong = next(model for model in result.models if model.model == "mujoco.xml")
    assert not wrong.passes
    assert wrong.diagnosis is not None
    assert "joint[x]@stiffness (mujoco.xml:" in diagnosis_lines(wrong.diagnosis)[0]
    assert "joint[x]@stiffness is 47.000047" in audit_lines(wrong.findings)[0]
    text = str(result)
    assert text == repr(result)
    assert "mass_spring_damper/mujoco.xml/free [mujoco]\nXC301 DIFFERS: x_dot is off by" in text
    assert "the motion implies 47 ±" in text
    assert "Traceback" not in text
    for wanted in ({"scenario": "free"}, {"scenario": "nothing"}):
        with pytest.raises(LookupError, match=r"mass_spring_damper/robot.urdf/free \[mujoco\]"):
            result.case(**wanted)


def test_robot_files_are_checked_like_folders(folder: Path, tmp_path: Path) -> None:
    arm, lamp = tmp_path / "arm.urdf", tmp_path / "lamp.xml"
    arm.write_text(ARM)
    lamp.write_text(LAMP)
    result = check([arm, str(lamp)], folder / "space.py", engines=["mujoco", "pymunk"])
    assert result, str(result)
    assert {(c.model, c.scenario, c.engine) for c in result.cases if c.engine == "mujoco"} == {
        ("arm.urdf", "states", "mujoco"), ("lamp.xml", "states", "mujoco"),
    }  # fmt: skip
    assert {c.model for c in result.cases if c.engine == "pymunk"} == {"space.py"}
    (case,) = check(arm, engines=["mujoco"], floating=True).cases
    assert case.scenario == "floating states"
    assert result.case(model="lamp.xml", engine="mujoco").whole_step is not None
    (case,) = check(lamp, engines=["mujoco"], smooth=True).cases
    assert case.whole_step is None


@pytest.mark.skipif(PinocchioEngine().version() is None, reason="pinocchio is not installed")
def test_refusal_counts_only_without_another_verdict(tmp_path: Path) -> None:
    arm = tmp_path / "arm.urdf"
    arm.write_text(UNLIMITED)
    assert check(arm, engines=["mujoco", "pinocchio"]).agree
    assert not check(arm, engines=["pinocchio"]).agree


def test_missing_engine_never_agrees(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(PymunkEngine, "version", lambda _: None)
    result = check("torsional_disc", engines=["pymunk"])
    assert {case.outcome for case in result.cases} == {Outcome.ABSENT}
    assert not result.agree
    assert "pymunk is not installed" in str(result)


def test_unknown_names_are_rejected() -> None:
    with pytest.raises(FolderError, match="nowhere: no such folder"):
        check("nowhere")
    with pytest.raises(FolderError, match="unknown engine 'havok'"):
        check("torsional_disc", engines=["havok"])
    with pytest.raises(FolderError, match="a name is empty"):
        check("")
    with pytest.raises(FolderError, match=r"no\.urdf: there is no such file"):
        check("torsional_disc", "no.urdf")


@pytest.mark.parametrize(("given", "kind", "message"), [
    ({"engines": "pymunk"}, TypeError, r"must be a list, not 'pymunk'; write engines=\['pymunk'\]"),
    ({"engines": [5]}, TypeError, r"engines must be a list of names, not \[5\]"),
    ({"resolution": 0}, ValueError, "resolution must be a number from 1e-13 to 0.01, not 0"),
    ({"resolution": "fine"}, TypeError, "resolution must be a number, not 'fine'"),
    ({"limit": math.nan}, ValueError, "limit must be a number of seconds from"),
    ({"limit": "long"}, TypeError, "limit must be a number of seconds, not 'long'"),
    ({"memory": 0}, ValueError, "memory must be a number of GiB from 0.5"),
    ({"jobs": -1}, ValueError, "jobs must be a whole number from 0 to 4096, not -1"),
    ({"jobs": 1.5}, TypeError, "jobs must be a whole number, not 1.5"),
    ({"baseline": 5}, TypeError, "baseline must be a path, not 5"),
    ({"scheduler": 5}, TypeError, "scheduler must be a string, not 5"),
])  # fmt: skip
def test_invalid_arguments_are_rejected_with_a_hint(
    given: dict[str, Any], kind: type[Exception], message: str
) -> None:
    with pytest.raises(kind, match=message):
        check("torsional_disc", **given)


def test_invalid_path_is_rejected() -> None:
    for path in (None, 5, ["torsional_disc", 5]):
        with pytest.raises(TypeError, match="a path of check"):
            check(path)  # type: ignore[arg-type]


@pytest.mark.slow
def test_script_without_a_main_guard_can_call_check(tmp_path: Path) -> None:
    without(known_folder(tmp_path / "osc", {"good": ""}), "driven")
    script = "from physics_crosscheck import check\nprint(check('osc', jobs=1).agree)\n"
    done = subprocess.run(
        [sys.executable, "-"], input=script, cwd=tmp_path, capture_output=True, text=True,
        check=False, env=environment(),
    )  # fmt: skip
    assert done.stdout == "True\n", done.stderr


def test_package_is_imported_lazily() -> None:
    code = (
        "import sys, physics_crosscheck as p;"
        " print([m for m in sys.modules if m.startswith('physics')])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout == "['physics_crosscheck.harness', 'physics_crosscheck']\n"
    assert callable(check)


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
