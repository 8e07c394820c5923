"""Runs that watch their files, are stopped, or resume."""

import errno
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from queue import Queue
from typing import Any

import pytest

from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.interfaces.cli.run import _watched
from physics_crosscheck.harness.interfaces.cli.targets import resolve_targets
from physics_crosscheck.harness.interfaces.pytest_plugin.session import targets_under
from physics_crosscheck.harness.planning import cache as caches
from physics_crosscheck.harness.planning.cache import CacheKey
from physics_crosscheck.harness.planning.result_builder import ResultBuilder
from physics_crosscheck.harness.planning.target_plan import TargetPlan
from physics_crosscheck.harness.records.hold import locked
from physics_crosscheck.harness.render.terminal.progress import Progress
from physics_crosscheck.harness.run import Options
from physics_crosscheck.records import Case, Outcome, read_results
from tests.cli.test_choosing import crosscheck, place
from tests.faults.known_folder import KNOWN_ANSWER, KNOWN_MODEL, SYSTEM, environment, known_folder
from tests.models import edited
from tests.robots.files import joint, link
from tests.standing import without

__all__ = ["place"]


class Watching:
    """A `run --watch` whose lines are read as they come."""

    def __init__(self, place: Path, *arguments: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "physics_crosscheck", "run", "--watch", *arguments],
            cwd=place,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=environment(),
        )
        self._lines: Queue[str] = Queue()
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as lines:
            for line in lines:
                self._lines.put(line)

    def until(self, words: str) -> str:
        """Return the output up to a line with these words."""
        output = ""
        while words not in output:
            output += self._lines.get(timeout=300)
        return output

    def end(self) -> int:
        self._process.send_signal(signal.SIGINT)
        return self._process.wait(timeout=300)

    def kill(self) -> None:
        self._process.kill()
        self._process.wait()
        self._reader.join()


def outcomes(place: Path) -> dict[str, Outcome]:
    results = read_results(place / "reports" / "results.json")
    return {case.model: case.outcome for case in results.cases}


@pytest.fixture
def watching(place: Path) -> Iterator[Watching]:
    process = Watching(place, "models", "-k", "free")
    yield process
    process.kill()


@pytest.mark.slow
def test_saved_file_runs_again_and_other_results_stay(place: Path, watching: Watching) -> None:
    watching.until("watching")
    assert outcomes(place) == {"good.known": Outcome.AGREES, "wrong.known": Outcome.DIFFERS}
    folder = place / "models" / "oscillator"
    good, wrong = folder / "good.known", folder / "wrong.known"
    good.write_text(good.read_text())  # unchanged: nothing runs
    edited(wrong, "48.0", "47.0")
    output = watching.until("watching")
    assert "changed: models/oscillator/wrong.known\n" in output
    assert "1 reused from the cache" in output
    assert outcomes(place) == dict.fromkeys(("good.known", "wrong.known"), Outcome.AGREES)
    # A new model runs, and a deleted one is dropped.
    for name in ("wrong.known", "wrong.known.toml"):
        (folder / name).rename(folder / name.replace("wrong", "other"))
    assert "other.known" in watching.until("watching")
    assert outcomes(place) == dict.fromkeys(("good.known", "other.known"), Outcome.AGREES)
    edited(folder / "system.py", "1.3", "1.4")
    output = watching.until("watching")
    assert "changed: models/oscillator/system.py\n" in output
    assert outcomes(place) == dict.fromkeys(("good.known", "other.known"), Outcome.DIFFERS)
    good.write_text("names = [")
    watching.until("watching")
    assert outcomes(place)["good.known"] is Outcome.FAILED
    assert watching.end() == 130


@pytest.mark.slow
def test_file_that_a_system_reads_or_tests_for_is_watched(place: Path) -> None:
    system = place / "models" / "oscillator" / "system.py"
    here = "__import__('pathlib').Path(__file__).parents[2]"
    given = f"float(({here} / 'm.txt').open('r+').read()) + 1.0 * ({here} / 'more').exists()"
    edited(system, "1.3,", f"{given},")
    (place / "m.txt").write_text("1.3")
    for name in ("wrong.known", "wrong.known.toml"):
        (system.parent / name).unlink()
    watching = Watching(place, "models", "-k", "free")
    try:
        watching.until("watching")
        assert outcomes(place)["good.known"] is Outcome.AGREES
        (place / "m.txt").write_text("1.4")
        assert "changed: m.txt\n" in watching.until("watching")
        assert outcomes(place)["good.known"] is Outcome.DIFFERS
        (place / "more").touch()
        assert "changed: more\n" in watching.until("watching")
        assert outcomes(place)["good.known"] is Outcome.DIFFERS
    finally:
        watching.kill()


def test_watch_rejects_json_format(place: Path) -> None:
    done = crosscheck(place, "run", "--watch", "models", "--format", "json")
    assert (done.returncode, done.stdout) == (2, "")
    assert "--watch prints text, not json" in done.stderr


def test_files_of_other_suffixes_are_read_below_folders_and_watched(tmp_path: Path) -> None:
    """Catch a watch that sees only the copy of a source, and a folder whose files are skipped."""
    file = tmp_path / "arm.mjcf"
    file.write_text(
        '<mujoco><include file="part.xml"/><worldbody><body><joint/><geom size=".1"/></body>'
        "</worldbody></mujoco>"
    )
    (tmp_path / "part.xml").write_text("<mujocoinclude/>")
    hung = tmp_path / "hung.urdf"  # no link has the name of its parent
    hung.write_text(
        '<robot name="r"><link name="a"/><joint name="j" type="revolute"><parent link="world"/>'
        '<child link="a"/></joint></robot>'
    )
    copy, completed = targets_under(str(tmp_path), ())
    assert (copy.suffix, completed == hung) == (".xml", False)
    wanted = resolve_targets([str(tmp_path)], standalone=False)
    assert wanted.robots == [copy, completed]
    watched = _watched(wanted, {})
    assert {str(file), str(tmp_path / "part.xml")} <= watched
    assert str(copy) not in watched  # each run writes it


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
