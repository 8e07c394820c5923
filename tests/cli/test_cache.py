"""Reuse of cached results, and the changes that make cases run again."""

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
from physics_crosscheck.harness.records.case import ModelKey
from physics_crosscheck.harness.run import Options
from physics_crosscheck.harness.run import run as run_all
from physics_crosscheck.records import Outcome, Results, read_results
from tests.faults.known_folder import KNOWN_ANSWER, known_folder
from tests.models import edited, written
from tests.mutation.test_trees import MODEL, SYSTEM
from tests.robots.files import joint, link
from tests.standing import without
from tests.sweep.made import swept_folder


def write_models(place: Path) -> Path:
    """Write two models of the known-answer engine: one is right, one is wrong."""
    folder = known_folder(place / "osc", {"good": "", "wrong": ""})
    edited(folder / "wrong.known", "47.0", "47.5")
    return folder


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Create a folder with one right model and one scenario; nothing ran in it yet."""
    monkeypatch.syspath_prepend(KNOWN_ANSWER)
    monkeypatch.chdir(tmp_path)
    folder = known_folder(tmp_path / "osc", {"good": ""})
    without(folder, "driven")
    return folder


@pytest.fixture(scope="module")
def ran_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run two models once in a place that no test changes."""
    place = tmp_path_factory.mktemp("ran")
    write_models(place)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(KNOWN_ANSWER)
        patch.chdir(place)
        run()
    return place


