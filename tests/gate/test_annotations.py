"""What a pull request shows: annotations at file and line, and a summary."""

import re
from pathlib import Path

import pytest

from harness.baseline.changes import Change, Status
from harness.cli import main as cli
from harness.gate.gate import GateResult
from harness.gate.text import notes, summary
from harness.text.github import (
    MOST_SUMMARY,
    Annotation,
    case_notes,
    commands,
    in_ci,
    write_summary,
)

HERE = {"GITHUB_ACTIONS": "true"}


def note(**given):
    values = {"level": "error", "file": Path("a.xml"), "line": 3, "title": "t", "message": "m"}
    return Annotation(**(values | given))


def test_ten_annotations_at_most_the_first_ones(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    lines = commands([note(line=i) for i in range(1, 30)], HERE)
    assert lines[0] == "::error file=a.xml,line=1,title=t::m"
    assert len(lines) == 10
    assert commands([note()], {}) == []


def test_text_of_files_can_t_forge_a_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (line,) = commands(
        [note(title="a,b:c\n::error::x", message="50 %\n::warning::y\r", file=Path("a,b.xml"))],
        HERE,
    )
    assert "\n" not in line
    assert line == (
        "::error file=a%2Cb.xml,line=3,title=a%2Cb%3Ac%0A%3A%3Aerror%3A%3Ax"
        "::50 %25%0A::warning::y%0D"
    )


def test_files_are_told_relative_to_the_repository(tmp_path, monkeypatch):
    (tmp_path / "sub").mkdir()
    monkeypatch.chdir(tmp_path / "sub")
    environment = HERE | {"GITHUB_WORKSPACE": str(tmp_path)}
    assert "file=sub/a.xml," in commands([note()], environment)[0]


def test_a_summary_is_cut_to_what_github_takes(tmp_path):
    path = tmp_path / "summary.md"
    path.write_text("x" * 1000)
    write_summary("é" * MOST_SUMMARY, {"GITHUB_STEP_SUMMARY": str(path)})
    assert path.stat().st_size <= MOST_SUMMARY
    text = path.read_text(encoding="utf-8")
    assert text.endswith("the rest is in the artifacts)\n")
    write_summary("more", {"GITHUB_STEP_SUMMARY": str(path)})
    assert path.stat().st_size <= MOST_SUMMARY
    write_summary("nowhere", {})


def test_ci_is_known_by_its_variables():
    assert in_ci({"CI": "true"})
    assert in_ci({"GITHUB_ACTIONS": "true"})
    assert not in_ci({"CI": "false"})
    assert not in_ci({})


def test_a_changed_literal_is_annotated_at_its_line(repository, monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(repository.root)
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    monkeypatch.setenv("CI", "true")
    monkeypatch.delenv("GITHUB_WORKSPACE", raising=False)
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(tmp_path / "summary.md"))
    repository.edit("mujoco.xml", 'stiffness="47.0"', 'stiffness="47.05"')
    text = (repository.folder / "mujoco.xml").read_text()
    line = text.split("47.05")[0].count("\n") + 1
    assert cli.main(["gate"]) == 1
    out = capsys.readouterr().out
    made = re.findall(r"^::.*$", out, re.MULTILINE)
    assert len(made) == 1
    assert made[0].startswith(f"::error file=models/mass_spring_damper/mujoco.xml,line={line},")
    assert "bound to k" in made[0]
    assert "(and 2 cases more)" in made[0]
    assert "\x1b" not in out
    shown = (tmp_path / "summary.md").read_text()
    assert "## crosscheck gate: fails" in shown
    assert f"`models/mass_spring_damper/mujoco.xml:{line}`" in shown
    assert (repository.root / "reports/gate/summary.md").read_text() == shown


def test_the_worst_comes_first_and_passing_cases_are_not_annotated(tmp_path):
    changes = tuple(
        Change("s", f"m{i}.xml/free [e]", status, ("model",), ("<b>|told`",), 0.1)
        for i, status in enumerate(Status)
    )
    found = GateResult(changes, (), None, {}, {}, 0.0)
    made = notes(found)
    assert [n.title.split(":")[0] for n in made] == [
        "could not run",
        "changed",
        "gone",
        "new",
        "improved",
    ]
    assert [n.level for n in made] == ["error"] * 4 + ["notice"]
    assert "<b>" not in summary(found)
    assert "&lt;b&gt;\\|told&#96;" in summary(found)


def test_a_run_annotates_the_diagnosed_line(tmp_path):
    (tmp_path / "m.xml").write_text("x")
    case = {
        "system": "s",
        "model": "m.xml",
        "engine": "e",
        "scenario": "free",
        "folder": str(tmp_path),
        "outcome": "DIFFERS",
        "discrepancy": 0.1,
        "reason": "off",
    }
    finding = {"cause": "joint[x]@stiffness", "where": ["m.xml:12"]}
    model = {
        "system": "s",
        "model": "m.xml",
        "engine": "e",
        "folder": str(tmp_path),
        "diagnosis": {"explained": True, "findings": [finding]},
    }
    (made,) = case_notes({"cases": [case, case], "models": [model]})
    assert (made.file.name, made.line) == ("m.xml", 12)
    assert made.message == "joint[x]@stiffness: off"
    assert case_notes({"cases": [case | {"accepted": "known"}], "models": [model]}) == []


def test_the_workflow_and_the_hooks_call_commands_that_there_are(capsys):
    yaml = pytest.importorskip("yaml")
    root = Path(__file__).parents[2]
    workflow = yaml.safe_load((root / "docs/ci/github-workflow.yml").read_text())
    lines = [step["run"] for step in workflow["jobs"]["gate"]["steps"] if "run" in step]
    hooks = yaml.safe_load((root / ".pre-commit-hooks.yaml").read_text())
    assert {hook["id"] for hook in hooks} == {"crosscheck-gate", "crosscheck-gate-system"}
    lines += [hook["entry"] for hook in hooks]
    called = [line.split(" || ")[0].split()[1:] for line in lines if line.startswith("crosscheck")]
    assert len(called) == 4
    for name, *options in called:
        with pytest.raises(SystemExit):
            cli.main([name, "--help"])
        told = capsys.readouterr().out
        assert all(option in told for option in options if option.startswith("--"))
    for hook in hooks:
        assert re.search(hook["files"], "models/drum_pendulum/robot.urdf")
        assert not re.search(hook["files"], "README.md")
