"""Outcomes and messages of tests, with real engines and with fake results."""

import re
import textwrap
import xml.etree.ElementTree as ET
from functools import partial
from typing import Any

import pytest

from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.interfaces.pytest_plugin.runner import CaseRunner
from physics_crosscheck.harness.planning.model_checks import DIAGNOSIS
from physics_crosscheck.harness.results import status
from physics_crosscheck.harness.results.status import TestStatus
from physics_crosscheck.records import Case, Model, Outcome
from tests.models import edited
from tests.pytest_plugin.conftest import FakeResults, Project
from tests.records.made import case, finding, model

pytest_plugins = ["pytester"]

MSD = "models/msd/system.py::mass_spring_damper"


def junit(project: Project, tag: str) -> ET.Element:
    """Return the first element of a tag in j.xml."""
    element = ET.parse(project.path / "j.xml").find(f".//{tag}")
    assert element is not None
    return element


def properties(element: ET.Element) -> dict[str, str]:
    return {p.get("name", ""): p.get("value", "") for p in element.iter("property")}


def test_correct_model_passes_and_its_numbers_are_recorded(project: Project) -> None:
    project.add()
    (project.path / "pytest.ini").write_text(
        "[pytest]\naddopts = --strict-markers --strict-config\nfilterwarnings = error\n"
    )
    done = project.run("--crosscheck", "models", "-k", "free or audit", "--junitxml=j.xml", "-v")
    done.assert_outcomes(passed=2, deselected=2)
    done.stdout.fnmatch_lines(
        [f"{MSD}/mujoco.xml/free PASSED*", "1 ok; largest difference of the ok cases: *"]
    )
    ran = junit(project, "testcase")
    assert ran.get("classname") == "models.msd.system"
    assert ran.get("name") == "mass_spring_damper/mujoco.xml/free"
    values = properties(ran)
    assert values["outcome"] == "AGREES"
    assert 0 < float(values["discrepancy"]) < float(values["uncertainty"]) < 1e-9
    assert 0 < float(values["global_error"]) < 0.1
    assert float(values["order"]) == pytest.approx(1, abs=0.05)


