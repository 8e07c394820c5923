"""What was found before, and what makes it be found anew."""

from __future__ import annotations

import json
import os
import shutil
from itertools import cycle
from pathlib import Path

import pytest

from physics_crosscheck.harness.audits import audits
from physics_crosscheck.harness.baseline.fingerprint import model_hashes
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.jobs.workers import Workers
from physics_crosscheck.harness.planning import cache as caches
from physics_crosscheck.harness.planning.cache import with_environment
from physics_crosscheck.harness.planning.options import Options
from physics_crosscheck.harness.records.case import ModelKey
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.read import read_results
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.run import run as run_all
from tests.faults.known_folder import KNOWN_ANSWER, known_folder
from tests.mutation.test_trees import MODEL, SYSTEM
from tests.robots.files import joint, link
from tests.standing import without
from tests.sweep.made import swept_folder


def made(place: Path) -> Path:
    """Two models of the known-answer engine: one is right, one is not."""
    folder = known_folder(place / "osc", {"good": "", "wrong": ""})
    wrong = folder / "wrong.known"
    wrong.write_text(wrong.read_text().replace("47.0", "47.5"))
    return folder


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of one right model and one scenario, in which nothing was run yet."""
    monkeypatch.syspath_prepend(KNOWN_ANSWER)
    monkeypatch.chdir(tmp_path)
    folder = known_folder(tmp_path / "osc", {"good": ""})
    without(folder, "driven")
    return folder


@pytest.fixture(scope="module")
def ran_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A place where such a folder was run; nobody changes this one."""
    place = tmp_path_factory.mktemp("ran")
    made(place)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(KNOWN_ANSWER)
        patch.chdir(place)
        run()
    return place


