"""One case against what was accepted of it: numbers alone."""

import copy
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from harness.baseline.changes import Now, Status, compare
from harness.baseline.fingerprint import folder_files
from harness.baseline.snapshot import inputs_of, snapshot_from, snapshot_key, track
from harness.baseline.stale import location
from harness.baseline.store import read_baseline
from harness.cases.prepare import prepare
from harness.files.folders import system_folders
from harness.numerics.version import VERSION
from tests.gate.conftest import SYSTEM

KEY = "space.py/free [pymunk]"
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def ran(pristine):
    """A case that was run again as it was accepted, with its entry and track."""
    found = pristine.gate("pymunk", every=True)
    change = next(c for c in found.changes if c.key == KEY)
    one = found.baseline[SYSTEM]
    return change, one.cases[KEY], one.tracks[one.cases[KEY]["track"]]


@pytest.fixture
def told(ran):
    """A function from changes of the record, the entry and the terms to what is told."""
    change, entry, track_record = ran

    def tell(move=0.0, engine=None, numerics=VERSION, files=None, entry_with=(), **fields):
        record = copy.deepcopy(change.record) | fields
        for row in record["measured"]["then"]["end"]:
            row[0] += move * track_record["scale"][0]
        now = Now(record, files or change.files, engine or change.engine, 1e-9, numerics)
        return compare(SYSTEM, KEY, entry | dict(entry_with), track_record, now)

    return tell


def test_a_case_that_was_run_again_is_as_accepted(told):
    change = told()
    assert (change.status, change.kinds, change.told) == (Status.SAME, (), ())


def test_another_machines_rounding_is_no_change(told):
    assert told(move=1e-14).status is Status.SAME


def test_a_motion_that_moved_though_nothing_changed_is_told_as_unexplained(told):
    change = told(move=1e-9)
    assert (change.status, change.kinds) == (Status.CHANGED, ("unexplained",))


def test_a_motion_that_moved_with_the_engine_alone_is_the_engines(told):
    change = told(move=1e-6, engine="pymunk 99.0")
    assert (change.status, change.kinds) == (Status.CHANGED, ("engine",))
    assert change.size == pytest.approx(1e-6, rel=1e-3)


def test_a_motion_that_moved_with_files_and_engine_may_be_eithers(told):
    change = told(move=1e-6, engine="pymunk 99.0", files={"space.py": "other"})
    assert change.kinds == ("model", "engine")


def test_a_new_version_of_the_tools_numerics_is_told_and_passes_where_nothing_moved(told):
    change = told(numerics=VERSION + 1)
    assert (change.status, change.kinds) == (Status.WITHIN, ("tool",))
    assert told(numerics=VERSION + 1, move=1e-6).kinds == ("tool",)


def test_a_limit_that_is_not_known_is_not_compared(told, ran):
    unknown = [[None, None]] * len(ran[1]["end"])
    change = told(move=1.0, entry_with={"end_uncertainty": unknown}.items())
    assert change.size == 0.0


@pytest.mark.parametrize(("raw_error", "status"), [
    (1.0005, Status.SAME), (1.05, Status.CHANGED), (0.9, Status.IMPROVED),
])  # fmt: skip
def test_a_raw_error_counts_beyond_a_hundredth_of_itself(told, ran, raw_error, status):
    assert told(raw_error=raw_error * ran[1]["raw_error"]).status is status


def test_a_raw_error_that_is_large_is_known_to_its_own_share(told):
    large = {"raw_error": 0.9}.items()
    assert told(entry_with=large, raw_error=1.5).status is Status.SAME
    assert told(entry_with=large, raw_error=2.0).status is Status.CHANGED
    assert told(raw_error=None).status is Status.CHANGED


def test_a_known_differences_size_counts(told):
    was = {"outcome": "DIFFERS", "discrepancy": 1e-3}.items()
    same = told(outcome="DIFFERS", discrepancy=1e-3 + 1e-14, entry_with=was)
    assert same.status is Status.KNOWN
    other = told(outcome="DIFFERS", discrepancy=1.1e-3, entry_with=was)
    assert other.status is Status.CHANGED


def test_a_lost_digit_is_told(told):
    change = told(outcome="UNRESOLVED", uncertainty=1e-6)
    assert change.status is Status.CHANGED
    assert change.told[0] == "UNRESOLVED where it was AGREES"


def test_another_version_of_the_numerics_runs_everything_again(repository, monkeypatch):
    for module in ("harness.baseline.classify", "harness.baseline.stale"):
        monkeypatch.setattr(f"{module}.VERSION", VERSION + 1)
    found = repository.gate("pymunk")
    assert {c.status for c in found.changes} == {Status.WITHIN}
    assert all(c.record is not None for c in found.changes)


def test_a_track_gives_back_its_scenario_to_rounding():
    folder = next(f for f in system_folders([]) if f.name == "drum_pendulum")
    prepared = prepare(folder, described=False)
    motion = prepared.motions["driven"]
    one = track(prepared.system, "driven", motion, prepared.scales["driven"], prepared.components)
    again = snapshot_from(json.loads(json.dumps(one.record())))
    assert again.same_as(one)
    assert snapshot_key(again.record()) == snapshot_key(one.record())
    every = np.ones(len(one.t), dtype=bool)
    times = one.t[:, None] + one.length[:, None] * np.linspace(0.0, 0.999, 50)
    u = inputs_of(again, every, 1)(times.ravel())
    assert np.max(np.abs(u - motion.inputs(times.ravel()))) < 1e-12
    # Segments of every span, the short one before the step of force included.
    assert min(one.t) < 1 < max(one.t)


def test_the_committed_baseline_is_of_the_models_as_they_are():
    place = ROOT / "reports" / "baseline"
    baseline = read_baseline(place)
    folders = system_folders([])
    assert set(baseline) == {folder.name for folder in folders}
    for folder in folders:
        one, scan = baseline[folder.name], folder_files(folder)
        assert one.folder == location(folder, place)
        wanted = {
            f"{model.model}/{scenario} [{engine}]": model.hashes
            for model in scan.models
            for engine in model.engines
            for scenario in one.scenarios
        }
        assert {key: entry["files"] for key, entry in one.cases.items()} == wanted
        assert {entry["outcome"] for entry in one.cases.values()} == {"AGREES"}


def test_an_unchanged_repository_passes_without_sympy_or_an_engine(pristine):
    code = (
        "import sys; from harness.cli.main import main;"
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
        timeout=120,
        check=False,
    )
    assert done.stdout.splitlines()[-1] == "0", done.stdout + done.stderr
