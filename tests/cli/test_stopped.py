"""Runs that are ended before their end, and gone on with; two at once; folders that can't be."""

from __future__ import annotations

import errno
import json
import os
import shutil
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from physics_crosscheck.harness.baseline.fingerprint import with_reads_of_system
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.planning import cache as caches
from physics_crosscheck.harness.planning.options import Options
from physics_crosscheck.harness.planning.result_builder import ResultBuilder
from physics_crosscheck.harness.planning.target_plan import TargetPlan
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.journal import NAME, CacheKey, journal
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.read import read_results
from physics_crosscheck.harness.render.terminal.progress import Progress
from tests.faults.known_folder import KNOWN_ANSWER, KNOWN_MODEL, SYSTEM, known_folder
from tests.robots.files import joint, link
from tests.standing import without

Told = Callable[[int], None]

UNWRITABLE = (
    "cannot be read or written: {}. Check the path, its permissions and the free disk space."
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A model that is right, and one that never ends: of the known-answer engine, quick."""
    monkeypatch.syspath_prepend(KNOWN_ANSWER)
    monkeypatch.chdir(tmp_path)
    return hanging(tmp_path / "osc")


def hanging(place: Path) -> Path:
    folder = known_folder(place, {"good": "", "slow": "[fault]\nhang = 10000\n"})
    without(folder, "driven")
    return folder


@pytest.fixture
def after(monkeypatch: pytest.MonkeyPatch) -> Callable[[Told], None]:
    """Have something done when a case is, by the number of those that are."""

    def make(do: Told) -> None:
        def told(_: Progress, done: int, total: int, case: Case | None) -> None:
            do(done)

        monkeypatch.setattr(Progress, "__call__", told)

    return make


def test_a_run_that_is_stopped_keeps_what_is_done_and_goes_on(
    folder: Path, after: Callable[[Told], None], capsys: pytest.CaptureFixture[str]
) -> None:
    after(lambda done: os.kill(os.getpid(), signal.SIGINT) if done == 1 else None)
    assert main(["run", "osc", "--out", "out", "--jobs", "1"]) == 130
    told = capsys.readouterr()
    assert "stopped by SIGINT: 1 case done and kept" in told.err
    assert "crosscheck run --resume --out out" in told.err
    assert "1 of 2 cases agree" in told.out
    assert "stopped by SIGINT, 1 not run" in told.out
    first = read_results(Path("out/results.json"))
    assert [case.model for case in first.cases] == ["good.known"]
    assert [str(case) for case in first.not_run] == ["oscillator/slow.known/free [known]"]
    assert first.stopped == "SIGINT"
    assert Path("out/index.html").is_file()

    (folder / "slow.known").write_text(KNOWN_MODEL)
    after(lambda done: None)
    assert main(["run", "osc", "--out", "out", "--jobs", "1", "--resume"]) == 0
    second = read_results(Path("out/results.json"))
    assert len(second.cases) == 2
    assert not second.not_run
    # Its seconds too: what was done was not done again.
    assert second.cases[:1] == first.cases
    assert sorted(path.name for path in Path("out").iterdir()) == ["index.html", "results.json"]


def test_a_second_signal_ends_the_run_at_once(
    folder: Path, after: Callable[[Told], None], capsys: pytest.CaptureFixture[str]
) -> None:
    def twice(_: int) -> None:
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGINT)

    after(twice)
    assert main(["run", "osc", "--out", "out", "--jobs", "1"]) == 130
    assert capsys.readouterr().err == "crosscheck: stopped by SIGINT\n"
    assert [path.name for path in Path("out").iterdir()] == [NAME]


@pytest.fixture(scope="module")
def stopped_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A place where a run of a declaration that reads a file was stopped after its good case."""
    place = tmp_path_factory.mktemp("stopped")

    def stop(_: Progress, done: int, total: int, case: Case | None) -> None:
        if done == 1:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(KNOWN_ANSWER)
        patch.chdir(place)
        patch.setattr(Progress, "__call__", stop)
        system = hanging(Path("osc")) / "system.py"
        Path("stiffness.txt").write_text("47.0")
        system.write_text(system.read_text().replace("47.0", "float(open('stiffness.txt').read())"))
        assert main(["run", "osc", "--out", "out", "--jobs", "1"]) == 130
    for name in ("slow.known", "slow.known.toml"):
        (place / "osc" / name).unlink()
    return place


@pytest.fixture
def resumed(
    stopped_once: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Callable[[], Case]:
    """A copy of that place as the working folder: resume the run, and return its case."""
    monkeypatch.syspath_prepend(KNOWN_ANSWER)
    monkeypatch.chdir(shutil.copytree(stopped_once, tmp_path / "stopped"))

    def resume() -> Case:
        main(["run", "osc", "--out", "out", "--jobs", "1", "--resume"])
        (case,) = read_results(Path("out/results.json")).cases
        return case

    return resume


def test_what_changed_since_is_run_again(resumed: Callable[[], Case]) -> None:
    Path("osc/good.known").write_text(KNOWN_MODEL.replace("47.0", "47.00047"))
    assert resumed().outcome is Outcome.DIFFERS


def test_what_was_kept_and_contradicts_itself_is_run_again(resumed: Callable[[], Case]) -> None:
    kept = Path("out") / NAME
    lines = [json.loads(line) for line in kept.read_text().splitlines()]
    damaged = [line["value"] for line in lines if line.get("key", {}).get("kind") == "case"]
    assert damaged
    for case in damaged:
        case["verdict"]["discrepancy"] = 5.2
    kept.write_text("".join(f"{json.dumps(line)}\n" for line in lines))
    verdict = resumed().verdict
    assert verdict is not None
    assert verdict.discrepancy != 5.2


def test_what_a_declaration_read_elsewhere_counts_among_its_files(
    resumed: Callable[[], Case],
) -> None:
    Path("stiffness.txt").write_text("47.00047")
    assert resumed().outcome is Outcome.DIFFERS


def test_what_a_model_that_is_code_depends_on_is_not_known(tmp_path: Path) -> None:
    (tmp_path / "beside.txt").write_text("1")
    place = str(tmp_path / "osc")
    space, xml = (place, "space.py", "pymunk"), (place, "m.xml", "mujoco")
    known = with_reads_of_system("hash", xml, {})
    assert with_reads_of_system("hash", space, {}) == ""
    assert with_reads_of_system("", xml, {"../beside.txt": "1"}) == ""
    assert with_reads_of_system("hash", xml, {"../beside.txt": "can't be read"}) == ""
    assert with_reads_of_system("hash", xml, {"../beside.txt": "1"}) not in ("", known)


ARM = "\n".join((
    '<robot name="arm">', link("base"), link("fore"),
    joint("elbow", "base", "fore", '<axis xyz="0 1 0"/>'), "</robot>",
))  # fmt: skip


def test_a_robot_s_file_is_gone_on_with_too(
    after: Callable[[Told], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for engine in ("mujoco", "pybullet"):
        pytest.importorskip(engine)
    monkeypatch.chdir(tmp_path)
    Path("arm.urdf").write_text(ARM)
    command = ["run", "arm.urdf", "--out", "out", "--jobs", "1"]
    command += ["--engine", "mujoco", "--engine", "pybullet"]
    after(lambda done: os.kill(os.getpid(), signal.SIGTERM) if done == 1 else None)
    assert main(command) == 128 + signal.SIGTERM
    first = read_results(Path("out/results.json"))
    assert (len(first.cases), len(first.not_run)) == (1, 1)
    after(lambda done: None)
    assert main([*command, "--resume"]) == 0
    second = read_results(Path("out/results.json"))
    assert len(second.cases) == 2
    assert first.cases[0] in second.cases  # its seconds too: it was not done again


def work_of(file: Path, **options: Any) -> CacheKey | None:
    """A case of a robot's file as a journal has it."""
    with journal(Path("out"), resume=True) as done:
        found = ResultBuilder(lambda *_: None, done)
        of_file = TargetPlan(file, Options(**options), found)
        return of_file._journal_key("case", (str(file), file.name, "mujoco"), "states", None)


def test_what_a_robot_s_file_depends_on_is_what_a_journal_goes_by(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    file = Path("arm.urdf")
    mesh = '<visual><geometry><mesh filename="a.stl"/></geometry></visual></link>'
    mesh = link("base").replace("</link>", mesh)
    file.write_text(ARM.replace(link("base"), mesh))
    before = work_of(file)
    assert before is not None
    assert work_of(file) == before
    assert work_of(file, floating=True) != before
    assert work_of(file, resolution=1e-8) != before
    with monkeypatch.context() as patch:
        patch.setattr(caches, "_environment", lambda: "another source or engine")
        assert work_of(file) != before
    Path("a.stl").write_text("solid")
    assert work_of(file) != before
    Path("a.stl").unlink()
    Path("arm.urdf.toml").touch()
    assert work_of(file) != before
    Path("arm.urdf.toml").unlink()
    assert work_of(file) == before


def test_two_runs_into_one_folder_are_refused(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with journal(Path("out"), resume=False):
        assert main(["run", "osc", "--out", "out"]) == 2
    told = capsys.readouterr().err
    assert f"another run (process {os.getpid()}) is writing to out" in told
    assert len(told.splitlines()) == 1


def test_a_folder_that_cannot_be_written_is_told_before_anything_is_run(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("out").touch()
    assert main(["run", "osc", "--out", "out"]) == 3
    assert capsys.readouterr().err == f"crosscheck: out: {UNWRITABLE.format('File exists')}\n"


def test_a_disk_that_is_full_leaves_the_results_that_were_there(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    (folder / "slow.known").write_text(KNOWN_MODEL)
    Path("out").mkdir()
    Path("out/results.json").write_text("as it was")
    monkeypatch.setattr(os, "fsync", full)
    assert main(["run", "osc", "--out", "out", "--engine", "known"]) == 3
    told = capsys.readouterr().err.splitlines()[-1]
    sentence = UNWRITABLE.format("No space left on device")
    assert told == f"crosscheck: out/results.json: {sentence}"
    assert Path("out/results.json").read_text() == "as it was"
    assert sorted(path.name for path in Path("out").iterdir()) == ["results.json", NAME]


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
def test_a_declaration_costs_its_own_folder_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.syspath_prepend(KNOWN_ANSWER)
    monkeypatch.chdir(tmp_path)
    for name, code in HOSTILE.items():
        known_folder(Path(name), {"good": ""})
        Path(name, "system.py").write_text(f"{SYSTEM}\n{code}\n")
    known_folder(Path("sound"), {"good": ""})
    assert main(["run", *HOSTILE, "sound", "--out", "out", "--limit", "3"]) == 3
    found = read_results(Path("out/results.json")).cases
    reasons = {case.folder: case.reason for case in found if case.outcome == "FAILED"}
    assert reasons.keys() == HOSTILE.keys()
    assert [case.outcome for case in found if case.folder == "sound"] == ["AGREES"] * 2
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
def test_a_hostile_declaration_does_not_end_other_commands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    known_folder(Path("leaves"), {})
    Path("leaves/system.py").write_text("import os; os._exit(0)\n")
    for command in (["derive"], ["audit"], ["mutate"], ["gate"]):
        assert main([*command, "leaves"]) == 3, command
        told = capsys.readouterr()
        assert "leaves/system.py:1: it ends the process, exit code 0" in told.out + told.err
