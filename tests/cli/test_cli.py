"""The command line as a user runs it: exit codes, messages, files."""

import io
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from physics_crosscheck.harness.engines.mujoco import MujocoEngine
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.interfaces.cli.run import exit_code
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.records.case import CaseKind
from physics_crosscheck.harness.render.terminal.table import print_results, summary
from physics_crosscheck.harness.results.status import Decision, TestStatus, status_of
from physics_crosscheck.records import AuditFinding, Case, Outcome, read_results
from tests.commands import crosscheck
from tests.records.made import case, finding, model, results
from tests.standing import keep_default_engines, shorten_scenarios, without

ROOT = Path(__file__).parents[2]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Copy a built-in folder to a name with a space."""
    shutil.copytree(builtin() / "mass_spring_damper", tmp_path / "my mass")
    keep_default_engines(tmp_path / "my mass")
    without(tmp_path / "my mass", "step", "resonance")
    shorten_scenarios(tmp_path / "my mass", 8)
    return tmp_path / "my mass"


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def test_wrong_literal_exits_1_and_is_reported(folder: Path, tmp_path: Path) -> None:
    edit(folder / "mujoco.xml", 'stiffness="47.0"', 'stiffness="47.000047"')
    done = crosscheck("run", folder, "--engine", "mujoco", cwd=tmp_path)
    assert done.returncode == 1
    assert "1 of 2 cases differs" in done.stdout
    assert re.search(r"FAIL  mass_spring_damper/mujoco.xml \[mujoco\]", done.stdout)
    line = 1 + (folder / "mujoco.xml").read_text().split("47.000047")[0].count("\n")
    assert f"change my mass/mujoco.xml:{line} from 47.000047 to 47" in done.stdout


@pytest.mark.parametrize(("name", "old", "new", "sentence"), [
    ("mujoco.xml", "<worldbody>", "<worldbody", "mujoco.xml: MuJoCo can't load it"),
    ("mujoco.xml.toml", "engines", "motors", "unknown key 'motors'"),
    ("robot.urdf", "</robot>", "", r"robot.urdf:\d+: the file ends before </robot>"),
    ("space.py", "def build():", "def build():\n    oops", r"space.py:\d+: build\(\) fails.*oops"),
    ("system.py", "k * x.q**2 / 2", "k * y.q**2 / 2", r"system.py:\d+: NameError: name 'y'"),
    ("system.py", "k * x.q**2 / 2", "k * x.q / 2", r"V has the unit kg\*m\*s\^-2; expected"),
])  # fmt: skip
def test_invalid_file_exits_3_and_is_located(
    folder: Path, tmp_path: Path, name: str, old: str, new: str, sentence: str
) -> None:
    edit(folder / name, old, new)
    for other in folder.iterdir():  # tests of faults show that others still run
        if other.name not in ("system.py", name.removesuffix(".toml"), f"{name}.toml", name):
            other.unlink()
    done = crosscheck("run", folder, cwd=tmp_path)
    assert done.returncode == 3
    assert re.search(sentence, done.stdout), done.stdout
    assert "Traceback" not in done.stdout + done.stderr


def test_model_file_without_a_sidecar_is_a_failure(folder: Path, tmp_path: Path) -> None:
    (folder / "mujoco.xml.toml").unlink()
    done = crosscheck("run", folder, "--engine", "pymunk", cwd=tmp_path)
    assert done.returncode == 3
    assert "has no sidecar; write mujoco.xml.toml" in done.stdout


@pytest.mark.parametrize(("arguments", "sentence"), [
    (["run", "nowhere"], "nowhere: no such folder; the built-in systems are anchored_pair"),
    (["run", "--engine", "havok"], "unknown engine 'havok'; known engines: dart, drake, idyntree"),
    (["run", "--resolution", "0"], "must be a number between 1e-13 and 1e-2, not 0"),
    (["run", "--jobs", "0"], "must be a whole number above 0, not 0"),
    (["report", "nothing.json"], "nothing.json: can't be read"),
    (["frobnicate"], "unknown command 'frobnicate'. Commands: run, demo, list"),
    (["audti", "x"], "unknown command 'audti'. Did you mean audit?"),
    (["."], "To check this path, run `crosscheck run .`"),
    (["run", "--lst-failed"], "crosscheck run: unknown option --lst-failed. Did you mean --last-f"),
    (["run", "--alone", "x"], "unknown option --alone"),
    (["--jobs", "2", "run"], "unknown option --jobs before a command. Options follow the command"),
    (["run", "--format", "josn"], "unknown value 'josn'. Did you mean json? Choose from text,"),
    (["run", "--strict=1"], "--strict"),
    (["compare", "a", "b", "c"], "unexpected argument 'c'"),
    (["engines", "--conformance", "mujoko"], "'mujoko' is not installed. Did you mean mujoco?"),
])  # fmt: skip
def test_wrong_usage_exits_2_with_a_sentence(
    tmp_path: Path, arguments: list[str], sentence: str
) -> None:
    done = crosscheck(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert sentence in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("command", ["run", "audit", "derive"])
def test_missing_folder_does_not_stop_the_others_and_exits_2(
    folder: Path, tmp_path: Path, command: str
) -> None:
    (tmp_path / "empty").mkdir()
    shutil.copytree(builtin() / "simple_pendulum", tmp_path / "pendulum")
    without(tmp_path / "pendulum", "driven", "large", "chirp")
    shorten_scenarios(tmp_path / "pendulum", 8)
    only = [] if command == "derive" else ["--engine", "mujoco"]
    names = ("nowhere", folder.name, "empty", "pendulum")
    done = crosscheck(command, *names, *only, cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    assert "nowhere: no such folder; the built-in systems are" in done.stderr
    assert (
        "empty: neither it nor any folder in it has a system.py; continuing with the others"
        in done.stderr
    )
    last = done.stderr.splitlines()[-1]
    assert last == "crosscheck: skipped unknown targets: nowhere, empty"
    assert "pendulum" in done.stdout
    assert "mass" in done.stdout


def test_missing_folder_hides_no_failure(folder: Path, tmp_path: Path) -> None:
    edit(folder / "mujoco.xml", "<option", "<optoin")
    done = crosscheck("run", folder.name, "nowhere", "--engine", "mujoco", cwd=tmp_path)
    assert done.returncode == 3
    assert "nowhere: no such folder; the built-in systems are" in done.stderr
    assert done.stderr.splitlines()[-1].endswith("skipped unknown targets: nowhere")


def test_report_needs_only_the_results(folder: Path, tmp_path: Path) -> None:
    crosscheck("run", folder, "--engine", "pymunk", "--out", "out", cwd=tmp_path)
    (tmp_path / "out" / "index.html").unlink()
    shutil.rmtree(folder)
    done = crosscheck("report", "out/results.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "index.html").stat().st_size > 10_000


def test_command_without_arguments_prints_its_help(tmp_path: Path) -> None:
    done = crosscheck(cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == crosscheck("--help", cwd=tmp_path).stdout
    assert "Check models:\n  run " in done.stdout


def test_engines_are_listed_with_their_versions(tmp_path: Path) -> None:
    done = crosscheck("engines", cwd=tmp_path)
    assert done.returncode == 0
    for name in ("mujoco", "pybullet", "pymunk"):
        assert re.search(rf"^{name} +\d+\.\d+", done.stdout, re.MULTILINE)


def test_derive_shows_the_computed_errata(tmp_path: Path) -> None:
    done = crosscheck("derive", "free_pair", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert re.search(r"2\.25.*differs", done.stdout)
    latex = crosscheck("derive", "free_pair", "--latex", cwd=tmp_path)
    assert r"\ddot" in latex.stdout


AGREES, DIFFERS, FAILED = (case(o) for o in (Outcome.AGREES, Outcome.DIFFERS, Outcome.FAILED))
UNRESOLVED, ABSENT = case(Outcome.UNRESOLVED), case(Outcome.ABSENT)
ACCEPTED = case(Outcome.DIFFERS, accepted="a soft joint")


def robot(kind: CaseKind) -> Case:
    return case(Outcome.FAILED if kind else Outcome.AGREES, folder="a/mujoco.xml", kind=kind)


JUDGED = robot("")


@pytest.mark.parametrize(("cases", "required", "code"), [
    ([AGREES, AGREES], False, 0), ([AGREES, DIFFERS], False, 1),
    ([AGREES, UNRESOLVED], False, 1), ([DIFFERS, FAILED], False, 3),
    ([AGREES, ABSENT], False, 0), ([AGREES, ABSENT], True, 3), ([], False, 3),
    ([AGREES, ACCEPTED], False, 0), ([ABSENT, ABSENT], False, 3),
    # A file's own engine fails on its own limit, on the run's, and without another's verdict.
    ([JUDGED, robot("crash")], False, 1), ([JUDGED, robot("time limit")], False, 3),
    ([robot("crash"), robot("file")], False, 3),
])  # fmt: skip
def test_exit_code_depends_on_outcomes(cases: list[Case], required: bool, code: int) -> None:
    assert exit_code(results(*cases), required) == code


@pytest.mark.parametrize(("findings", "cases", "code"), [
    ([finding()], [AGREES], 1), ([finding(severity="note")], [AGREES], 0),
    ([finding()], [ACCEPTED], 0),  # the accepted motion covers the finding
])  # fmt: skip
def test_audit_finding_is_a_difference_unless_accepted(
    findings: list[AuditFinding], cases: list[Case], code: int
) -> None:
    assert exit_code(results(*cases, models=(model(*findings),)), False) == code


@pytest.mark.parametrize("failed", [
    {"audit": None, "audit_failure": "it died"}, {"linearization_failure": "it died"},
    {"audit": None, "audit_failure": "it died", "accepted": "known"},
])  # fmt: skip
@pytest.mark.parametrize("cases", [[AGREES], [ACCEPTED], [DIFFERS]])
def test_failed_check_of_a_model_is_a_failure(failed: dict[str, Any], cases: list[Case]) -> None:
    failing = model(**failed)
    record = results(*cases, models=(failing,))
    assert not failing.passes
    assert exit_code(record, False) == 3
    assert f"1 {failing.failures[0][0]} failed" in summary(record)
    shown = io.StringIO()
    print_results(Console(file=shown, width=160), record)
    assert "disc/mujoco.xml [mujoco]  XC613 the" in shown.getvalue()
    assert f"{failing.failures[0][0]} failed: it died" in shown.getvalue()
    decision = status_of(failing, require_engines=False)
    assert decision == Decision(TestStatus.FAIL, f"{failing.failures[0][0]} failed: it died")


def test_missing_engine_fails_with_a_remedy(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(MujocoEngine, "version", lambda _: None)
    monkeypatch.chdir(folder.parent)
    commands: list[list[str]] = [["run"], ["audit"], ["mutate"], ["gate"]]
    for command in commands:
        assert main([*command, str(folder), "--engine", "mujoco"]) == 3, command
        output = capsys.readouterr()
        assert "mujoco is not installed" in output.out + output.err
        if command != ["gate"]:  # which reports it per case
            assert "pip install 'physics-crosscheck[engines]'" in output.err


@pytest.mark.parametrize("closing", [">&-", ">&- 2>&-", "| head -c 1", "2>&- | head -c 1"])
def test_closed_streams_do_not_change_the_exit_code(tmp_path: Path, closing: str) -> None:
    shell = (
        f"{sys.executable} -m physics_crosscheck engines {closing}; echo ${{PIPESTATUS[0]}} > code"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        ["bash", "-c", shell], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert (tmp_path / "code").read_text() == "0\n"
    assert done.stderr == ""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_full_standard_output_is_reported(tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with Path("/dev/full").open("w") as full:
        command = [sys.executable, "-m", "physics_crosscheck", "engines"]
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, stdout=full, stderr=subprocess.PIPE, text=True
        )
    assert done.returncode == 3
    assert "standard output: No space left on device. The printed text is incomplete" in done.stderr


def test_removed_working_folder_is_named(tmp_path: Path) -> None:
    removes = f"rmdir '{tmp_path}'; {sys.executable} -m physics_crosscheck list"
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        ["bash", "-c", removes], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 3
    assert "the working folder was removed. Change to an existing folder" in done.stderr


@pytest.mark.slow
def test_run_with_closed_streams_writes_its_files(folder: Path, tmp_path: Path) -> None:
    run = f"{sys.executable} -m physics_crosscheck run 'my mass' --engine pymunk --out out"
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "CI": "1"}
    done = subprocess.run(["bash", "-c", f"{run} >&- 2>&-"], cwd=tmp_path, env=environment)
    assert done.returncode == 0
    assert len(read_results(tmp_path / "out" / "results.json").cases) == 1
