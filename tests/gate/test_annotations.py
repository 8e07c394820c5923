"""Annotations of a pull request at file and line, and its summary."""

import re
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from physics_crosscheck.harness.baseline.classify import Change
from physics_crosscheck.harness.commands.gate.result import GateResult
from physics_crosscheck.harness.commands.gate.text import notes, summary
from physics_crosscheck.harness.interfaces.cli import main as cli
from physics_crosscheck.harness.records.diff import Diff, Status
from physics_crosscheck.harness.results.github import (
    Annotation,
    case_notes,
    commands,
    in_ci,
    write_summary,
)
from physics_crosscheck.records import Case, Cause, Outcome, Results, SourceLine
from tests.baseline.samples import case
from tests.gate.conftest import Repository
from tests.records import made

HERE = {"GITHUB_ACTIONS": "true"}


def note(**given: Any) -> Annotation:
    place: dict[str, Any] = {"level": "error", "file": Path("a.xml"), "line": 3}
    return Annotation(**(place | {"title": "t", "message": "m"} | given))


def test_at_most_the_first_ten_annotations_are_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    lines = commands([note(line=i) for i in range(1, 30)], HERE)
    assert lines[0] == "::error file=a.xml,line=1,title=t::m"
    assert len(lines) == 10
    assert commands([note()], {}) == []


def test_text_of_files_cannot_forge_a_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
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