@pytest.fixture
def ran(ran_once: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that was run, with the cache of that beside it, elsewhere by now."""
    monkeypatch.syspath_prepend(KNOWN_ANSWER)
    monkeypatch.chdir(tmp_path)
    shutil.copytree(ran_once, tmp_path, dirs_exist_ok=True)
    return tmp_path / "osc"


@pytest.fixture
def submitted(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """The functions that workers get from now on."""
    submit = Workers.submit
    found: list[object] = []

    def counted(workers: Workers, function: object, argument: object, **more: bool) -> object:
        found.append(function)
        return submit(workers, function, argument, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(Workers, "submit", counted)
    return found


def first() -> Results:
    """What that run found."""
    return read_results(Path("out/results.json"))


def run(*more: str, of: str = "osc") -> Results:
    main(["run", of, "--cache", "cache", "--out", "out", "--jobs", "1", *more])
    return read_results(Path("out/results.json"))


def done_again(found: Results) -> int:
    return len(found.cases) - found.cached


@pytest.mark.usefixtures("ran")
def test_what_is_known_is_not_run_again_nor_derived(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    before = first()
    assert before.cached == 0

    def refused(*_: object, **__: object) -> None:
        raise AssertionError("something is run")

    monkeypatch.setattr(Workers, "submit", refused)
    monkeypatch.setattr(Workers, "begin", refused)
    second = run()
    assert ", 4 reused from the cache" in capsys.readouterr().out
    assert second.cached == 4
    # All of it: the diagnosis of the one that differs, linearizations, coverage, the derivation.
    assert second.cases == before.cases
    assert second.models == before.models
    assert second.systems == before.systems
    assert {case.outcome for case in second.cases} == {Outcome.AGREES, Outcome.DIFFERS}
    assert any(model.diagnosis for model in second.models)


def test_only_where_nothing_may_be_known_workers_are_begun_before_there_is_a_task(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[str] = []
    monkeypatch.setattr(Workers, "begin", lambda workers: begun.append("a run or an audit"))
    for cache in (None, caches.Cache(tmp_path / "kept")):
        run_all([], Options(cache=cache), lambda *_: None)
        audits([], cache=cache)
    assert len(begun) == 2


def audited(capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    """Exit code and lines of an audit with that cache."""
    capsys.readouterr()
    code = main(["audit", "osc", "--cache", "cache", "--jobs", "1"])
    return code, capsys.readouterr().out


def test_an_audit_has_what_a_run_found_and_finds_what_has_changed(
    ran: Path, submitted: list[object], capsys: pytest.CaptureFixture[str]
) -> None:
    code, told = audited(capsys)
    assert (code, submitted) == (1, [])
    assert "47.5" in told.split("oscillator/wrong.known")[1]
    assert "47.5" not in told.split("oscillator/wrong.known")[0]
    wrong = ran / "wrong.known"
    wrong.write_text(wrong.read_text().replace("47.5", "47.0"))
    code, told = audited(capsys)
    assert (code, len(submitted)) == (0, 2)  # the folder's physics, and that model
    assert "47.5" not in told
    assert audited(capsys) == (code, told)
    assert len(submitted) == 2  # an audit keeps what it found
    # Of a run it has all that a report shows, which an audit did not ask for.
    assert run().systems == first().systems


def test_what_is_measured_beside_a_baseline_is_known_too(
    folder: Path, submitted: list[object]
) -> None:
    assert main(["accept", "--folder", "osc", "--reason", "a test"]) == 0
    before = run()
    assert before.baseline is not None
    submitted.clear()
    second = run()
    assert (submitted, second.cached, second.baseline) == ([], 1, before.baseline)
    good = folder / "good.known"
    good.write_text(good.read_text().replace("step = 0.005", "step = 0.01"))
    third = run()
    assert (third.cached, third.baseline == before.baseline) == (0, False)


def test_a_changed_model_alone_is_run(ran: Path) -> None:
    wrong = ran / "wrong.known"
    wrong.write_text(wrong.read_text().replace("47.5", "47.0"))
    found = run()
    assert done_again(found) == 2
    assert {case.outcome for case in found.cases} == {Outcome.AGREES}
    assert done_again(run("--resolution", "1e-8", "-k", "good and free")) == 1


def test_a_changed_system_runs_all(ran: Path) -> None:
    system = ran / "system.py"
    system.write_text(system.read_text().replace('"k", 47.0', '"k", 47.5'))
    found = run("-k", "free")
    assert done_again(found) == 2
    assert [c.outcome for c in found.cases if c.model == "wrong.known"] == [Outcome.AGREES]


def test_what_system_py_reads_or_looks_for_elsewhere_counts(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "k.txt").write_text("47.0")
    system = folder / "system.py"
    name = '"own.txt" if (HERE / "own.txt").exists() else "k.txt"'
    given = f'float((HERE / ({name})).open("r+").read())'  # opened to be written as well
    text = system.read_text().replace('"k", 47.0', f'"k", {given}')
    system.write_text(f"from pathlib import Path\nHERE = Path(__file__).parent.parent\n{text}")
    run()
    assert done_again(run()) == 0
    (tmp_path / "k.txt").write_text("47.5")
    (case,) = run().cases
    assert case.outcome is Outcome.DIFFERS
    (tmp_path / "own.txt").write_text("47.0")
    (case,) = run().cases
    assert case.outcome is Outcome.AGREES


def test_so_does_what_a_model_that_is_code_reads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("pymunk")
    monkeypatch.chdir(tmp_path)
    folder = swept_folder(tmp_path / "mass", "space.py")
    (tmp_path / "note.txt").write_text("one")
    space = folder / "space.py"
    reads = 'Path(__file__).resolve().parents[1].joinpath("note.txt").read_text()'
    space.write_text(f"{space.read_text()}\nfrom pathlib import Path\n\n_ = {reads}\n")
    before = run(of="mass")
    assert done_again(run(of="mass")) == 0
    (tmp_path / "note.txt").write_text("two")
    assert done_again(run(of="mass")) == len(before.cases)


def test_of_declared_bodies_likewise(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    pytest.importorskip("mujoco")
    arm = tmp_path / "arm"
    arm.mkdir()
    (arm / "system.py").write_text(SYSTEM)
    (arm / "m.xml").write_text(MODEL)
    (arm / "m.xml.toml").write_text('engines = ["mujoco"]\n\n[settings]\nsmooth = true\n')
    before = run(of="arm")
    assert before.cached == 0
    second = run(of="arm")
    assert done_again(second) == 0
    assert second.cases == before.cases
    assert second.models == before.models


ARM = "\n".join((
    '<robot name="arm">', link("base"), link("fore"),
    joint("elbow", "base", "fore", '<axis xyz="0 1 0"/><dynamics damping="0.1"/>'), "</robot>",
))  # fmt: skip


def test_of_a_robot_s_file_likewise(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "arm.urdf"
    file.write_text(ARM)
    before = run("--engine", "mujoco", of="arm.urdf")
    assert (before.cached, [case.outcome for case in before.cases]) == (0, [Outcome.AGREES])
    with monkeypatch.context() as patched:
        patched.setattr(Workers, "submit", None)
        second = run("--engine", "mujoco", of="arm.urdf")
    assert (second.cached, second.cases, second.models) == (1, before.cases, before.models)
    file.write_text(ARM.replace('damping="0.1"', 'damping="0.2"'))
    assert run("--engine", "mujoco", of="arm.urdf").cached == 0
    file.write_text(ARM)
    assert run("--engine", "mujoco", "--floating", of="arm.urdf").cached == 0


def test_what_failed_is_tried_again(folder: Path) -> None:
    known_folder(folder, {"wrong": "names = ["})
    without(folder, "driven")
    before = run()
    assert {c.outcome for c in before.cases if c.model == "wrong.known"} == {Outcome.FAILED}
    found = run()
    assert found.cached == 1
    assert {c.outcome for c in found.cases if c.model == "wrong.known"} == {Outcome.FAILED}


def kind(entry: Path) -> str:
    """Of what work it is."""
    return str(json.loads(entry.read_bytes())["key"]["kind"])


@pytest.mark.usefixtures("ran")
def test_entries_that_are_broken_old_contradictory_or_of_other_work_are_not_taken(
    capsys: pytest.CaptureFixture[str],
) -> None:
    before = first()
    entries = sorted(Path("cache").glob("??/*.json"), key=kind)
    broken, other, contradictory, old = (path for path in entries if kind(path) == "case")
    # Whatever its name says, an entry has to be of the very key.
    other.write_bytes(broken.read_bytes())
    entry = json.loads(contradictory.read_bytes())
    entry["value"]["outcome"] = "AGREES"
    entry["value"]["verdict"]["discrepancy"] = 5.2
    contradictory.write_text(json.dumps(entry))
    for path in (old, Path("cache/pruned")):
        os.utime(path, (0, 0))
    damaged = [broken, *(path for path in entries if kind(path) != "case")]
    for path, content in zip(damaged, cycle([b"", b"{", b'{"key": 1}', b"\xff\xfe"]), strict=False):
        path.write_bytes(content)
    found = run()
    assert found.cached == 0
    assert "from the cache" not in capsys.readouterr().out
    assert [case.verdict for case in found.cases] == [case.verdict for case in before.cases]
    assert Path("cache/.gitignore").read_text() == "*\n"


def test_the_source_of_an_adapter_counts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: Path
) -> None:
    place = tmp_path / "engine"
    shutil.copytree(KNOWN_ANSWER, place)
    monkeypatch.setattr(caches, "_engine_file", lambda _: place / "known_answer.py")
    caches._adapter.cache_clear()

    def hashes() -> dict[ModelKey, str]:
        found = model_hashes(folder, 1e-9, None)
        return {key: with_environment(one, key[-1], 0.0, False) for key, one in found.items()}

    before = hashes()
    caches._adapter.cache_clear()
    assert hashes() == before
    with (place / "known_answer.py").open("a") as file:
        file.write("\n# another\n")
    caches._adapter.cache_clear()
    after = hashes()
    caches._adapter.cache_clear()
    assert before.keys() == after.keys()
    assert all(before[key] != after[key] for key in before)


def test_where_nothing_can_be_kept_it_is_told_and_the_run_goes_on(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("cache").write_text("a file")
    found = run()
    assert len(found.cases) == 1
    assert "nothing more is kept in the cache: cache" in capsys.readouterr().err


def test_a_folder_that_no_longer_prepares_is_one_failure(folder: Path, tmp_path: Path) -> None:
    """Its facts are known, a model is to be run, and then the equations can't be had."""
    known_folder(folder, {"other": ""})
    without(folder, "driven")
    system = folder / "system.py"
    # Another process looks, which is not seen.
    look = f'not subprocess.call(["test", "-e", "{tmp_path / "broken"}"])'
    broken = f"import subprocess\n\nif {look}:\n    raise ValueError\n"
    system.write_text(broken + system.read_text())
    run()
    good = folder / "good.known"
    good.write_text(good.read_text() + "\n# another\n")
    (tmp_path / "broken").touch()
    found = run()
    assert found.cached == 1
    assert [(c.model, c.outcome) for c in found.failed] == [("system.py", Outcome.FAILED)]
    assert found.not_run == ()
