"""Each kind of change has its own status and message; whatever fails, the gate does not pass."""

import errno
import itertools
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

import msgspec
import pytest

import physics_crosscheck.harness.commands.gate.gate as gating
from physics_crosscheck.command import AGREE, FAIL
from physics_crosscheck.harness.baseline.store import BaselineError, read_baseline, write_baseline
from physics_crosscheck.harness.commands.gate.result import GateResult
from physics_crosscheck.harness.engines.pymunk import PymunkEngine
from physics_crosscheck.harness.interfaces.cli import main as cli
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.records.diff import Status
from tests.gate.conftest import SYSTEM, Repository, copy_of
from tests.models import edited
from tests.standing import keep_default_engines, shorten_scenarios, without

CHANGED, WITHIN, IMPROVED = Status.CHANGED, Status.WITHIN, Status.IMPROVED
NOT_RUN, NEW, GONE, SAME = Status.NOT_RUN, Status.NEW, Status.GONE, Status.SAME


def _absent(_: object) -> None:
    """Return no version, as of an engine that is not installed."""


def describe(result: GateResult, model: str) -> tuple[set[Status], set[str], str]:
    """Return the statuses and kinds of the cases of a model, and all their messages."""
    mine = [c for c in result.changes if c.id.model == model]
    sentences = " | ".join(sentence for c in mine for sentence in c.messages)
    return {c.status for c in mine}, {kind for c in mine for kind in c.kinds}, sentences


MODEL_CHANGES: list[tuple[str, str, str, str, Any, set[str], str]] = [
    # No motion changes.
    ("a comment in MJCF", "mujoco.xml", "<worldbody>", "<!-- moved --><worldbody>",
     WITHIN, {"text"}, ""),
    ("a number written otherwise", "robot.urdf", ">47.0<", ">4.7e1<", WITHIN, {"text"}, ""),
    ("a comment in Python", "space.py", "MASS = 1.3  # kg", "MASS = 1.3  # kilograms",
     WITHIN, {"text"}, ""),
    ("a comment in a sidecar", "space.py.toml", "# A Space", "# Note that a Space",
     WITHIN, {"text"}, ""),
    ("a solver that has nothing to solve", "mujoco.xml", 'jacobian="dense"', 'iterations="7"',
     WITHIN, {"text"}, ""),
    # The motion of the model changes.
    ("a constant by 1e-6 in MJCF", "mujoco.xml", '"47.0"', '"47.000047"',
     CHANGED, {"model"}, "the motion implies k 47 -> 47.000047"),
    ("a constant by 1 % in a URDF", "robot.urdf", 'mass value="1.3"', 'mass value="1.313"',
     CHANGED, {"model"}, "the motion implies m 1.3 -> 1.313"),
    ("a constant by 1e-6 in Python", "space.py", "DAMPING = 0.9 ", "DAMPING = 0.9000009 ",
     CHANGED, {"model"}, "the verdict changed from AGREES to DIFFERS"),
    ("an armature", "mujoco.xml", 'springref="0"', 'springref="0" armature="0.1"',
     CHANGED, {"model"}, "the model's motion changed"),
    # Only the audit shows the change.
    ("a bound literal without effect", "mujoco.xml", 'diaginertia="0.0195', 'diaginertia="0.02',
     CHANGED, {"audit"}, "body[mass]/inertial@diaginertia[0] is 0.02, but"),
    ("a mirrored axis", "mujoco.xml", 'axis="1 0 0"', 'axis="-1 0 0"',
     CHANGED, {"audit"}, "an axis is flipped"),
    # Only the numerics change.
    ("a coarser step", "mujoco.xml", 'timestep="0.002"', 'timestep="0.004"',
     CHANGED, {"numbers"}, "step 0.002 s -> 0.004 s"),
    ("a finer step in a sidecar", "space.py.toml", "step = 0.002", "step = 0.001",
     IMPROVED, {"numbers"}, "error at dt"),
    # RK4 gains nothing where a force is constant over each step: that case is slightly worse.
    ("an integrator of higher order", "mujoco.xml", '"Euler"', '"RK4"',
     {IMPROVED, CHANGED}, {"numbers"}, "claimed order 1 -> 4"),
    ("an integrator that is as good", "mujoco.xml", '"Euler"', '"implicitfast"',
     WITHIN, {"numbers"}, "integrator euler -> implicitfast"),
    # The model cannot run.
    ("an added joint", "mujoco.xml", "<inertial pos", '<joint name="y" axis="0 1 0"/><inertial pos',
     NOT_RUN, set(), "y: is not a coordinate"),
    ("a renamed joint", "mujoco.xml", 'joint name="x"', 'joint name="slide"',
     NOT_RUN, set(), "slide: is not a coordinate"),
    ("broken XML", "mujoco.xml", "<worldbody>", "<worldbody", NOT_RUN, set(), "FAILED"),
    ("an unknown key in a sidecar", "mujoco.xml.toml", "engines", "motors",
     NOT_RUN, set(), "unknown key 'motors'"),
]  # fmt: skip


