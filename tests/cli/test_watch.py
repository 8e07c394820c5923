"""`run --watch` runs a saved file again and keeps the other results."""

import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from queue import Queue

import pytest

from physics_crosscheck.harness.interfaces.cli.run import _watched
from physics_crosscheck.harness.interfaces.cli.targets import resolve_targets
from physics_crosscheck.harness.interfaces.pytest_plugin.session import targets_under
from physics_crosscheck.records import Outcome, read_results
from tests.cli.test_choosing import crosscheck, place
from tests.faults.known_folder import environment
from tests.models import edited

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
    (copy,) = targets_under(str(tmp_path), ())
    assert copy.suffix == ".xml"
    wanted = resolve_targets([str(tmp_path)], standalone=False)
    assert wanted.robots == [copy]
    watched = _watched(wanted, {})
    assert {str(file), str(tmp_path / "part.xml")} <= watched
    assert str(copy) not in watched  # each run writes it
