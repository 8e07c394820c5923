"""Interrupted runs that are resumed, concurrent runs, and folders that cannot be written."""

import errno
import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.planning import cache as caches
from physics_crosscheck.harness.planning.cache import CacheKey
from physics_crosscheck.harness.planning.result_builder import ResultBuilder
from physics_crosscheck.harness.planning.target_plan import TargetPlan
from physics_crosscheck.harness.records.hold import locked
from physics_crosscheck.harness.render.terminal.progress import Progress
from physics_crosscheck.harness.run import Options
from physics_crosscheck.records import Case, read_results
from tests.faults.known_folder import KNOWN_ANSWER, KNOWN_MODEL, SYSTEM, known_folder
from tests.robots.files import joint, link
from tests.standing import without

OnCase = Callable[[int], None]

UNWRITABLE = (
    "cannot be read or written: {}. Check the path, its permissions and the free disk space."
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Create a right model and one that never ends, for the fast known-answer engine."""
    monkeypatch.syspath_prepend(KNOWN_ANSWER)
    monkeypatch.chdir(tmp_path)
    return hanging(tmp_path / "osc")


def hanging(place: Path) -> Path:
    folder = known_folder(place, {"good": "", "slow": "[fault]\nhang = 10000\n"})
    without(folder, "driven")
    return folder


@pytest.fixture
def after(monkeypatch: pytest.MonkeyPatch) -> Callable[[OnCase], None]:
    """Call a function after each case with the number of finished cases."""

    def make(do: OnCase) -> None:
        def report(_: Progress, done: int, total: int, case: Case | None) -> None:
            do(done)

        monkeypatch.setattr(Progress, "__call__", report)

    return make


def test_stopped_run_keeps_its_cases_and_resumes(
    folder: Path, after: Callable[[OnCase], None], capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["run", "osc", "--out", "out", "--jobs", "1"]
    after(lambda done: os.kill(os.getpid(), signal.SIGINT) if done == 1 else None)
    assert main(command) == 130
    output = capsys.readouterr()
    stopped = "stopped by SIGINT: 1 case done; "
    assert f"{stopped}with --cache DIR, the next run reuses what is done" in output.err
    assert "1 of 2 cases agree" in output.out
    assert "stopped by SIGINT, 1 not run" in output.out
    command += ["--cache", "cache"]
    assert main(command) == 130
    assert f"{stopped}the same command runs the others" in capsys.readouterr().err
    first = read_results(Path("out/results.json"))
    assert [case.model for case in first.cases] == ["good.known"]
    assert [str(case) for case in first.not_run] == ["oscillator/slow.known/free [known]"]
    assert first.stopped == "SIGINT"
    assert Path("out/index.html").is_file()

    (folder / "slow.known").write_text(KNOWN_MODEL)
    after(lambda done: None)
    assert main(command) == 0
    second = read_results(Path("out/results.json"))
    assert len(second.cases) == 2
    assert not second.not_run
    # The seconds are equal too: the case did not run again.
    assert second.cases[:1] == first.cases
    assert sorted(path.name for path in Path("out").iterdir()) == ["index.html", "results.json"]


def test_second_signal_ends_the_run_at_once(
    folder: Path, after: Callable[[OnCase], None], capsys: pytest.CaptureFixture[str]
) -> None:
    def twice(_: int) -> None:
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGINT)

    after(twice)
    assert main(["run", "osc", "--out", "out", "--jobs", "1"]) == 130
    assert capsys.readouterr().err == "crosscheck: stopped by SIGINT\n"
    assert not {path.name for path in Path("out").iterdir()} - {".lock"}


ARM = "\n".join((
    '<robot name="arm">', link("base"), link("fore"),
    joint("elbow", "base", "fore", '<axis xyz="0 1 0"/>'), "</robot>",
))  # fmt: skip


def test_run_of_a_robot_file_resumes(
    after: Callable[[OnCase], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for engine in ("mujoco", "pybullet"):
        pytest.importorskip(engine)
    monkeypatch.chdir(tmp_path)
    Path("arm.urdf").write_text(ARM)
    command = ["run", "arm.urdf", "--out", "out", "--jobs", "1"]
    command += ["--engine", "mujoco", "--engine", "pybullet", "--cache", "cache"]
    after(lambda done: os.kill(os.getpid(), signal.SIGTERM) if done == 1 else None)
    assert main(command) == 128 + signal.SIGTERM
    first = read_results(Path("out/results.json"))
    assert (len(first.cases), len(first.not_run)) == (1, 1)
    after(lambda done: None)
    assert main(command) == 0
    second = read_results(Path("out/results.json"))
    assert len(second.cases) == 2
    assert first.cases[0] in second.cases  # with equal seconds: it did not run again


def cache_key(file: Path, **options: Any) -> CacheKey | None:
    """Return the key of a case of a robot file."""
    builder = ResultBuilder(lambda *_: None)
    target = TargetPlan(file, Options(cache=caches.Cache(Path("cache")), **options), builder)
    return target._cache_key("case", (str(file), file.name, "mujoco"), "states", None)


def test_cache_key_covers_dependencies_of_a_robot_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    file = Path("arm.urdf")
    mesh = '<visual><geometry><mesh filename="a.stl"/></geometry></visual></link>'
    mesh = link("base").replace("</link>", mesh)
    file.write_text(ARM.replace(link("base"), mesh))
    before = cache_key(file)
    assert before is not None
    assert cache_key(file) == before
    assert cache_key(file, floating=True) != before
    assert cache_key(file, resolution=1e-8) != before
    with monkeypatch.context() as patch:
        patch.setattr(caches, "_environment", lambda: "another source or engine")
        assert cache_key(file) != before
    Path("a.stl").write_text("solid")
    assert cache_key(file) != before
    Path("a.stl").unlink()
    Path("arm.urdf.toml").touch()
    assert cache_key(file) != before
    Path("arm.urdf.toml").unlink()
    assert cache_key(file) == before


def test_two_runs_into_one_folder_are_rejected(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with locked(Path("out"), "run"):
        assert main(["run", "osc", "--out", "out"]) == 2
    output = capsys.readouterr().err
    assert "another run is writing to out; choose another folder: --out" in output
    assert len(output.splitlines()) == 1


def test_unwritable_folder_is_reported_before_the_run(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("out").touch()
    assert main(["run", "osc", "--out", "out"]) == 3
    assert capsys.readouterr().err == f"crosscheck: out: {UNWRITABLE.format('File exists')}\n"


def test_full_disk_keeps_the_previous_results(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    (folder / "slow.known").write_text(KNOWN_MODEL)
    Path("out").mkdir()
    Path("out/results.json").write_text("as it was")
    monkeypatch.setattr(os, "fsync", full)
    assert main(["run", "osc", "--out", "out", "--engine", "known"]) == 3
    output = capsys.readouterr().err.splitlines()[-1]
    sentence = UNWRITABLE.format("No space left on device")
    assert output == f"crosscheck: out/results.json: {sentence}"
    assert Path("out/results.json").read_text() == "as it was"
    assert sorted(path.name for path in Path("out").iterdir()) == ["results.json"]


HOSTILE = {
    "keyboard": "raise KeyboardInterrupt",
    "generator": "raise GeneratorExit",
    "base": "raise BaseException('no')",
    "exits": "import sys; sys.exit(0)",
    "leaves": "import os; os._exit(0)",
    "killed": "import os, signal; os.kill(os.getpid(), signal.SIGTERM)",
    "deep": "f = lambda: f(); f()",
    "hoards": "bytearray(2**40)",
    "spins": "while True: pass",
}


@pytest.mark.slow
def test_hostile_declaration_fails_only_its_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.syspath_prepend(KNOWN_ANSWER)
    monkeypatch.chdir(tmp_path)
    for name, code in HOSTILE.items():
        known_folder(Path(name), {"good": ""})
        Path(name, "system.py").write_text(f"{SYSTEM}\n{code}\n")
    known_folder(Path("sound"), {"good": ""})
    assert main(["run", *HOSTILE, "sound", "--out", "out", "--limit", "3"]) == 3
    cases = read_results(Path("out/results.json")).cases
    reasons = {case.folder: case.reason for case in cases if case.outcome == "FAILED"}
    assert reasons.keys() == HOSTILE.keys()
    assert [case.outcome for case in cases if case.folder == "sound"] == ["AGREES"] * 2
    line = len(SYSTEM.splitlines()) + 2
    for name, reason in reasons.items():
        assert reason.startswith(f"{name}/system.py:{line}: ")
    assert "KeyboardInterrupt" in reasons["keyboard"]
    assert "exit code 0" in reasons["leaves"]
    assert "RecursionError" in reasons["deep"]
    assert "--memory raises it" in reasons["hoards"]
    assert "3 processor seconds; --limit raises it" in reasons["spins"]
    assert "SIGTERM" in reasons["killed"]
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.workers
def test_hostile_declaration_does_not_end_other_commands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    known_folder(Path("leaves"), {})
    Path("leaves/system.py").write_text("import os; os._exit(0)\n")
    for command in (["derive"], ["audit"], ["mutate"], ["gate"]):
        assert main([*command, "leaves"]) == 3, command
        output = capsys.readouterr()
        assert "leaves/system.py:1: it ends the process, exit code 0" in output.out + output.err
