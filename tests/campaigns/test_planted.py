"""Campaigns: faults planted into files, records, and motions with events."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from campaigns.events import (
    EVENTS,
    PEER_TESTS,
    RESOLUTION,
    Tally,
    compare,
    drawn,
    judged,
    peer_row,
    planted_edits,
)
from campaigns.planted import __main__ as command
from campaigns.planted.compared import judge_by_compare
from campaigns.planted.fates import FaultBaseline, FaultFate, judge_by_equations, table
from campaigns.records import PLACE, commands, diff_lines, main, read_store
from physics_crosscheck.harness.checks.prepare import prepare_system
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.commands.mutation.mistakes import Edit
from physics_crosscheck.harness.diagnosis.task import diagnose_model
from physics_crosscheck.harness.modelfiles.bindings import at_constants
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.reference.load import load_system
from tests.models import written
from tests.robots.files import joint, link

TEXT = "\n".join(
    [
        '<robot name="written">',
        link("base", ""),
        joint("a", "base", "one", '<origin xyz="0 0 0.25"/><axis xyz="0 1 0"/>'),
        link("one"),
        joint("b", "one", "two", '<origin xyz="0 0 -1"/><dynamics damping="0.5"/>'),
        link("two"),
        "</robot>",
    ]
)


def test_visible_faults_are_named_and_invisible_ones_are_classified(tmp_path: Path) -> None:
    file = written(tmp_path, "r.urdf", TEXT)
    ground = FaultBaseline.from_file(file, "mujoco")
    where = {ground.numbers.numerals[i].address: i for i in ground.numbers.relevant_numbers}
    chosen = {
        ("joint[a]/origin@xyz[2]", 1e-2): FaultFate.INVISIBLE,
        ("link[two]/inertial/mass@value", 1e-6): FaultFate.NAMED,
        ("joint[b]/dynamics@damping", 1e-2): FaultFate.NAMED,
    }
    faults = [judge_by_equations(ground, where[address], by) for address, by in chosen]
    assert [fault.fate for fault in faults] == [*chosen.values()]
    assert file.read_text() == TEXT
    assert "of 2 visible faults, 2 are caught and named, 100.0%" in table(faults)


def test_recorded_faults_are_not_repeated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    file, record = tmp_path / "r.urdf", tmp_path / "record.jsonl"
    file.write_text(TEXT)
    arguments = [str(file), "--engine", "mujoco", "--seconds", "0", "--record", str(record)]
    assert command.main(arguments) == 0
    first = capsys.readouterr().out
    assert "are caught and named" in first
    assert len(record.read_text().splitlines()) == 2
    monkeypatch.setattr(command, "judge_by_equations", None)
    assert command.main(arguments) == 0
    assert capsys.readouterr().out == first
    with pytest.raises(TypeError):
        command.main([*arguments, "--set", "exact_frames"])  # a different run, without a record


@pytest.mark.slow
def test_comparison_with_the_original_names_the_line(tmp_path: Path) -> None:
    file = written(tmp_path, "r.urdf", TEXT)
    ground = FaultBaseline.from_file(file, "mujoco", use_equations=False)
    (index,) = (
        i
        for i in ground.numbers.relevant_numbers
        if ground.numbers.numerals[i].address == "joint[b]/dynamics@damping"
    )
    fault = judge_by_compare(ground, index, 1e-2)
    assert fault.fate is FaultFate.NAMED
    assert f"line {fault.line} explains 100.00%" in fault.explanation


def test_numbers_are_spread_over_the_file() -> None:
    assert command.spread_indices(5) == [0, 4, 2, 1, 3]
    assert sorted(command.spread_indices(37)) == list(range(37))


def store(folder: Path, record: dict[str, Any], rows: list[dict[str, Any]] | None = None) -> Path:
    (folder / "run").mkdir(parents=True, exist_ok=True)
    (folder / "exit_codes.json").write_text("{}")
    (folder / "run/results.json").write_text(json.dumps(record))
    (folder / "run/rows.jsonl").write_text("\n".join(json.dumps(row) for row in rows or []))
    return folder


def lines_of(
    tmp_path: Path, old: Any, new: Any, renamed: dict[str, str] | None = None
) -> list[str]:
    a, b = store(tmp_path / "a", old), store(tmp_path / "b", new)
    names = renamed or {}
    return diff_lines(read_store(a, names), read_store(b, names), 160)


def test_changed_last_digit_is_reported(tmp_path: Path) -> None:
    (line,) = lines_of(tmp_path, {"cases": [{"e": 1.0}]}, {"cases": [{"e": 1.0 + 2**-52}]})
    assert line.startswith("1 x run/results.json:.cases[].e  ")
    assert "(2.2e-16 relative)" in line


def test_times_and_folders_are_ignored(tmp_path: Path) -> None:
    old = {"created": "then", "seconds": 1.0, "out": str(tmp_path / "a/run"), "at": "/old/m.xml"}
    new = {"created": "now", "seconds": 2.0, "out": str(tmp_path / "b/run"), "at": "/new/m.xml"}
    for name, place in (("a", "/old"), ("b", "/new")):
        (tmp_path / name).mkdir()
        (tmp_path / name / PLACE).write_text(place)
    assert lines_of(tmp_path, old, new) == []


def test_renamed_key_is_equal_and_missing_key_is_reported(tmp_path: Path) -> None:
    old, new = {"global_error": 0.1, "step": 1}, {"error_at_dt": 0.1}
    (line,) = lines_of(tmp_path, old, new, {"global_error": "error_at_dt"})
    assert "run/results.json:.step gone" in line


def test_changed_type_is_reported(tmp_path: Path) -> None:
    lines = lines_of(tmp_path, {"u": 1.0, "ok": True}, {"u": None, "ok": 1})
    assert len(lines) == 2


def test_additional_case_is_reported(tmp_path: Path) -> None:
    lines = lines_of(tmp_path, {"cases": []}, {"cases": [{}]})
    assert [line for line in lines if ".cases#" in line]


def test_rows_are_paired_by_index(tmp_path: Path) -> None:
    rows = [{"index": 0, "e": 1.0}, {"index": 1, "e": 2.0}]
    a, b = store(tmp_path / "a", {}, rows), store(tmp_path / "b", {}, rows[::-1])
    assert diff_lines(read_store(a, {}), read_store(b, {}), 160) == []


def test_folder_that_is_not_a_store_is_rejected_with_a_hint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.argv", ["records", "diff", str(tmp_path), str(tmp_path)])
    with pytest.raises(
        SystemExit, match=r"is not a store; run `python -m campaigns\.records store"
    ):
        main()


def test_commands_cover_six_systems_and_six_robots(tmp_path: Path) -> None:
    names = [name for name, _ in commands(tmp_path, ("run", "gate", "compare", "mutate", "sweep"))]
    assert len([name for name in names if name.startswith("run/")]) == 1 + 6
    assert len([name for name in names if name.startswith("mutate/")]) == 6
    assert {"gate", "sweep"} < set(names)


def test_drawn_balls_are_within_their_uncertainty() -> None:
    folder: Path = EVENTS / "bouncing_ball"
    sidecar, tally = read_sidecar(folder / "space.py.toml"), Tally()
    random = np.random.default_rng(3)
    lines = [*compare(drawn(load_system(folder), random), sidecar, "pymunk", tally)]
    assert not any(line.startswith("OUTSIDE") for line in lines)
    assert tally.segments > 10
    assert tally.resolved > 0.9 * tally.segments
    assert tally.outside == 0


def test_peer_stop_distance_is_measured_below_its_tolerance() -> None:
    test = next(each for each in PEER_TESTS if each.peer == "Newton, stop distance, mu 0.7")
    *_, error, uncertainty = peer_row(test).strip("| ").split(" | ")
    assert float(error) < float(uncertainty) < 1e-8


@pytest.mark.parametrize(
    ("model", "numbers"),
    [
        ("bouncing_ball/space.py", {"RESTITUTION"}),
        ("bouncing_ball/mujoco.xml", {"geom[ball]@solref[0]"}),
        ("pendulum_stop/mujoco.xml", {"joint[theta]@range[1]", "joint[theta]@solreflimit[0]"}),
    ],
)
def test_faults_are_planted_in_contacts_but_not_in_masses(model: str, numbers: set[str]) -> None:
    sidecar = read_sidecar(EVENTS / f"{model}.toml")
    edits = planted_edits(load_system(sidecar.model.parent), sidecar)
    assert {address for address, _, _ in edits} == numbers


@pytest.mark.slow
def test_drive_that_leaves_its_limit_early_is_resolved() -> None:
    # The coarsest time step has one step before the event; with finer ones it is two steps early.
    folder = EVENTS / "saturated_servo"
    constants = {"m": 0.74384823821388705, "kp": 65.07412584242924, "kd": 5.618584911875705,
                 "F": 8.6691978778863561, "target": 0.4592167831077551}  # fmt: skip
    system = at_constants(load_system(folder), constants)
    sidecar = read_sidecar(folder / "space.py.toml")
    _, error, total = judged(system, sidecar, "pymunk", system.scenarios[0])
    assert np.all(error < total)
    assert total.max() < RESOLUTION


@pytest.mark.slow
def test_wrong_event_limit_is_named(tmp_path: Path) -> None:
    sidecar = read_sidecar(EVENTS / "pendulum_stop" / "space.py.toml")
    task = model_task(prepare_system(sidecar.model.parent, described=False), "pymunk", sidecar)
    wrong = Edit({"LIMIT": 0.404}).plant(task, tmp_path)
    (cause,) = diagnose_model(wrong).explanations[0].causes
    assert cause.subject == ("LIMIT",)
