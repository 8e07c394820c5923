"""Cases that the gate runs and lists, and their acceptance by case or of all, with a reason."""

import difflib
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from rich.console import Console

from physics_crosscheck.command import AGREE, DIFFER, FAIL, USAGE
from physics_crosscheck.harness.baseline.store import read_baseline
from physics_crosscheck.harness.commands.gate.accept import AcceptError, accept
from physics_crosscheck.harness.commands.gate.gate import _lines, gate
from physics_crosscheck.harness.commands.gate.result import GateResult
from physics_crosscheck.harness.commands.gate.survey import survey
from physics_crosscheck.harness.commands.gate.text import gate_lines, notes
from physics_crosscheck.harness.engines.pymunk import PymunkEngine
from physics_crosscheck.harness.interfaces.cli import main as cli
from physics_crosscheck.harness.interfaces.cli.gate import code
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.interfaces.cli.run import exit_code
from physics_crosscheck.harness.modelfiles.choice import CaseSelection
from physics_crosscheck.harness.modelfiles.folders import FolderError, builtin
from physics_crosscheck.harness.numerics.version import VERSION
from physics_crosscheck.harness.planning.model_checks import AUDIT, ModelCheck
from physics_crosscheck.harness.planning.prepared import TargetFacts
from physics_crosscheck.harness.records.diff import Status
from physics_crosscheck.harness.records.schema import schema
from physics_crosscheck.harness.records.write import encoded
from physics_crosscheck.harness.render.terminal.table import print_results
from physics_crosscheck.harness.run import Options, run
from physics_crosscheck.records import ModelId, Results
from tests.gate.conftest import SYSTEM, Repository, copy_of, ignore_progress
from tests.standing import keep_default_engines, shorten_scenarios, without

ROOT = Path(__file__).parents[2]


def test_repeated_case_is_as_accepted(pristine: Repository) -> None:
    result = pristine.gate("pymunk", every=True)
    assert len(result.changes) == 2
    for change in result.changes:
        assert (change.status, change.kinds, change.messages) == (Status.SAME, (), ())
        assert change.case is not None
    record = result.record()
    assert record.passes
    assert {(one.system, one.model, one.engine, one.run) for one in record.cases} == {
        ("mass_spring_damper", "space.py", "pymunk", True)
    }
    assert {one.status for one in record.cases} == {"as accepted"}


def chosen(repository: Repository) -> set[tuple[str, str]]:
    """Return the models to run, with their engines."""
    state = survey([repository.folder], Options(baseline=repository.baseline))
    return {(model, engine) for _, model, engine in state.chosen}