def copied(index: int, name: str) -> str:
    """Return the name of the copy that a row of the table changes: a model or its sidecar."""
    return f"copy{index}_{name}"


@pytest.fixture(scope="module")
def changed(pristine: Repository, tmp_path_factory: pytest.TempPathFactory) -> GateResult:
    """Gate every row at once, each in a copy of its model, in one system.

    The copies get the accepted entries of their model, since they are equal to it.
    """
    repository = Repository(tmp_path_factory.mktemp("changed"))
    repository.folder.mkdir(parents=True)
    shutil.copy(pristine.folder / "system.py", repository.folder)
    cases, texts = {}, {}
    accepted = read_baseline(pristine.baseline)[SYSTEM]
    for index, (_, name, *_) in enumerate(MODEL_CHANGES):
        model = name.removesuffix(".toml")
        for each in (model, f"{model}.toml"):
            shutil.copy(pristine.folder / each, repository.folder / copied(index, each))
            texts[SYSTEM, copied(index, each)] = (pristine.folder / each).read_bytes()
        for entry in accepted.cases.values():
            if entry.model == model:
                files = {
                    each if each == "system.py" else copied(index, each): value
                    for each, value in entry.files.items()
                }
                copy = msgspec.structs.replace(entry, model=copied(index, model), files=files)
                cases[copy.id] = copy
    write_baseline(repository.baseline, [replace(accepted, cases=cases)], texts)
    assert {c.status for c in repository.gate().changes} == {SAME}
    for index, (_, name, old, new, *_) in enumerate(MODEL_CHANGES):
        repository.edit(copied(index, name), old, new)
    return repository.gate()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("index", "name", "status", "kinds", "expected"),
    [(i, row[1], *row[4:]) for i, row in enumerate(MODEL_CHANGES)],
    ids=[row[0] for row in MODEL_CHANGES],
)
def test_change_of_a_model_file_has_its_status_and_kind(
    changed: GateResult, index: int, name: str, status: Any, kinds: set[str], expected: str
) -> None:
    model = copied(index, name).removesuffix(".toml")
    statuses, seen_kinds, sentences = describe(changed, model)
    assert statuses == (status if isinstance(status, set) else {status}), sentences
    assert seen_kinds == kinds
    assert expected in sentences


def test_line_endings_are_no_change(repository: Repository) -> None:
    path = repository.folder / "mujoco.xml"
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    assert {c.status for c in repository.gate().changes} == {SAME}


def test_changes_of_scenarios_are_described(repository: Repository) -> None:
    repository.edit("system.py", "q={x: 0.25}", "q={x: 0.3}")
    repository.edit("system.py", "duration=1.8125", "duration=2")
    repository.edit("system.py", "1.5 * sin(5.9 * t)", "1.4 * sin(5.9 * t)")
    result = repository.gate("pymunk")
    assert {(c.status, c.kinds) for c in result.changes} == {(CHANGED, ("scenario",))}
    free, resonance = sorted(result.changes, key=lambda change: change.id.scenario)
    assert "duration 1.8125 s -> 2 s" in free.messages[0]
    assert "input f = 1.5*sin(5.9*t) -> f = 1.4*sin(5.9*t)" in resonance.messages[0]