def test_wrong_literal_is_reported_with_its_location(
    project: Project, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[object] = []
    run = CaseRunner._ask

    def counted(self: CaseRunner, function: Any, argument: Any) -> Any:
        calls.append(function)
        return run(self, function, argument)

    monkeypatch.setattr(CaseRunner, "_ask", counted)
    path = project.add() / "mujoco.xml"
    project.edit(path, 'stiffness="47.0"', 'stiffness="47.000047"')
    line = path.read_text()[: path.read_text().index("47.000047")].count("\n") + 1
    done = project.run(
        "--crosscheck", "models", "-k", "free or step or audit", "--junitxml=j.xml", "-v"
    )
    done.assert_outcomes(failed=3, deselected=1)
    number = f"cause: XC201 joint[[]x]@stiffness (mujoco.xml:{line}) is 47.000047"
    cause = f"{number}; the motion implies 47 ± *"
    done.stdout.fnmatch_lines(
        [
            "*_ mass_spring_damper/mujoco.xml/free [[]mujoco] _*",
            cause,
            f"Fix: change models/msd/mujoco.xml:{line} from 47.000047 to 47",
            "DIFFERS: x_dot is off by * of its displacement at the end of the segment at t = *",
            "  discrepancy *e-06, uncertainty *",
            "*_ mass_spring_damper/mujoco.xml/audit [[]mujoco] _*",
            f"Fix: change models/msd/mujoco.xml:{line} from 47.000047 to 47.0",
            f"*mujoco.xml:{line}: joint[[]x]@stiffness is 47.000047, but k = 47.0 *",
            f"FAILED {MSD}/mujoco.xml/free - DIFFERS*",
        ]
    )
    shown = done.stdout.str()
    message = shown.split("/free [mujoco] ___")[1].splitlines()[1:]
    top = [text for line_text in message for text in (textwrap.wrap(line_text, 80) or [""])][:8]
    assert f"mujoco.xml:{line}) is 47.000047; the motion implies 47" in " ".join(top)
    assert any(text.startswith("Fix: change ") for text in top)
    assert "Traceback" not in shown
    assert not re.search(r"collect\.py|runner\.py|Error\b", shown)
    paths = [call.keywords.get("path") for call in calls if isinstance(call, partial)]
    assert paths.count(DIAGNOSIS.function) == 1
    cases = ET.parse(project.path / "j.xml").getroot().iter("testcase")
    assert [properties(element)["code"] for element in cases] == ["XC201", "XC201", "XC123"]
    failure = junit(project, "failure")
    assert "joint[x]@stiffness" in failure.get("message", "")
    assert failure.text is not None
    assert "DIFFERS: x_dot" in failure.text
    assert f"mujoco.xml:{line}" in failure.text


def test_project_table_and_ini_file_set_options(project: Project) -> None:
    """Find a setting that only the command line reads."""
    project.edit(project.add() / "mujoco.xml", 'stiffness="47.0"', 'stiffness="47.000047"')
    table = project.path / "pyproject.toml"
    table.write_text("[tool.crosscheck]\nignore = ['XC1', 'XC2']\n")
    done = project.run("--crosscheck", "models", "-k", "free or audit")
    done.assert_outcomes(passed=2, deselected=2)
    done.stdout.fnmatch_lines(["*findings ignored: XC101, XC123, XC201"])
    table.write_text("[tool.crosscheck]\nlimit = -1\n")
    assert project.run("--crosscheck", "models").ret == pytest.ExitCode.USAGE_ERROR
    table.write_text("[tool.crosscheck]\nlimit = 60\n")
    (project.path / "pytest.ini").write_text("[pytest]\ncrosscheck_limit = -1\n")
    assert project.run("--crosscheck", "models").ret == pytest.ExitCode.USAGE_ERROR


def test_failed_test_reruns_by_lf_and_by_id(project: Project, fake_results: FakeResults) -> None:
    project.add()
    fake_results.cases["step"] = {"outcome": Outcome.DIFFERS, "reason": "x is off"}
    project.run("--crosscheck", "models").assert_outcomes(passed=3, failed=1)
    project.run("--crosscheck", "models", "--lf").assert_outcomes(failed=1)
    done = project.run("--crosscheck", "models", f"{MSD}/mujoco.xml/step")
    done.assert_outcomes(failed=1)
    done.stdout.fnmatch_lines(["XC301 DIFFERS: x is off", "no cause found: untold"])


@pytest.mark.workers
def test_crash_is_one_failed_test_with_its_output(project: Project) -> None:
    folder = project.add(files=("space.py", "mujoco.xml"))
    project.edit(
        folder / "space.py",
        "    space = pymunk.Space()\n",
        "    import os\n    print('about to crash', flush=True)\n    os.kill(os.getpid(), 11)\n"
        "    space = pymunk.Space()\n",
    )
    done = project.run("--crosscheck", "models", "-k", "free")
    done.assert_outcomes(passed=1, failed=1, deselected=6)
    done.stdout.fnmatch_lines(
        ["XC604 FAILED: */space.py:*: the process died (SIGSEGV)*", "  | about to crash"]
    )


@pytest.mark.slow
def test_hanging_model_is_stopped_at_the_time_limit(project: Project) -> None:
    folder = project.add(files=("space.py",))
    project.edit(folder / "space.py", "def build():", "def build():\n    while True: pass\n")
    done = project.run("--crosscheck", "models", "-k", "audit", "--crosscheck-limit", "6")
    done.assert_outcomes(failed=1, deselected=3)
    # Long enough to import everything before the model's line, even on a slow machine.
    spent = "it used up its limit of 6 processor seconds; --crosscheck-limit raises it"
    done.stdout.fnmatch_lines([f"XC601 FAILED: */space.py:*: {spent}"])


@pytest.mark.slow
def test_tests_of_a_system_run_on_one_xdist_worker(
    project: Project, pytester: pytest.Pytester
) -> None:
    pytest.importorskip("xdist")
    project.add("a")
    project.add("b", source="torsional_disc")
    project.edit(project.path / "models/b/mujoco.xml", 'timestep="0.002"', 'timestep="-1"')
    (project.path / "tests").mkdir()
    (project.path / "tests" / "test_own.py").write_text("def test_own(): assert False\n")
    (project.path / "pytest.ini").write_text("[pytest]\ntestpaths = tests\n")
    done = pytester.runpytest_subprocess(
        "-p",
        "physics_crosscheck.harness.interfaces.pytest_plugin",
        "-n",
        "2",
        "--dist",
        "loadfile",
        "-v",
        "--crosscheck",
        "models",
        "-k",
        "free or audit",
        "--junitxml=j.xml",
    )
    # A model with that step does not load, so its case and its audit fail.
    done.assert_outcomes(passed=2, failed=2)
    ran = re.findall(r"\[(gw\d)\] \[.*\] (?:PASSED|FAILED) models/(\w)/", done.stdout.str())
    assert len(ran) == 4
    assert len(set(ran)) == 2
    assert len({worker for worker, _ in ran}) == 2
    done.stdout.fnmatch_lines(["1 ok, 2 ERROR; largest difference of the ok cases: *"])
    assert len(ET.parse(project.path / "j.xml").findall(".//failure")) == 2


def test_known_difference_passes_and_is_shown(project: Project, fake_results: FakeResults) -> None:
    project.add()
    difference = {"outcome": Outcome.DIFFERS, "reason": "x is off", "accepted": "a soft joint"}
    fake_results.cases["free"] = difference
    done = project.run("--crosscheck", "models", "--junitxml=j.xml")
    done.assert_outcomes(passed=4)
    done.stdout.fnmatch_lines([f"accepted: DIFFERS {MSD}/mujoco.xml/free: a soft joint"])
    values = properties(junit(project, "testsuite"))
    assert values["accepted"] == "a soft joint"


@pytest.mark.slow
def test_accepted_difference_passes_until_it_changes(
    project: Project, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(project.path)
    path = project.add() / "mujoco.xml"
    project.edit(path, 'stiffness="47.0"', 'stiffness="47.01"')
    arguments = ("--crosscheck", "models", "-k", "free")
    project.run(*arguments).assert_outcomes(failed=1, deselected=3)
    assert main(["accept", "--folder", "models", "--reason", "a worn spring"]) == 0
    done = project.run(*arguments)
    done.assert_outcomes(passed=1, deselected=3)
    done.stdout.fnmatch_lines([f"accepted: DIFFERS {MSD}/mujoco.xml/free: a worn spring"])
    project.edit(path, 'stiffness="47.01"', 'stiffness="47.02"')
    done = project.run(*arguments)
    done.assert_outcomes(failed=1, deselected=3)
    done.stdout.fnmatch_lines(["DIFFERS: *a difference was accepted here (a worn spring)*"])
    edited(next((project.path / "reports/baseline").glob("*.json")), "a worn spring", "nothing")
    assert project.run(*arguments).ret == pytest.ExitCode.USAGE_ERROR


def test_conftest_can_add_requirements_for_its_models(
    project: Project, fake_results: FakeResults
) -> None:
    project.add()
    project.add("b", under="others")
    (project.path / "models" / "conftest.py").write_text(
        "def pytest_crosscheck_case(record):\n"
        "    error = record.full_run.global_error\n"
        "    if error > 0.001 and record.scenario == 'free':\n"
        "        return f'its global error is {error:.1%}'\n"
    )
    done = project.run("--crosscheck", "models", "--crosscheck", "others")
    done.assert_outcomes(passed=7, failed=1)
    done.stdout.fnmatch_lines(
        ["AGREES, but its global error is 0.5%", f"FAILED {MSD}/mujoco.xml/free - *"]
    )


@pytest.mark.parametrize(("record", "ending"), [
    (case(), TestStatus.PASS),
    (case(Outcome.DIFFERS, reason="r"), TestStatus.FAIL),
    (case(Outcome.UNRESOLVED, reason="r"), TestStatus.FAIL),
    (case(Outcome.FAILED, reason="r"), TestStatus.FAIL),
    (case(Outcome.ABSENT, reason="r"), TestStatus.SKIP),
    (case(Outcome.DIFFERS, reason="r", accepted="known"), TestStatus.PASS),
    (case(Outcome.UNRESOLVED, reason="r", accepted="known"), TestStatus.PASS),
    (case(Outcome.FAILED, reason="r", accepted="known"), TestStatus.FAIL),
    (case(Outcome.ABSENT, reason="r", accepted="known"), TestStatus.SKIP),
    (model(), TestStatus.PASS),
    (model(finding(severity="note")), TestStatus.PASS),
    (model(finding()), TestStatus.FAIL),
    (model(finding(), accepted="known"), TestStatus.PASS),
])  # fmt: skip
def test_status_of_records(record: Case | Model, ending: TestStatus) -> None:
    assert status.status_of(record, require_engines=False).status is ending


def test_missing_required_engine_and_unmet_requirement_fail() -> None:
    absent = status.status_of(case(Outcome.ABSENT, reason="r"), require_engines=True)
    assert absent.status is TestStatus.FAIL
    unmet = status.status_of(case(), require_engines=False, demands=["no"])
    assert unmet.status is TestStatus.FAIL
