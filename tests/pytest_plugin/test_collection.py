"""Collection of tests: their ids, names and selection."""

import subprocess
import sys
from pathlib import Path

import pytest

from physics_crosscheck.harness.engines.mujoco import MujocoEngine
from physics_crosscheck.harness.interfaces.pytest_plugin.runner import CaseRunner
from tests.pytest_plugin.conftest import FakeResults, Project

pytest_plugins = ["pytester"]

ROOT = Path(__file__).parents[2]
MSD = "models/msd/system.py::mass_spring_damper"
SCENARIOS = ("free", "step", "resonance", "audit")


@pytest.fixture(autouse=True)
def nothing_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    def run(*_: object) -> None:
        raise AssertionError("a case was run")

    monkeypatch.setattr(CaseRunner, "prepared", run)


def test_every_model_engine_and_scenario_has_a_readable_id(project: Project) -> None:
    project.add(files=("mujoco.xml", "robot.urdf"))
    assert project.collect("--crosscheck", "models") == [
        *(f"{MSD}/mujoco.xml/{name}" for name in SCENARIOS),
        *(f"{MSD}/robot.urdf/{name}[pybullet]" for name in SCENARIOS),
        *(f"{MSD}/robot.urdf/{name}[mujoco]" for name in SCENARIOS),
    ]


def test_folders_are_collected_at_any_depth_of_several_paths(project: Project) -> None:
    project.add("a", under="models/arms/left")
    project.add("b", under="others")
    project.add("hidden", under="models/.cache")
    ids = project.collect("--crosscheck", "models", "--crosscheck", "others/b/system.py")
    assert {name.split("::")[0] for name in ids} == {
        "models/arms/left/a/system.py",
        "others/b/system.py",
    }


@pytest.mark.parametrize(("selection", "count"), [
    (["-k", "free"], 3), (["-k", "mujoco.xml and not audit"], 3), (["-k", "pybullet"], 4),
    (["-m", "mujoco"], 8), (["-m", "mass_spring_damper and pybullet"], 4),
    (["-m", "crosscheck"], 12), (["-m", 'crosscheck(engine="mujoco", scenario="free")'], 2),
    (["--deselect", f"{MSD}/robot.urdf"], 4),
    ([f"{MSD}/robot.urdf/free[pybullet]"], 1), ([f"{MSD}/robot.urdf/free"], 2),
    (["models/msd"], 12),
])  # fmt: skip
def test_selection_by_name_marker_and_id(
    project: Project, selection: list[str], count: int
) -> None:
    project.add(files=("mujoco.xml", "robot.urdf"))
    assert len(project.collect("--crosscheck", "models", *selection)) == count


def test_own_tests_run_if_named(project: Project) -> None:
    project.add()
    (project.path / "tests").mkdir()
    (project.path / "tests" / "test_own.py").write_text("def test_own(): pass\n")
    own_tests = ["tests/test_own.py::test_own"]
    cases = [f"{MSD}/mujoco.xml/{name}" for name in SCENARIOS]
    assert project.collect() == own_tests
    assert project.collect("--crosscheck", "models") == cases
    assert project.collect("--crosscheck", "models", "tests") == own_tests + cases
    assert sorted(project.collect("--crosscheck", "models", ".")) == sorted(own_tests + cases)


def test_ini_paths_are_added_only_to_a_plain_run(project: Project) -> None:
    project.add()
    (project.path / "tests").mkdir()
    (project.path / "tests" / "test_own.py").write_text("def test_own(): pass\n")
    (project.path / "pytest.ini").write_text(
        "[pytest]\ntestpaths = tests\ncrosscheck_paths = models\n"
    )
    assert len(project.collect()) == 5
    assert project.collect("tests") == ["tests/test_own.py::test_own"]
    assert len(project.collect("models/msd")) == 4


def test_ignored_paths_are_not_collected(project: Project) -> None:
    project.add("a")
    project.add("b", under="models/rest")
    ids = project.collect("--crosscheck", "models", "--ignore", "models/rest")
    assert {name.split("::")[0] for name in ids} == {"models/a/system.py"}


def test_invalid_ini_paths_are_reported_with_file_and_setting(project: Project) -> None:
    (project.path / "pyproject.toml").write_text(
        "[tool.pytest.ini_options]\ncrosscheck_paths = [{}]\n"
    )
    done = project.run("-q")
    assert done.ret == pytest.ExitCode.USAGE_ERROR
    done.stderr.fnmatch_lines("*pyproject.toml: crosscheck_paths must be a list of paths: *")


def test_model_code_is_not_a_test_module(project: Project) -> None:
    project.add(files=("space.py",))
    (project.path / "pytest.ini").write_text("[pytest]\npython_files = s*.py\n")
    assert project.collect("--crosscheck", "models") == [
        f"{MSD}/space.py/{name}" for name in SCENARIOS
    ]
    assert len(project.collect("--crosscheck", "models", ".", "--doctest-modules")) == 4