def test_paths_are_relative_to_the_repository(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sub").mkdir()
    monkeypatch.chdir(tmp_path / "sub")
    environment = HERE | {"GITHUB_WORKSPACE": str(tmp_path)}
    assert "file=sub/a.xml," in commands([note()], environment)[0]


def test_summary_is_truncated_to_the_limit_of_github(tmp_path: Path) -> None:
    path = tmp_path / "summary.md"
    path.write_text("x" * 1000)
    write_summary("é" * 2**20, {"GITHUB_STEP_SUMMARY": str(path)})
    assert path.stat().st_size <= 2**20
    text = path.read_text(encoding="utf-8")
    assert text.endswith("the rest is in the artifacts)\n")
    write_summary("more", {"GITHUB_STEP_SUMMARY": str(path)})
    assert path.stat().st_size <= 2**20
    write_summary("nowhere", {})


def test_ci_is_detected_by_its_variables() -> None:
    assert in_ci({"CI": "true"})
    assert in_ci({"GITHUB_ACTIONS": "true"})
    assert not in_ci({"CI": "false"})
    assert not in_ci({})


def test_changed_literal_is_annotated_at_its_line(
    repository: Repository,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
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
    annotations = re.findall(r"^::.*$", out, re.MULTILINE)
    assert len(annotations) == 1
    assert annotations[0].startswith(
        f"::error file=models/mass_spring_damper/mujoco.xml,line={line},"
    )
    assert "joint[x]@stiffness 47.0 -> 47.05, bound to k" in annotations[0]
    assert "(and 1 case more)" in annotations[0]
    assert "\x1b" not in out
    shown = (tmp_path / "summary.md").read_text()
    assert "## crosscheck gate: FAIL" in shown
    assert f"`models/mass_spring_damper/mujoco.xml:{line}`" in shown
    assert (repository.root / "reports/gate/summary.md").read_text() == shown


def test_worst_comes_first_and_passing_cases_are_not_annotated(tmp_path: Path) -> None:
    shown: dict[str, Any] = {"kinds": ("model",), "messages": ("<b>|text`",), "moved": 0.1}
    names: dict[str, Any] = {"system": "s", "scenario": "free", "engine": "e"}
    changes = tuple(
        Change(diff=Diff(model=f"m{i}.xml", status=status, **names, **shown))
        for i, status in enumerate(Status)
    )
    result = GateResult(
        changes=changes, file_diffs=(), results=None, folders={}, baseline={}, seconds=0.0
    )
    annotations = notes(result)
    titles = ["could not run", "changed", "gone", "new", "improved"]
    assert [n.title.split(":")[0] for n in annotations] == titles
    assert [n.level for n in annotations] == ["error"] * 4 + ["notice"]
    assert "<b>" not in summary(result)
    assert "&#60;b&#62;&#124;text&#96;" in summary(result)


def test_run_annotates_the_diagnosed_line(tmp_path: Path) -> None:
    (tmp_path / "m.xml").write_text("x")
    first = differing(tmp_path, "free")
    results = results_of(
        first, differing(tmp_path, "step"), causes=(cause("joint[x]@stiffness", 12),)
    )
    (annotation,) = case_notes(results)
    assert (annotation.file.name, annotation.line) == ("m.xml", 12)
    where = f"joint[x]@stiffness ({tmp_path}/m.xml:12)"
    assert annotation.message == f"{where} is 1; the motion implies 2 ± 0.1: off"
    assert annotation.title == "DIFFERS spring/m.xml/free [e]"
    assert case_notes(results_of(differing(tmp_path, "free", accepted="known"))) == []


def test_pair_of_causes_is_annotated_at_the_first_with_a_line(tmp_path: Path) -> None:
    (tmp_path / "m.xml").write_text("x")
    pair = cause("nut and bolt", None), cause("joint[x]@damping", 7)
    (annotation,) = case_notes(results_of(differing(tmp_path, "free"), causes=pair))
    assert (annotation.file.name, annotation.line) == ("m.xml", 7)
    assert annotation.message == (
        "nut and bolt is 1; the motion implies 2 ± 0.1 and"
        f" joint[x]@damping ({tmp_path}/m.xml:7) is 1; the motion implies 2 ± 0.1: off"
    )


def test_unexplained_model_is_annotated_at_its_audit_finding(tmp_path: Path) -> None:
    (tmp_path / "m.xml").write_text("x")
    place = SourceLine(file=str(tmp_path / "m.xml"), line=3)
    wrong = made.finding("mass is 9 where m = 0.9", location=place, expected=0.9, actual=9.0)
    unexplained = made.diagnosis(cause("joint[x]@damping", 7), explained=False)
    case = differing(tmp_path, "free")
    (annotation,) = case_notes(results_of(case, diagnosis=unexplained, audit=(wrong,)))
    assert (annotation.file.name, annotation.line) == ("m.xml", 3)
    assert annotation.message == "mass is 9 where m = 0.9: off"


def test_model_without_a_diagnosis_is_annotated_at_its_file(tmp_path: Path) -> None:
    (annotation,) = case_notes(results_of(differing(tmp_path, "free")))
    assert (annotation.file, annotation.line, annotation.message) == (tmp_path, None, "off")


def differing(folder: Path, scenario: str, **fields: Any) -> Case:
    given = {"scenario": scenario, "folder": str(folder), "reason": "off", **fields}
    return case(Outcome.DIFFERS, discrepancy=0.1, **given)


def cause(subject: str, line: int | None) -> Cause:
    places = () if line is None else (SourceLine(file="m.xml", line=line),)
    return made.cause(subject, locations=places)


def results_of(*cases: Case, causes: tuple[Cause, ...] = (), **fields: Any) -> Results:
    """Return the results of one model's cases, with a diagnosis if there are causes."""
    (first, *_) = cases
    names = {"system": first.system, "folder": first.folder, "engine": first.engine}
    diagnosis = made.diagnosis(*causes) if causes else None
    model = made.model(model=first.model, diagnosis=diagnosis, **names)
    return made.results(*cases, models=(replace(model, **fields),))


def test_workflow_and_hooks_call_existing_commands(capsys: pytest.CaptureFixture[str]) -> None:
    yaml = pytest.importorskip("yaml")
    root = Path(__file__).parents[2]
    workflow = yaml.safe_load((root / "docs/ci/github-workflow.yml").read_text())
    lines = [step["run"] for step in workflow["jobs"]["gate"]["steps"] if "run" in step]
    hooks = yaml.safe_load((root / ".pre-commit-hooks.yaml").read_text())
    ids = {hook["id"] for hook in hooks}
    assert ids == {"crosscheck-gate", "crosscheck-gate-system", "crosscheck-audit"}
    lines += [hook["entry"] for hook in hooks]
    called = [line.split(" || ")[0].split()[1:] for line in lines if line.startswith("crosscheck")]
    assert len(called) == 5
    for name, *options in called:
        with pytest.raises(SystemExit):
            cli.main([name, "--help"])
        help_text = capsys.readouterr().out
        assert all(option in help_text for option in options if option.startswith("--"))
    for hook in hooks:
        assert re.search(hook["files"], "models/drum_pendulum/robot.urdf")
        assert not re.search(hook["files"], "README.md")
