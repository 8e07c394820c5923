"""Robot files as tests, without a system folder."""

from pathlib import Path

import pytest

from physics_crosscheck.harness.commands.gate.accept import accept
from physics_crosscheck.harness.commands.gate.gate import gate
from physics_crosscheck.harness.engines.registry import engines_to_run
from physics_crosscheck.harness.interfaces.pytest_plugin.runner import CaseRunner
from physics_crosscheck.harness.run import Options
from tests.gate.conftest import ignore_progress
from tests.pytest_plugin.conftest import Project
from tests.robots.files import ARM, LAMP, TIPPED, UNLIMITED

pytest_plugins = ["pytester"]

URDF, XML = ([engine.name for engine in engines_to_run(suffix)] for suffix in (".urdf", ".xml"))
SWING = [
    *(f"robots/arm.urdf::swing/arm.urdf/states[{name}]" for name in URDF),
    "robots/arm.urdf::swing/arm.urdf/audit",
]
LIT = [
    *(f"robots/deep/lamp.xml::lamp/lamp.xml/states[{name}]" for name in XML),
    "robots/deep/lamp.xml::lamp/lamp.xml/audit",
]
if len(XML) == 1:
    LIT[0] = "robots/deep/lamp.xml::lamp/lamp.xml/states"


@pytest.fixture
def robots(project: Project) -> Path:
    """Create a project with two robots, and with files that are not robots."""
    folder = project.path / "robots"
    (folder / "deep").mkdir(parents=True)
    (folder / "arm.urdf").write_text(ARM)
    (folder / "deep" / "lamp.xml").write_text(LAMP)
    (folder / "deep" / "package.xml").write_text("<package/>")
    (folder / ".hidden").mkdir()
    (folder / ".hidden" / "arm.urdf").write_text(ARM)
    return folder


@pytest.fixture
def nothing_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    def run(*_: object) -> None:
        raise AssertionError("a case was run")

    monkeypatch.setattr(CaseRunner, "prepared", run)


@pytest.mark.usefixtures("nothing_runs", "robots")
@pytest.mark.parametrize(("arguments", "wanted"), [
    (["."], SWING + LIT),
    (["robots/deep/lamp.xml", "robots/arm.urdf"], LIT + SWING),  # as a shell expands a pattern
    (["robots/deep", "-k", "audit"], LIT[-1:]),
    (["robots", "-m", "swing and mujoco"], [name for name in SWING if "mujoco" in name]),
    (["robots", SWING[0]], SWING[:1]),
    (["robots", "-m", "crosscheck(model='arm.urdf', scenario='audit')"], SWING[-1:]),
])  # fmt: skip
def test_each_engine_of_a_robot_file_is_a_test_id(
    project: Project, arguments: list[str], wanted: list[str]
) -> None:
    assert sorted(project.collect("--crosscheck", *arguments)) == sorted(wanted)


@pytest.mark.usefixtures("nothing_runs")
def test_robot_files_next_to_system_folders_are_collected_if_named(
    project: Project, robots: Path
) -> None:
    project.add("msd", under="robots")
    ids = project.collect("--crosscheck", "robots")
    assert ids
    assert {name.split("::")[0] for name in ids} == {"robots/msd/system.py"}
    ids = project.collect("--crosscheck", "robots", "--crosscheck", "robots/arm.urdf")
    assert {name.split("::")[0] for name in ids} == {"robots/msd/system.py", "robots/arm.urdf"}


@pytest.mark.usefixtures("nothing_runs", "robots")
def test_ini_file_can_name_robot_files(project: Project) -> None:
    (project.path / "pytest.ini").write_text("[pytest]\ncrosscheck_paths = robots/deep\n")
    assert project.collect() == LIT


@pytest.mark.parametrize(("name", "why"), [
    ("robots/other.urdf", "robots/other.urdf: there is no such file"),
    ("robots/.hidden/none", "robots/.hidden/none: no such folder"),
    ("robots/deep/notes.txt", "only .urdf, .sdf, .xml, .usd, .usda, .usdc and .usdz run"),
    ("empty", "empty: no system.py and no robot file in it or below it"),
])  # fmt: skip
def test_path_without_a_target_is_a_usage_error(
    project: Project, robots: Path, name: str, why: str
) -> None:
    (robots / "deep" / "notes.txt").write_text("")
    (project.path / "empty").mkdir()
    done = project.run("--crosscheck", name)
    assert done.ret == pytest.ExitCode.USAGE_ERROR
    done.stderr.fnmatch_lines([f"*--crosscheck *{why}*"])