@pytest.fixture
def ran(ran_once: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Copy the folder of that run and its cache to another place."""
    monkeypatch.syspath_prepend(KNOWN_ANSWER)
    monkeypatch.chdir(tmp_path)
    shutil.copytree(ran_once, tmp_path, dirs_exist_ok=True)
    return tmp_path / "osc"


@pytest.fixture
def submitted(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    submit = Workers.submit
    functions: list[object] = []

    def counted(workers: Workers, function: object, argument: object, **more: bool) -> object:
        functions.append(function)
        return submit(workers, function, argument, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(Workers, "submit", counted)
    return functions


def first() -> Results:
    return read_results(Path("out/results.json"))


def run(*more: str, target: str = "osc") -> Results:
    main(["run", target, "--cache", "cache", "--out", "out", "--jobs", "1", *more])
    return read_results(Path("out/results.json"))


def cases_run(results: Results) -> int:
    return len(results.cases) - results.cached


@pytest.mark.usefixtures("ran")
def test_unchanged_cases_are_neither_run_nor_derived(
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
    # Everything is reused: diagnosis, linearizations, coverage and derivation.
    assert second.cases == before.cases
    assert second.models == before.models
    assert second.systems == before.systems
    assert {case.outcome for case in second.cases} == {Outcome.AGREES, Outcome.DIFFERS}
    assert any(model.diagnosis for model in second.models)


def test_workers_start_before_the_first_task_only_without_a_cache(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    starts: list[str] = []
    monkeypatch.setattr(Workers, "begin", lambda workers: starts.append("a run or an audit"))
    for cache in (None, caches.Cache(tmp_path / "kept")):
        run_all([], Options(cache=cache), lambda *_: None)
        audits([], Options(cache=cache))
    assert len(starts) == 2


def audited(capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    """Return the exit code and the output of an audit with that cache."""
    capsys.readouterr()
    code = main(["audit", "osc", "--cache", "cache", "--jobs", "1"])
    return code, capsys.readouterr().out


def test_audit_reuses_results_of_a_run_and_repeats_changed_models(
    ran: Path, submitted: list[object], capsys: pytest.CaptureFixture[str]
) -> None:
    code, output = audited(capsys)
    assert (code, submitted) == (1, [])
    assert "47.5" in output.split("oscillator/wrong.known")[1]
    assert "47.5" not in output.split("oscillator/wrong.known")[0]
    edited(ran / "wrong.known", "47.5", "47.0")
    code, output = audited(capsys)
    assert (code, len(submitted)) == (0, 2)  # the folder's physics, and that model
    assert "47.5" not in output
    assert audited(capsys) == (code, output)
    assert len(submitted) == 2  # an audit stores its results
    # A run stored all that a report shows, which an audit does not need.
    assert run().systems == first().systems


def test_comparison_with_a_baseline_is_cached(folder: Path, submitted: list[object]) -> None:
    assert main(["accept", "--folder", "osc", "--reason", "a test"]) == 0
    before = run()
    assert before.baseline is not None
    submitted.clear()
    second = run()
    assert (submitted, second.cached, second.baseline) == ([], 1, before.baseline)
    edited(folder / "good.known", "step = 0.005", "step = 0.01")
    third = run()
    assert (third.cached, third.baseline == before.baseline) == (0, False)


def test_only_the_changed_model_is_run(ran: Path) -> None:
    edited(ran / "wrong.known", "47.5", "47.0")
    results = run()
    assert cases_run(results) == 2
    assert {case.outcome for case in results.cases} == {Outcome.AGREES}
    assert cases_run(run("--resolution", "1e-8", "-k", "good and free")) == 1


def test_changed_system_runs_all_models(ran: Path) -> None:
    edited(ran / "system.py", '"k", 47.0', '"k", 47.5')
    results = run("-k", "free")
    assert cases_run(results) == 2
    assert [c.outcome for c in results.cases if c.model == "wrong.known"] == [Outcome.AGREES]


def test_folder_whose_code_reads_elsewhere_always_runs_again(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "k.txt").write_text("47.0")
    system = folder / "system.py"
    given = 'float((HERE / "k.txt").open("r+").read())'  # opened to be written as well
    text = system.read_text().replace('"k", 47.0', f'"k", {given}')
    system.write_text(f"from pathlib import Path\nHERE = Path(__file__).parent.parent\n{text}")
    for _ in range(2):
        assert cases_run(run()) == 1
        line = "crosscheck: osc: always runs again, because its code uses ../k.txt\n"
        assert line in capsys.readouterr().err
    (tmp_path / "k.txt").write_text("47.5")
    (case,) = run().cases
    assert case.outcome is Outcome.DIFFERS


def test_files_that_a_python_model_reads_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("pymunk")
    monkeypatch.chdir(tmp_path)
    folder = swept_folder(tmp_path / "mass", "space.py")
    for name in ("note.txt", "mass/.note"):
        (tmp_path / name).write_text("one")
    space, text = folder / "space.py", (folder / "space.py").read_text()
    code = "\nfrom pathlib import Path\n\n_ = (Path(__file__).parent / {!r}).read_text()\n"
    space.write_text(text + code.format(".note"))
    before = run(target="mass")
    assert cases_run(run(target="mass")) == 0
    (folder / ".note").write_text("two")
    assert cases_run(run(target="mass")) == len(before.cases)
    capsys.readouterr()
    space.write_text(text + code.format("../note.txt"))
    for _ in range(2):
        assert cases_run(run(target="mass")) == len(before.cases)
        assert "mass: always runs again, because its code uses ../note.txt" in (
            capsys.readouterr().err
        )


def test_declared_bodies_are_cached(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    arm = tmp_path / "arm"
    arm.mkdir()
    (arm / "system.py").write_text(SYSTEM)
    (arm / "m.xml").write_text(MODEL)
    (arm / "m.xml.toml").write_text('engines = ["mujoco"]\n\n[settings]\nsmooth = true\n')
    before = run(target="arm")
    assert before.cached == 0
    second = run(target="arm")
    assert cases_run(second) == 0
    assert second.cases == before.cases
    assert second.models == before.models


ARM = "\n".join((
    '<robot name="arm">', link("base"), link("fore"),
    joint("elbow", "base", "fore", '<axis xyz="0 1 0"/><dynamics damping="0.1"/>'), "</robot>",
))  # fmt: skip


def test_robot_files_are_cached(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    file = written(tmp_path, "arm.urdf", ARM)
    before = run("--engine", "mujoco", target="arm.urdf")
    assert (before.cached, [case.outcome for case in before.cases]) == (0, [Outcome.AGREES])
    with monkeypatch.context() as patched:
        patched.setattr(Workers, "submit", None)
        second = run("--engine", "mujoco", target="arm.urdf")
    assert (second.cached, second.cases, second.models) == (1, before.cases, before.models)
    file.write_text(ARM.replace('damping="0.1"', 'damping="0.2"'))
    assert run("--engine", "mujoco", target="arm.urdf").cached == 0
    file.write_text(ARM)
    assert run("--engine", "mujoco", "--floating", target="arm.urdf").cached == 0


def test_failed_case_runs_again(folder: Path) -> None:
    known_folder(folder, {"wrong": "names = ["})
    without(folder, "driven")
    before = run()
    assert {c.outcome for c in before.cases if c.model == "wrong.known"} == {Outcome.FAILED}
    results = run()
    assert results.cached == 1
    assert {c.outcome for c in results.cases if c.model == "wrong.known"} == {Outcome.FAILED}


def kind(entry: Path) -> str:
    return str(json.loads(entry.read_bytes())["key"]["kind"])


@pytest.mark.usefixtures("ran")
def test_broken_old_contradictory_and_foreign_entries_are_ignored(
    capsys: pytest.CaptureFixture[str],
) -> None:
    before = first()
    entries = sorted(Path("cache").glob("??/*.json"), key=kind)
    broken, other, contradictory, old = (path for path in entries if kind(path) == "case")
    # An entry must contain its key, whatever the name of its file.
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
    results = run()
    assert results.cached == 0
    assert "from the cache" not in capsys.readouterr().out
    assert [case.verdict for case in results.cases] == [case.verdict for case in before.cases]
    assert Path("cache/.gitignore").read_text() == "*\n"


def test_source_of_an_adapter_counts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: Path
) -> None:
    place = tmp_path / "engine"
    shutil.copytree(KNOWN_ANSWER, place)
    monkeypatch.setattr(caches, "_engine_file", lambda _: place / "known_answer.py")
    caches._adapter.cache_clear()

    def hashes() -> dict[ModelKey, str]:
        entries = model_hashes(folder, 1e-9, None)
        return {key: with_environment(one, key[-1], 0.0, False) for key, one in entries.items()}

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


def test_unwritable_cache_is_reported_and_the_run_continues(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("cache").write_text("a file")
    results = run()
    assert len(results.cases) == 1
    assert "nothing more is kept in the cache: cache" in capsys.readouterr().err


def test_folder_that_no_longer_prepares_is_one_failure(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Cache the facts and change a model, so that a run needs equations that fail."""
    known_folder(folder, {"other": ""})
    without(folder, "driven")
    system = folder / "system.py"
    # The environment is not observed, so that the cache does not notice.
    broken = "import os\n\nif 'IS_BROKEN' in os.environ:\n    raise ValueError\n"
    system.write_text(broken + system.read_text())
    run()
    with (folder / "good.known").open("a") as file:
        file.write("\n# another\n")
    monkeypatch.setenv("IS_BROKEN", "1")
    results = run()
    assert results.cached == 1
    assert [(c.model, c.outcome) for c in results.failed] == [("system.py", Outcome.FAILED)]
    assert results.not_run == ()
