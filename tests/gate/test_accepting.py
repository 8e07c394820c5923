"""Acceptance by case or of all, with a reason and a small readable diff; known differences."""

import difflib
import json
import re
from pathlib import Path

import jsonschema
import pytest

from physics_crosscheck.command import AGREE, DIFFER, FAIL, USAGE
from physics_crosscheck.harness.baseline.store import read_baseline
from physics_crosscheck.harness.commands.gate.accept import AcceptError
from physics_crosscheck.harness.commands.gate.gate import _lines
from physics_crosscheck.harness.commands.gate.result import GateResult
from physics_crosscheck.harness.commands.gate.text import gate_lines
from physics_crosscheck.harness.engines.pymunk import PymunkEngine
from physics_crosscheck.harness.interfaces.cli import main as cli
from physics_crosscheck.harness.interfaces.cli.run import exit_code
from physics_crosscheck.harness.modelfiles.choice import CaseSelection
from physics_crosscheck.harness.modelfiles.folders import FolderError
from physics_crosscheck.harness.records.diff import Status
from physics_crosscheck.harness.records.schema import schema
from physics_crosscheck.harness.records.write import encoded
from physics_crosscheck.harness.run import Options, run
from physics_crosscheck.records import Results
from tests.gate.conftest import SYSTEM, Repository, copy_of, ignore_progress


def _absent(_: object) -> None:
    """Return no version, as of an engine that is not installed."""


def lines_changed(before: str, after: str) -> list[str]:
    delta = difflib.unified_diff(before.splitlines(), after.splitlines(), lineterm="", n=0)
    return [line for line in delta if line[:1] in "+-" and line[:3] not in ("+++", "---")]


def run_pymunk(repository: Repository) -> Results:
    choice = CaseSelection(words="free")
    options = Options(("pymunk",), baseline=repository.baseline, jobs=2, choice=choice)
    return run([repository.folder], options, ignore_progress).results


def test_entry_has_a_summary_and_a_line_per_quantity(repository: Repository) -> None:
    text = repository.file.read_text()
    entry = text[text.index('"model": "mujoco.xml"') :].splitlines()
    assert [line.strip() for line in entry[1:3]] == ['"scenario": "free",', '"engine": "mujoco",']
    assert entry[3].strip().startswith('"summary": "AGREES, E ')
    assert "global error 0." in entry[3]
    assert entry[4].strip() == '"reason": "first baseline",'
    assert json.loads(text)["format"] == 2


@pytest.mark.slow
def test_accepting_one_case_changes_only_its_lines(repository: Repository) -> None:
    before = repository.file.read_text()
    repository.edit("space.py", "DAMPING = 0.9 ", "DAMPING = 0.91 ")
    result = repository.gate()
    done = repository.accept("a new damper", "*/space.py/resonance", result=result)
    assert list(map(str, done.cases)) == [f"{SYSTEM}/space.py/resonance [pymunk]"]
    changed = lines_changed(before, repository.file.read_text())
    assert 10 < len(changed) < 60
    # One of the case, and one of the audit of its model.
    assert sum('"reason": "a new damper"' in line for line in changed) == 2
    # The last accepted text is stored; cases that were not accepted are still reported.
    assert (repository.baseline / SYSTEM / "space.py.accepted").read_text().count("0.91") == 1
    again = repository.gate()
    assert {c.id.scenario: c.status for c in again.changes if c.id.model == "space.py"} == {
        "resonance": Status.EXPECTED,
        "free": Status.CHANGED,
    }
    assert not again.passes


