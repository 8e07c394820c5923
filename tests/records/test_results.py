"""results.json: plain JSON, whole or not at all, and checked when read; linearizations in it."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from physics_crosscheck.harness.interfaces.cli.run import exit_code
from physics_crosscheck.harness.numerics.judgement import judge
from physics_crosscheck.harness.records.base import number, numbers, rows
from physics_crosscheck.harness.records.case import Convergence, ForwardDynamics
from physics_crosscheck.harness.records.outcome import contradiction
from physics_crosscheck.harness.records.write import encoded, write_whole
from physics_crosscheck.harness.results.status import status_of
from physics_crosscheck.records import Case, Model, Outcome, Results, ResultsError, read_results
from tests.records.made import case, verdict
from tests.report.samples import model


def some(*cases: Case) -> Results:
    return Results(
        created="now",
        versions={"e": "1.0"},
        resolution=1e-9,
        seconds=0.1,
        systems=(),
        models=(),
        cases=cases,
    )


CASE = Case(system="s", folder="f", model="m", engine="e", scenario="a", outcome=Outcome.FAILED)


def test_nan_and_infinity_never_reach_json() -> None:
    convergence = Convergence(
        rungs=(1,),
        h=numbers([1.0]),
        defect=numbers([float("-inf")]),
        increments=numbers([float("nan"), None]),
    )
    read = json.loads(encoded(convergence), parse_constant=lambda name: pytest.fail(name))
    assert read["defect"] == [None]
    assert read["increments"] == [None, None]
    assert number(float("inf")) is None


def test_numpy_numbers_become_plain_ones() -> None:
    assert type(number(np.float64(1.5))) is float
    assert rows(np.eye(2)) == ((1.0, 0.0), (0.0, 1.0))
    assert type(rows(np.eye(2))[0][0]) is float


def test_written_results_are_read_back(tmp_path: Path) -> None:
    results = some(CASE)
    write_whole(tmp_path / "deep" / "r.json", encoded(results))
    assert read_results(tmp_path / "deep" / "r.json") == results


def test_failed_write_leaves_only_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "r.json"
    write_whole(path, "old")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        write_whole(path, "new")
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["r.json"]


@pytest.mark.parametrize(("text", "sentence"), [
    (None, "can't be read"), ("{", "not JSON"), ("[]", "not a results file of schema 5"),
    ('{"schema": 99}', "not a results file of schema 5"),
])  # fmt: skip
def test_other_file_is_rejected_with_a_remedy(
    tmp_path: Path, text: str | None, sentence: str
) -> None:
    path = tmp_path / "r.json"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ResultsError, match=sentence) as refused:
        read_results(path)
    assert "crosscheck run" in str(refused.value)
    assert str(path) in str(refused.value)


AGREES, DIFFERS, UNRESOLVED = Outcome.AGREES, Outcome.DIFFERS, Outcome.UNRESOLVED

CONTRADICTORY = {
    "agrees, far off": case(AGREES, verdict=verdict(discrepancy=5.2, largest_discrepancy=5.2)),
    "agrees, far off elsewhere": case(AGREES, verdict=verdict(largest_discrepancy=5.2)),
    "agrees, unsure": case(AGREES, verdict=verdict(uncertainty=1e-3, resolution=1e-9)),
    "agrees, unknown": case(AGREES, verdict=verdict(discrepancy=None)),
    "agrees, without an uncertainty": case(AGREES, verdict=verdict(uncertainty=None)),
    "agrees, below zero": case(AGREES, verdict=verdict(discrepancy=-5.2)),
    "agrees, without numbers": case(AGREES, verdict=None),
    "agrees, off its map": case(AGREES, verdict=verdict(map_residual=0.1, map_uncertainty=1e-9)),
    "agrees, its accelerations differ": case(
        AGREES, forward_dynamics=ForwardDynamics(
            outcome=DIFFERS, discrepancy=0.1, uncertainty=1e-9, component="x_ddot", states=3,
            terms=())),
    "differs, by nothing": case(DIFFERS),
    "differs, below its resolution": case(
        DIFFERS, verdict=verdict(discrepancy=1e-8, uncertainty=1e-12, resolution=1e-7)),
    "unresolved, and it differs": case(
        UNRESOLVED, verdict=verdict(discrepancy=5.2, uncertainty=0.1, resolution=1e-9)),
}  # fmt: skip


@pytest.mark.parametrize("name", CONTRADICTORY)
def test_contradictory_case_is_rejected_with_its_place(tmp_path: Path, name: str) -> None:
    path = tmp_path / "r.json"
    write_whole(path, encoded(some(case(), CONTRADICTORY[name])))
    with pytest.raises(ResultsError) as refused:
        read_results(path)
    message = str(refused.value)
    assert message.startswith(f"{path}: `$.cases[1]`, disc/mujoco.xml/free [mujoco]: ")
    assert "contradicts" in message or "without the numbers of a verdict" in message
    assert message.endswith("run `crosscheck run` again")


@pytest.mark.parametrize("sound", [
    case(AGREES),
    case(AGREES, verdict=verdict(discrepancy=3e-10, uncertainty=1e-12)),  # below the resolution
    # An engine with few digits: with its resolution, and an older record without it.
    case(AGREES, verdict=verdict(
        discrepancy=9e-7, uncertainty=2e-7, largest_discrepancy=9e-7, largest_uncertainty=5e-7,
        resolution=1.5e-6)),
    case(AGREES, verdict=verdict(
        discrepancy=9e-7, uncertainty=2e-7, largest_discrepancy=9e-7, largest_uncertainty=5e-7)),
    case(DIFFERS, verdict=verdict(discrepancy=0.01, largest_discrepancy=0.01)),
    case(UNRESOLVED, verdict=verdict(uncertainty=None, largest_uncertainty=None)),
    case(UNRESOLVED),  # because of its full run
    case(Outcome.FAILED), case(Outcome.FAILED, verdict=verdict(discrepancy=5.2)),
    case(Outcome.ABSENT),
])  # fmt: skip
def test_consistent_case_is_read(tmp_path: Path, sound: Case) -> None:
    path = tmp_path / "r.json"
    write_whole(path, encoded(some(sound)))
    assert read_results(path).cases == (sound,)


@pytest.mark.parametrize("seed", range(20))
def test_judgements_are_consistent(seed: int) -> None:
    """Compare the rule for files with the judge's, for any number of digits."""
    random = np.random.default_rng(seed)
    for _ in range(200):
        e, u = 10 ** random.uniform(-14, -4, (2, 5, 4))
        u[random.random(u.shape) < 0.02] = np.inf
        resolution = 10 ** random.uniform(-10, -5)
        judgement = judge(e, u, resolution, None)
        numbers_ = number(judgement.discrepancy), number(judgement.uncertainty)
        assert contradiction(judgement.outcome, *numbers_, resolution) == ""
        others = {AGREES, DIFFERS, UNRESOLVED} - {judgement.outcome, UNRESOLVED}
        assert all(contradiction(other, *numbers_, resolution) for other in others)


def with_misfit(differs: bool) -> Model:
    sound = model("oscillator", "arm.xml", "mujoco", 1)
    (linearization,) = sound.linearizations
    return replace(sound, linearizations=(replace(linearization, a_error=13.0, differs=differs),))


def test_wrong_linearization_fails_test_and_run() -> None:
    wrong, sound = with_misfit(True), with_misfit(False)
    assert sound.passes
    assert not wrong.passes
    assert [finding.kind for finding in wrong.findings] == ["linearization"]
    assert "equations' in A by 1.3e+01 of its largest entry" in wrong.findings[0].message
    assert status_of(wrong, require_engines=True).status == "fail"
    for checked, code in ((wrong, 1), (sound, 0)):
        results = Results(
            created="now", versions={}, resolution=1e-9, seconds=0.0, systems=(), models=(checked,),
            cases=(case(),), baseline=None,
        )  # fmt: skip
        assert exit_code(results, require_engines=False) == code