def test_plugin_is_inactive_without_the_option(project: Project) -> None:
    project.add()
    (project.path / "test_own.py").write_text("def test_own(request):\n    pass\n")
    done = project.run("-q", "--strict-markers", "--strict-config")
    done.assert_outcomes(passed=1)
    done.stdout.no_fnmatch_line("*crosscheck*")


def test_plugin_imports_only_pytest() -> None:
    code = "import sys, pytest; before = set(sys.modules); import physics_crosscheck.pytest_plugin;"
    code += "print(sorted(set(sys.modules) - before))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    ours = ["physics_crosscheck", "physics_crosscheck.harness", "physics_crosscheck.pytest_plugin"]
    assert done.stdout.strip() == str(ours)


@pytest.mark.parametrize(("arguments", "sentence"), [
    (["--crosscheck", "nowhere"], "--crosscheck nowhere: no such folder; the built-in systems are"),
    (["--crosscheck", ""], "--crosscheck PATH is empty; name a folder"),
    (["--crosscheck", "empty"], "--crosscheck empty: no system.py and no robot file in it or"),
    (["--crosscheck", "models", "--crosscheck-resolution", "0"], "between 1e-13 and 1e-2, not 0"),
    (["--crosscheck", "models", "--crosscheck-limit", "-1"], "must be a number of seconds above 0"),
])  # fmt: skip
def test_usage_errors_are_reported_without_a_run(
    project: Project, arguments: list[str], sentence: str
) -> None:
    project.add()
    (project.path / "empty").mkdir()
    done = project.run(*arguments)
    assert done.ret == pytest.ExitCode.USAGE_ERROR
    assert sentence in done.stderr.str()
    assert "Traceback" not in done.stderr.str()


def test_unreadable_files_are_failed_tests(project: Project) -> None:
    broken = project.add("broken")
    project.edit(broken / "system.py", "k * x.q**2 / 2", "k * y.q**2 / 2")
    project.edit(project.add("ends") / "system.py", "from sympy", "raise SystemExit(3)\nfrom sympy")
    (project.add("lonely") / "mujoco.xml.toml").unlink()
    project.add("bare", files=())
    project.edit(project.add("typo") / "mujoco.xml.toml", "engines", "motors")
    done = project.run("--crosscheck", "models", "-W", "error")
    # The folder without a sidecar fails twice: for the file, and because nothing runs.
    done.assert_outcomes(failed=6)
    done.stdout.fnmatch_lines(
        [
            "*/bare: no model file has a sidecar, so nothing ran; add one*",
            "*/broken/system.py:*NameError: name 'y' is not defined",
            "*/ends/system.py:*: SystemExit: 3",
            "*/lonely/mujoco.xml: this model file has no sidecar*",
            "*/typo/mujoco.xml.toml: unknown key 'motors'*",
        ]
    )
    assert "Traceback" not in done.stdout.str()


def test_scenario_names_with_pytest_syntax_get_valid_ids(project: Project) -> None:
    folder = project.add()
    project.edit(folder / "system.py", 'Scenario("free"', 'Scenario("audit"')
    project.edit(folder / "system.py", 'Scenario("step"', 'Scenario("a::b[c]"')
    done = project.run("--crosscheck", "models", "--collect-only", "-q")
    for name in ("audit", "a:b(c)", "resonance", "audit of the model"):
        assert f"{MSD}/mujoco.xml/{name}" in done.outlines


def test_system_named_like_a_marker_does_not_get_the_marker(
    project: Project, fake_results: FakeResults
) -> None:
    folder = project.add()
    project.edit(folder / "system.py", 'name="mass_spring_damper"', 'name="skip"')
    (project.path / "pytest.ini").write_text("[pytest]\nmarkers =\n    mujoco: needs a licence\n")
    arguments = ("--crosscheck", "models", "--strict-markers")
    project.run(*arguments).assert_outcomes(passed=4)
    assert project.collect(*arguments, "-m", "mujoco") == []
    assert len(project.collect(*arguments, "-m", 'crosscheck(engine="mujoco")')) == 4


def test_missing_engine_is_skipped_unless_required(
    project: Project, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(MujocoEngine, "version", lambda _: None)
    project.add()
    done = project.run("--crosscheck", "models")
    done.assert_outcomes(skipped=4)
    done.stdout.fnmatch_lines(
        [
            "skipped: 4 tests: mujoco is not installed; pip install *",
            "nothing was tested: no engine*",
        ]
    )
    assert done.ret == pytest.ExitCode.TESTS_FAILED
    done = project.run("--crosscheck", "models", "-rs")
    done.stdout.fnmatch_lines(["SKIPPED*models/msd/mujoco.xml:1: mujoco is not installed;*"])
    done = project.run("--crosscheck", "models", "--require-engines")
    done.assert_outcomes(failed=4)
    done.stdout.fnmatch_lines(["XC606 ABSENT: mujoco is not installed; pip install *"])
