"""Cases that the gate runs and lists, with audits and events, and the cost of no change."""

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import jsonschema
import pytest
from rich.console import Console

from physics_crosscheck.command import DIFFER
from physics_crosscheck.harness.baseline.store import read_baseline
from physics_crosscheck.harness.commands.gate.accept import AcceptError, accept
from physics_crosscheck.harness.commands.gate.gate import gate
from physics_crosscheck.harness.commands.gate.notes import notes
from physics_crosscheck.harness.commands.gate.result import GateResult
from physics_crosscheck.harness.commands.gate.survey import survey
from physics_crosscheck.harness.engines.pymunk import PymunkEngine
from physics_crosscheck.harness.interfaces.cli.gate import code
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.numerics.version import VERSION
from physics_crosscheck.harness.planning.model_checks import AUDIT, ModelCheck
from physics_crosscheck.harness.planning.prepared import Arguments, TargetFacts
from physics_crosscheck.harness.records.diff import Status
from physics_crosscheck.harness.records.schema import schema
from physics_crosscheck.harness.records.write import encoded
from physics_crosscheck.harness.render.terminal.table import print_results
from physics_crosscheck.harness.run import Options, run
from physics_crosscheck.records import ModelId, Results
from tests.gate.conftest import SYSTEM, Repository, ignore_progress
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


def _broken_audit(check: ModelCheck, facts: TargetFacts, given: Arguments) -> Callable[..., object]:
    return _broken if check is AUDIT else TASK(check, facts, given)


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