def test_constant_off_by_a_millionth_changes_the_equations(repository: Repository) -> None:
    repository.edit("system.py", '"k", 47.0', '"k", 47.000047')
    result = repository.gate("pymunk")
    assert {(c.status, c.kinds) for c in result.changes} == {(CHANGED, ("equations",))}
    for change in result.changes:
        assert "the verdict changed from AGREES to DIFFERS" in " | ".join(change.messages)


def test_renamed_scenario_is_gone_and_new(repository: Repository) -> None:
    repository.edit("system.py", 'Scenario("free"', 'Scenario("released"')
    result = repository.gate("pymunk")
    assert {(c.id.scenario, c.status, c.kinds) for c in result.changes} == {
        ("released", NEW, ()), ("free", GONE, ()), ("resonance", WITHIN, ("text",)),
    }  # fmt: skip


def test_declaration_that_cannot_be_loaded_runs_nothing(repository: Repository) -> None:
    repository.edit("system.py", "T=m * x.v", "T=m * y.v")
    result = repository.gate("pymunk")
    assert not result.passes
    assert "NameError: name 'y'" in " | ".join(*(c.messages for c in result.with_status(NOT_RUN)))


def test_equal_changes_of_model_and_equations_agree(repository: Repository) -> None:
    repository.edit("system.py", '"k", 47.0', '"k", 48.0')
    repository.edit("space.py", "STIFFNESS = 47.0", "STIFFNESS = 48.0")
    result = repository.gate("pymunk")
    _, kinds, sentences = describe(result, "space.py")
    assert kinds == {"model", "equations"}
    assert "model and equations changed alike, and agree" in sentences
    assert "the motion implies k 47 -> 48" in sentences
    assert "DIFFERS" not in sentences
    assert {c.status for c in result.changes} == {CHANGED}


def test_missing_engine_does_not_pass(
    repository: Repository, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(PymunkEngine, "version", _absent)
    result = repository.gate()
    assert describe(result, "space.py")[0] == {NOT_RUN}
    assert not result.passes


def test_removed_and_added_files_are_reported(repository: Repository) -> None:
    folder = repository.folder
    (folder / "space.py").unlink()
    (folder / "space.py.toml").unlink()
    (folder / "robot.urdf.toml").unlink()
    shutil.copy(folder / "mujoco.xml", folder / "second.xml")
    shutil.copy(folder / "mujoco.xml.toml", folder / "second.xml.toml")
    result = repository.gate()
    assert describe(result, "space.py")[0] == {GONE}
    assert describe(result, "second.xml")[0] == {NEW}
    assert describe(result, "robot.urdf")[0] == {NOT_RUN}
    assert describe(result, "mujoco.xml")[0] == {WITHIN}  # another model was added to its folder


def test_model_file_deleted_without_its_sidecar_cannot_run(repository: Repository) -> None:
    (repository.folder / "space.py").unlink()
    result = repository.gate()
    assert describe(result, "space.py")[0] == {NOT_RUN}


def test_gone_system_is_reported_unless_others_are_selected(repository: Repository) -> None:
    shutil.rmtree(repository.folder)
    result = repository.gate()
    assert {c.status for c in result.changes} == {GONE}
    assert len(result.changes) == 8
    parents = repository.gate(parents=(repository.root / "models",))
    assert {c.status for c in parents.changes} == {GONE}
    assert repository.gate(parents=()).changes == ()
    assert not repository.gate(parents=()).passes


@pytest.mark.slow
def test_softened_constraint_changes_the_model(repository: Repository) -> None:
    folder = repository.root / "models" / "drum_pendulum"
    shutil.copytree(builtin() / "drum_pendulum", folder)
    for path in folder.iterdir():
        if path.name.startswith(("robot", "space", "mujoco.xml")):
            path.unlink() if path.is_file() else shutil.rmtree(path)
    keep_default_engines(folder)
    without(folder, "driven", "large")
    shorten_scenarios(folder, 8)
    repository.accept("first baseline")
    edited(folder / "mujoco_rolling.xml", 'solref="1e-6 0.5"', 'solref="0.02 1"')
    result = repository.gate()
    statuses, kinds, _ = describe(result, "mujoco_rolling.xml")
    assert statuses == {CHANGED}
    assert "model" in kinds


@pytest.mark.slow
def test_model_depends_on_its_included_file(repository: Repository) -> None:
    folder = repository.folder
    shared = repository.root / "shared"
    shared.mkdir()
    (shared / "size.xml").write_text("<mujoco><size memory='2M'/></mujoco>")
    repository.edit(
        "mujoco.xml", "<worldbody>", '<include file="../../shared/size.xml"/><worldbody>'
    )
    assert "could not run" not in {c.status for c in repository.gate().changes}
    repository.accept("with an include")
    assert {c.status for c in repository.gate().changes} == {SAME}
    (shared / "size.xml").write_text("<mujoco><size memory='3M'/></mujoco>")
    result = repository.gate()
    assert describe(result, "mujoco.xml")[0] == {WITHIN}
    assert describe(result, "robot.urdf")[0] == {SAME}
    assert any(os.path.basename(s.file) == "size.xml" for s in result.file_diffs)
    assert folder.is_dir()


class Gating(Protocol):
    """A function that runs `crosscheck gate` with arguments and returns its exit code."""

    def __call__(self, *arguments: str) -> int: ...


@pytest.fixture
def gate(repository: Repository, monkeypatch: pytest.MonkeyPatch) -> Gating:
    """Return a function that runs `crosscheck gate` in the repository."""
    monkeypatch.chdir(repository.root)
    return lambda *arguments: cli.main(["gate", *arguments])


def contents(repository: Repository) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in repository.baseline.rglob("*") if path.is_file()}