def test_correct_robot_passes_and_unreadable_robot_fails(project: Project, robots: Path) -> None:
    (robots / "broken.urdf").write_text(ARM.replace('value="2"', 'value="two"'))
    names = ("robots/arm.urdf", "robots/broken.urdf")
    done = project.run("--crosscheck", *names, "-k", "mujoco or audit or broken")
    done.assert_outcomes(passed=2, failed=1, deselected=len(SWING) - 2)
    done.stdout.fnmatch_lines(["XC401 FAILED: *robots/broken.urdf:2: *", "1 ok, 1 ERROR; largest*"])


def test_smooth_cases_compare_no_whole_step(project: Project, robots: Path) -> None:
    """Catch an option that does not reach the cases."""
    (project.path / "conftest.py").write_text(
        "def pytest_crosscheck_case(record):\n"
        "    return [] if record.whole_step is None else 'whole steps'\n"
    )
    lamp = ("--crosscheck", "robots/deep/lamp.xml", "-k", "mujoco or states and not pinocchio")
    project.run(*lamp).assert_outcomes(failed=1, deselected=len(LIT) - 1)
    project.run(*lamp, "--crosscheck-smooth").assert_outcomes(passed=1, deselected=len(LIT) - 1)


def test_ignored_attribute_fails_case_and_audit_with_its_line(
    project: Project, robots: Path
) -> None:
    (robots / "arm.urdf").write_text(TIPPED)
    done = project.run("--crosscheck", "robots/arm.urdf", "-k", "mujoco or audit", "-rf")
    done.assert_outcomes(failed=2, deselected=len(SWING) - 2)
    done.stdout.fnmatch_lines([
        "cause: XC205 moments of link[[]tip]/inertial/inertia (arm.urdf:5): in the file, *",
        "DIFFERS: hinge_dot is off by *",
        "audit: 1 finding",
        "  finding  XC104 *robots/arm.urdf:5: link 'tip' has inertia, *, but no mass; *",
    ])  # fmt: skip


@pytest.mark.skipif(not {"mujoco", "pinocchio"} <= {*URDF}, reason="needs both engines")
def test_refusal_is_skipped_if_another_engine_has_a_verdict(
    project: Project, robots: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (robots / "arm.urdf").write_text(UNLIMITED)
    selected = ("--crosscheck", "robots/arm.urdf", "-k", "mujoco or pinocchio")
    done = project.run(*selected)
    done.assert_outcomes(passed=1, skipped=1, deselected=len(SWING) - 2)
    done.stdout.fnmatch_lines(["skipped: 1 test: REFUSED, but * ran it: *specify limits*"])
    monkeypatch.setattr(CaseRunner, "judged_by", lambda *_: [])
    done = project.run(*selected)
    done.assert_outcomes(passed=1, failed=1, deselected=len(SWING) - 2)


def test_robot_files_cannot_be_accepted(
    project: Project, robots: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("CI", "GITHUB_ACTIONS"):
        monkeypatch.delenv(name, raising=False)
    (robots / "arm.urdf").write_text(TIPPED)
    accepting = ("--crosscheck", "robots/arm.urdf", "--crosscheck-accept", "right", "-k", "audit")
    done = project.run(*accepting)
    assert done.ret == pytest.ExitCode.USAGE_ERROR
    done.stderr.fnmatch_lines(
        ["*--crosscheck-accept: takes system folders. Accept a robot file with *"]
    )
    project.add("msd")
    done = project.run(*accepting, "--crosscheck", "models", "-k", "swing and audit")
    done.assert_outcomes(failed=1, deselected=4 + len(SWING) - 1)


def test_edit_since_the_baseline_fails_with_its_line(project: Project, robots: Path) -> None:
    """Catch an edit that no motion shows, as the gate does."""
    file, baseline = robots / "deep" / "lamp.xml", project.path / "reports" / "baseline"
    wanted = Options(baseline=baseline, engines=("mujoco",), jobs=1)
    accept(gate([file], wanted, ignore_progress), (), "first", baseline)
    selected = ("--crosscheck", "robots/deep/lamp.xml", "-m", "mujoco")
    project.run(*selected).assert_outcomes(passed=1, deselected=len(LIT) - 1)
    file.write_text(LAMP.replace("<joint ", '<joint margin="1" ', 1))
    done = project.run(*selected)
    done.assert_outcomes(failed=1, deselected=len(LIT) - 1)
    done.stdout.fnmatch_lines(["AGREES, but changed since the baseline; lamp.xml:2: *none -> 1; *"])