def test_accepting_unchanged_motions_changes_only_hashes(
    repository: Repository, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Keep the accepted entries of cases whose engine is missing."""
    before = repository.file.read_text()
    repository.edit("mujoco.xml", "<worldbody>", "<!-- moved --><worldbody>")
    with monkeypatch.context() as patch:
        patch.setattr(PymunkEngine, "version", _absent)
        result = repository.gate()
        done = repository.accept("comment", result=result)
    assert (len(done.cases), len(done.unchanged)) == (2, 2)
    changed = lines_changed(before, repository.file.read_text())
    assert {line.split('"')[1] for line in changed} == {"files", "seal"}
    assert {c.status for c in repository.gate().changes} == {Status.SAME}
    written = repository.file.read_bytes()
    assert repository.accept("again").cases == ()
    assert repository.file.read_bytes() == written


def test_gone_case_is_removed_with_its_text_and_snapshots(repository: Repository) -> None:
    for name in ("space.py", "space.py.toml"):
        (repository.folder / name).unlink()
    assert len(repository.accept("not simulated in pymunk any more").cases) == 2
    entry = read_baseline(repository.baseline)[SYSTEM]
    assert not any(case.model == "space.py" for case in entry.cases)
    assert len(entry.snapshots) == 2
    assert not list((repository.baseline / SYSTEM).glob("space.py*"))
    assert repository.gate().passes


@pytest.mark.slow
def test_failed_case_cannot_be_accepted_and_nothing_is_written(repository: Repository) -> None:
    before = repository.file.read_bytes()
    repository.edit("mujoco.xml", "<worldbody>", "<worldbody")
    repository.edit("space.py", "DAMPING = 0.9 ", "DAMPING = 0.91 ")
    result = repository.gate()
    with pytest.raises(AcceptError, match=r"mujoco\.xml/free \[mujoco\] can't be accepted: FAILED"):
        repository.accept("all of it", result=result)
    assert repository.file.read_bytes() == before
    assert len(repository.accept("the damper", "*/space.py/*", result=result).cases) == 2


def test_pattern_that_matches_no_case_is_rejected(repository: Repository) -> None:
    with pytest.raises(FolderError, match="no case matches 'mujoko"):
        repository.accept("typing", "mujoko.xml/*")


def test_known_difference_passes_until_it_changes(
    damped: tuple[Repository, GateResult], tmp_path: Path
) -> None:
    repository, result = copy_of(damped[0], tmp_path / "repository"), damped[1]
    repository.accept("the real damper", result=result)
    result = repository.gate("pymunk")
    assert {c.status for c in result.changes} == {Status.EXPECTED}
    assert result.passes
    results = run_pymunk(repository)
    jsonschema.validate(json.loads(encoded(results)), schema(Results))
    assert {case.outcome for case in results.cases} == {"DIFFERS"}
    assert {case.accepted for case in results.cases} == {"the real damper"}
    assert exit_code(results, False) == AGREE

    repository.edit("space.py", "DAMPING = 0.91 ", "DAMPING = 0.9100001 ")
    changed = run_pymunk(repository)
    assert not any(case.accepted for case in changed.cases)
    assert (
        "was accepted here (the real damper), but the model's motion changed by"
        in changed.cases[0].reason
    )
    assert exit_code(changed, False) == DIFFER


@pytest.mark.slow
def test_fixed_known_difference_is_an_improvement(repository: Repository) -> None:
    repository.edit("space.py", "DAMPING = 0.9 ", "DAMPING = 0.91 ")
    repository.accept("for now", "*/space.py/*")
    repository.edit("space.py", "DAMPING = 0.91 ", "DAMPING = 0.9 ")
    result = repository.gate()
    assert {c.status for c in result.changes if c.id.model == "space.py"} == {Status.IMPROVED}
    assert result.passes


@pytest.mark.parametrize(("arguments", "environment", "code", "sentence"), [
    (["--reason", "why not"], {"CI": "true"}, USAGE, "refused in CI"),
    (["--reason", "why not"], {"GITHUB_ACTIONS": "true"}, USAGE, "refused in CI"),
    (["--reason", "  "], {}, USAGE, "--reason is empty"),
])  # fmt: skip
def test_accept_is_rejected_in_ci_and_without_a_reason(
    repository: Repository,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    environment: dict[str, str],
    code: int,
    sentence: str,
) -> None:
    monkeypatch.chdir(repository.root)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    before = repository.file.read_bytes()
    assert cli.main(["accept", *arguments]) == code
    assert sentence in capsys.readouterr().err
    assert repository.file.read_bytes() == before


def test_accept_and_gate_work_from_the_command_line(
    repository: Repository, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(repository.root)
    repository.edit("space.py", "MASS = 1.3  # kg", "MASS = 1.3  # kilograms")
    assert cli.main(["accept", "-v", "--reason", "a comment", "*/space.py/*"]) == AGREE
    out = capsys.readouterr().out
    assert out.startswith(f"Accepted 2 cases of {SYSTEM}\n")
    assert out.count(f"  {SYSTEM}/") == 2
    assert cli.main(["gate"]) == AGREE
    assert "ok  8 cases as accepted (0 run" in capsys.readouterr().out
    assert cli.main(["accept", "--reason", "x", "nothing/*"]) == USAGE
    repository.edit("mujoco.xml", "<worldbody>", "<worldbody")
    assert cli.main(["accept", "--reason", "all"]) == FAIL


@pytest.mark.parametrize("width", [60, 80, 120])
def test_first_lines_name_the_edit_and_the_remedy(
    damped: tuple[Repository, GateResult], width: int
) -> None:
    lines = gate_lines(damped[1], width)
    top = " ".join(" ".join(lines[:8]).replace("\\", "").split())
    assert re.match(r"FAIL  ?\S*space\.py:7 DAMPING 0\.9 -> 0\.91 changed 2 of 2 cases", top)
    assert "Fix: set it back to 0.9, or accept the change:" in top
    assert f"crosscheck accept --reason \"WHY\" '{SYSTEM}/space.py/*'" in top
    assert all(len(line) <= width or " " not in line.strip() for line in lines)
    assert lines[-1].startswith("2 cases changed (2 run, ")
    assert sum("0.91" in line for line in lines) <= 4  # at most once per edit and once per case


def test_passing_gate_prints_one_line(repository: Repository) -> None:
    (line,) = gate_lines(repository.gate("pymunk"))
    assert re.fullmatch(r"ok  2 cases as accepted \(0 run, \d+\.\d s\)", line)


@pytest.mark.parametrize(("old", "new", "edit"), [
    ('<a b="1" c="2.50"/>', '<a b="1" c="2.75"/>', "c 2.50 -> 2.75"),
    ("<ixx>0.1</ixx>", "<ixx>0.2</ixx>", "ixx 0.1 -> 0.2"),
    ('k = Constant("k", 47.0)', 'k = Constant("k", 47.1)', "47.0 -> 47.1"),
    ('<a b="1" c="2"/>', '<a b="3" c="4"/>', 'changed to: <a b="3" c="4"/>'),
    ("<body>", "<body", "changed to: <body"),
    ("x1 = 2", "x2 = 2", "changed to: x2 = 2"),
])  # fmt: skip
def test_edited_number_is_named(old: str, new: str, edit: str) -> None:
    (line,) = _lines(f"first\n{old}\n", f"first\n{new}\n")
    assert line.line == 2
    assert line.edit.endswith(edit)
    assert bool(line.old) == ("->" in edit)