def test_only_cases_that_depend_on_a_change_run(
    repository: Repository, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Run only cases of a changed file or engine, but all cases after a change of numerics."""
    assert chosen(repository) == set()
    repository.edit("mujoco.xml", "<worldbody>", "<!-- moved --><worldbody>")
    assert chosen(repository) == {("mujoco.xml", "mujoco")}
    monkeypatch.setattr(PymunkEngine, "version", lambda _: "99.0")
    assert chosen(repository) == {("mujoco.xml", "mujoco"), ("space.py", "pymunk")}
    monkeypatch.setattr("physics_crosscheck.harness.baseline.fingerprint.VERSION", VERSION + 1)
    assert len(chosen(repository)) == 4


def test_unchanged_repository_passes_without_sympy_or_an_engine(pristine: Repository) -> None:
    code = (
        "import sys; from physics_crosscheck.harness.interfaces.cli.main import main;"
        "code = main(['gate', '--out', sys.argv[1]]);"
        "names = {'sympy', 'scipy', 'mujoco', 'pybullet', 'pymunk'};"
        "print(code, *sorted(names & set(sys.modules)))"
    )
    out = pristine.root / "out"
    done = subprocess.run(
        [sys.executable, "-c", code, str(out)],
        cwd=pristine.root,
        capture_output=True,
        text=True,
        env={"PYTHONPATH": str(ROOT), "PATH": ""},
        timeout=1800,
        check=False,
    )
    assert done.stdout.splitlines()[-1] == "0", done.stdout + done.stderr


def test_change_of_a_file_that_code_reads_or_tests_for_runs_again(repository: Repository) -> None:
    """Run folders again whose code reads elsewhere, and others when a hidden file changes."""
    hidden, soft = repository.folder / ".mass", repository.root / "soft.txt"
    hidden.write_text("1.3")
    here = "__import__('pathlib').Path(__file__).parent"
    mass = f"float({here}.joinpath('.mass').open('r+').read())"
    repository.edit("space.py", "Body(MASS, ", f"Body({mass}, ")
    repository.accept("read from a file", result=repository.gate("pymunk"))
    for case, entry in read_baseline(repository.baseline)[SYSTEM].cases.items():
        assert (".mass" in entry.files) == (case.engine == "pymunk")
    assert {c.case for c in repository.gate("pymunk").changes} == {None}
    hidden.write_text("1.4")
    result = repository.gate("pymunk")
    assert {c.status for c in result.changes} == {Status.CHANGED}
    assert [(diff.file, diff.models) for diff in result.file_diffs] == [(".mass", ("space.py",))]
    hidden.write_text("1.3")
    stiffness = f"47.0 + 0.5 * {here}.joinpath('../../soft.txt').exists()"
    repository.edit("system.py", '"k", 47.0', f'"k", {stiffness}')
    repository.accept("depends on a file outside", result=repository.gate("pymunk"))
    result = repository.gate("pymunk")
    assert None not in {c.case for c in result.changes}
    assert {c.status for c in result.changes} == {Status.SAME}
    assert str(repository.root) not in repository.file.read_text()
    soft.touch()
    assert {c.status for c in repository.gate("pymunk").changes} == {Status.CHANGED}


MODEL = ModelId(system=SYSTEM, model="space.py", engine="pymunk")


@pytest.fixture(scope="module")
def wrong(pristine: Repository, tmp_path_factory: pytest.TempPathFactory) -> Repository:
    """Create a repository that binds a wrong number on which no motion depends."""
    repository = Repository(tmp_path_factory.mktemp("wrong"))
    shutil.copytree(pristine.root, repository.root, dirs_exist_ok=True)
    repository.edit("space.py", "MASS = 1.3", "SPARE = 1.4\nMASS = 1.3")
    repository.edit("space.py.toml", "[bindings]", '[bindings]\n"SPARE" = "m"')
    return repository


@pytest.fixture(scope="module")
def result(wrong: Repository) -> GateResult:
    return wrong.gate("pymunk")


def test_number_without_effect_on_motion_is_a_change_with_its_line(
    wrong: Repository, result: GateResult
) -> None:
    assert code(result) == DIFFER
    line = (wrong.folder / "space.py").read_text().split("SPARE")[0].count("\n") + 1
    file = wrong.folder / "space.py"
    for change in result.changes:
        assert change.status is Status.CHANGED
        assert change.kinds == ("audit",)
        (message,) = change.messages
        assert message.startswith(f"the audit finds {file}:{line}: SPARE is 1.4, but m = 1.3")
    (note,) = notes(result)
    assert (note.file, note.line, note.level) == (file, line, "error")


@pytest.mark.slow
def test_accepted_audit_finding_passes_until_it_changes(
    wrong: Repository, tmp_path_factory: pytest.TempPathFactory, result: GateResult
) -> None:
    repository = Repository(tmp_path_factory.mktemp("accepted"))
    shutil.copytree(wrong.root, repository.root, dirs_exist_ok=True)
    repository.accept("a spare part, ordered so", result=repository.gate("pymunk"))
    audit = read_baseline(repository.baseline)[SYSTEM].audits[MODEL]
    assert audit.reason == "a spare part, ordered so"
    (finding,) = audit.findings
    assert finding.message.startswith("SPARE is 1.4, but m = 1.3")
    assert str(repository.root) not in repository.file.read_text()
    assert repository.gate("pymunk").passes
    # Repeated, it is the accepted finding; so it is in a run of all cases.
    assert repository.gate("pymunk", every=True).passes
    options = Options(engines=("pymunk",), baseline=repository.baseline, jobs=2)
    (model,) = run([repository.folder], options, ignore_progress).results.models
    assert model.findings
    assert (model.accepted, model.passes) == ("a spare part, ordered so", True)
    # Another value is not what was accepted.
    repository.edit("space.py", "SPARE = 1.4", "SPARE = 1.5")
    assert [c.kinds for c in repository.gate("pymunk").changes] == [("audit",)] * 2
    # After the fix, there is nothing to accept.
    repository.edit("space.py", "SPARE = 1.5", "SPARE = 1.3")
    fixed = repository.gate("pymunk")
    assert fixed.passes
    repository.accept("repaired", result=fixed)
    assert not read_baseline(repository.baseline)[SYSTEM].audits


def _broken(_: object) -> None:
    raise RuntimeError("no audit today")


TASK = ModelCheck.task


def _broken_audit(check: ModelCheck, facts: TargetFacts, **given: Any) -> Callable[..., object]:
    return _broken if check is AUDIT else TASK(check, facts, **given)


def test_failed_audit_does_not_pass_and_cannot_be_accepted(
    repository: Repository, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ModelCheck, "task", _broken_audit)
    result = repository.gate("pymunk", every=True)
    assert {change.status for change in result.changes} == {Status.NOT_RUN}
    assert "its audit failed: RuntimeError: no audit today" in result.changes[0].messages[0]
    with pytest.raises(AcceptError, match="its audit failed"):
        repository.accept("never mind", result=result)


def gated(root: Path) -> GateResult:
    """Gate the folder, also where nothing changed."""
    wanted = Options(baseline=root / "baseline", jobs=1, every=True, diagnose=False)
    return gate([root / "ball"], wanted, lambda *_: None)


@pytest.fixture(scope="module")
def accepted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Accept a bouncing ball in one engine."""
    root = tmp_path_factory.mktemp("accepted")
    hidden = shutil.ignore_patterns("__pycache__", "mujoco*", "robot*")
    shutil.copytree(builtin() / "events" / "bouncing_ball", root / "ball", ignore=hidden)
    without(root / "ball", "thrown")
    shorten_scenarios(root / "ball", 2)
    accept(gated(root), (), "first baseline", root / "baseline")
    return root


def edited(accepted: Path, root: Path, name: str, old: str, new: str) -> GateResult:
    shutil.copytree(accepted, root, dirs_exist_ok=True)
    text = (root / "ball" / name).read_text()
    assert text.count(old) == 1
    (root / "ball" / name).write_text(text.replace(old, new))
    return gated(root)


def test_repeated_motion_with_events_is_unchanged(accepted: Path) -> None:
    again = gated(accepted)
    assert {change.status for change in again.changes} == {Status.SAME}


def test_restitution_off_by_a_millionth_changes_the_model(accepted: Path, tmp_path: Path) -> None:
    result = edited(accepted, tmp_path, "space.py", "RESTITUTION = 0.8", "RESTITUTION = 0.8000008")
    assert {change.status for change in result.changes} == {Status.CHANGED}
    assert {kind for change in result.changes for kind in change.kinds} == {"model"}


def test_declared_restitution_changes_the_equations(accepted: Path, tmp_path: Path) -> None:
    result = edited(accepted, tmp_path, "system.py", '"e", 0.8,', '"e", 0.81,')
    assert {kind for change in result.changes for kind in change.kinds} == {"equations"}


@pytest.fixture(scope="module")
def changed(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """Accept models; then refine one step, coarsen another, delete a model and keep one."""
    home = tmp_path_factory.mktemp("home")
    folder = home / "mass_spring_damper"
    shutil.copytree(builtin() / "mass_spring_damper", folder)
    keep_default_engines(folder)
    without(folder, "step", "resonance")
    shorten_scenarios(folder, 8)
    for end in ("", ".toml"):
        (folder / f"space.py{end}").unlink()
        for name in ("gone.xml", "left.xml"):
            shutil.copy(folder / f"mujoco.xml{end}", folder / f"{name}{end}")
    place = home / "baseline"
    given = ["--reason", "first", "--folder", str(folder), "--engine", "mujoco"]
    assert main(["accept", *given, "--baseline", str(place)]) == 0
    for name, old, new in (
        ("mujoco.xml", 'timestep="0.002"', 'timestep="0.001"'),
        ("robot.urdf.toml", "step = 0.002", "step = 0.004"),
    ):
        text = (folder / name).read_text()
        assert old in text
        (folder / name).write_text(text.replace(old, new))
    for name in ("gone.xml", "gone.xml.toml"):
        (folder / name).unlink()
    options = Options(("mujoco",), jobs=2, baseline=place)
    return run([folder], options, ignore_progress).results


def test_changes_are_listed_and_unchanged_models_are_not(changed: Results) -> None:
    jsonschema.validate(json.loads(encoded(changed)), schema(Results))
    assert changed.baseline is not None
    changes = {c.model: c for c in changed.baseline.changes}
    assert {name: change.label for name, change in changes.items()} == {
        "mujoco.xml": "improved", "robot.urdf": "changed, worse", "gone.xml": "gone",
    }  # fmt: skip
    assert changes["gone.xml"].status is Status.GONE
    for name in ("mujoco.xml", "robot.urdf"):
        assert "step 0.002 s -> " in "; ".join(changes[name].messages)


def test_terminal_lists_changes(changed: Results) -> None:
    console = Console(record=True, width=200)
    print_results(console, changed)
    text = console.export_text()
    assert "since " in text
    assert "changed, worse  XC515 mass_spring_damper/robot.urdf  free [mujoco]" in text
    assert ": step 0.002 s" in text


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