def flip(text: str, after: str) -> str:
    """Change one digit of the number after a key."""
    place = text.index(after) + len(after)
    while not text[place].isdigit():
        place += 1
    return text[:place] + ("1" if text[place] != "1" else "2") + text[place + 1 :]


@pytest.mark.parametrize(("damage", "sentence"), [
    (lambda text: text[: len(text) // 2], "not JSON"),
    (lambda text: flip(text, '"end": '), "is damaged, badly merged or edited by hand"),
    (lambda text: text.replace('"scenarios": ["free", ', '"scenarios": ['),
     "is damaged, badly merged or edited by hand"),
    (lambda text: "null", "baseline of format 2"),
])  # fmt: skip
def test_damaged_baseline_is_reported_and_never_passes(
    repository: Repository,
    gate: Gating,
    capsys: pytest.CaptureFixture[str],
    damage: Callable[[str], str],
    sentence: str,
) -> None:
    text = repository.file.read_text()
    damaged = damage(text)
    assert damaged != text
    repository.file.write_text(damaged)
    assert gate() == FAIL
    error = capsys.readouterr().err
    assert sentence in error
    assert f"{SYSTEM}.json" in error


def test_run_fails_on_a_damaged_baseline(repository: Repository, gate: Gating) -> None:
    repository.file.write_text("{")
    assert cli.main(["run", str(repository.folder), "--engine", "pymunk"]) == FAIL


def test_baseline_that_is_a_file_or_binary_is_rejected(repository: Repository) -> None:
    repository.file.write_bytes(b"\xff\xfe")
    with pytest.raises(BaselineError, match="not JSON"):
        read_baseline(repository.baseline)
    with pytest.raises(BaselineError, match="is not a folder"):
        read_baseline(repository.file)


def test_missing_baseline_does_not_pass(
    repository: Repository, gate: Gating, capsys: pytest.CaptureFixture[str]
) -> None:
    repository.file.unlink()
    assert gate("models", "--engine", "pymunk") != AGREE
    out = capsys.readouterr().out
    assert "2 of 2 cases are new" in out
    assert "Fix: accept them:" in out


def test_altered_accepted_text_is_not_shown(
    repository: Repository, damped: tuple[Repository, GateResult]
) -> None:
    (repository.baseline / SYSTEM / "space.py.accepted").write_text("DAMPING = 5.0\n")
    diffs = gating.file_diffs(damped[1].changes, damped[1].folders, repository.baseline)
    messages = [line.message for diff in diffs for line in diff.changes]
    assert messages == ["changed; the accepted text is not kept, so its lines are unknown"]


def test_unreadable_file_is_named(
    repository: Repository,
    gate: Gating,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    real = Path.read_bytes

    def refuse(self: Path) -> bytes:
        if self.name == "robot.urdf":
            raise PermissionError(errno.EACCES, "Permission denied", str(self))
        return real(self)

    monkeypatch.setattr(Path, "read_bytes", refuse)
    assert gate() == FAIL
    out = capsys.readouterr().out
    assert f"models/{SYSTEM}/robot.urdf: can't be read: Permission denied" in out
    assert "4 as accepted (1 run" in out


def test_missing_engine_exits_3(
    repository: Repository,
    gate: Gating,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(PymunkEngine, "version", _absent)
    assert gate() == FAIL
    assert "ABSENT: pymunk is not installed" in capsys.readouterr().out


def test_full_disk_while_gating_does_not_pass(
    repository: Repository,
    gate: Gating,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def full(_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    assert gate() == AGREE
    monkeypatch.setattr(os, "fsync", full)
    assert gate() == FAIL
    assert "No space left" in capsys.readouterr().err


def test_unwritable_summary_does_not_pass(
    repository: Repository, gate: Gating, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", "/dev/full")
    assert gate() == FAIL


def test_full_disk_while_accepting_leaves_the_old_baseline(
    damped: tuple[Repository, GateResult], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    repository, result = copy_of(damped[0], tmp_path / "repository"), damped[1]
    before = contents(repository)
    real = os.fsync
    # Accepting writes a text, then the entries.
    for fails_at in (1, 2):
        count = itertools.count(1)

        def full(handle: int, count: Iterator[int] = count, fails_at: int = fails_at) -> None:
            if next(count) == fails_at:
                raise OSError(errno.ENOSPC, "No space left on device")
            real(handle)

        monkeypatch.setattr(os, "fsync", full)
        with pytest.raises(OSError, match="No space left"):
            repository.accept("more", result=result)
        assert contents(repository) == before
    monkeypatch.setattr(os, "fsync", real)
    assert len(repository.accept("more", result=result).files) == 2


def test_killed_gate_does_not_exit_0_and_loses_nothing(repository: Repository) -> None:
    before = contents(repository)
    repository.edit("mujoco.xml", "<worldbody>", "<!-- moved --><worldbody>")
    root = Path(cli.__file__).parents[2]
    process = subprocess.Popen(
        [sys.executable, "-m", "physics_crosscheck", "gate"],
        cwd=repository.root,
        env={**os.environ, "PYTHONPATH": str(root)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    time.sleep(1.0)
    os.killpg(process.pid, signal.SIGKILL)
    assert process.wait() != 0
    assert contents(repository) == before


def test_file_changed_during_the_run_does_not_pass(
    repository: Repository, monkeypatch: pytest.MonkeyPatch
) -> None:
    repository.edit("space.py", "MASS = 1.3  # kg", "MASS = 1.3  # kilograms")
    real = gating._run

    def meanwhile(*arguments: Any) -> Any:
        result = real(*arguments)
        repository.edit("space.py", "DAMPING = 0.9 ", "DAMPING = 0.91 ")
        return result

    monkeypatch.setattr(gating, "_run", meanwhile)
    result = repository.gate()
    assert not result.passes
    assert {c.messages[0] for c in result.changes if c.case is not None} == {
        "its files changed during the run; run it again"
    }


@pytest.mark.slow
def test_two_folders_of_one_system_are_rejected(
    repository: Repository, gate: Gating, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(repository.folder, repository.folder.parent / "copy")
    assert gate("models") != AGREE
    assert "both hold the system 'mass_spring_damper'" in capsys.readouterr().err
