"""Whatever fails, the gate does not pass, and the accepted baseline stays intact."""

import errno
import itertools
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Protocol

import pytest

import physics_crosscheck.harness.commands.gate.gate as gating
from physics_crosscheck.command import AGREE, FAIL
from physics_crosscheck.harness.baseline.store import BaselineError, read_baseline
from physics_crosscheck.harness.commands.gate.result import GateResult
from physics_crosscheck.harness.engines.pymunk import PymunkEngine
from physics_crosscheck.harness.interfaces.cli import main as cli
from tests.gate.conftest import SYSTEM, Repository, copy_of


class Gating(Protocol):
    """A function that runs `crosscheck gate` with arguments and returns its exit code."""

    def __call__(self, *arguments: str) -> int: ...


def _absent(_: object) -> None:
    """Return no version, as of an engine that is not installed."""


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
