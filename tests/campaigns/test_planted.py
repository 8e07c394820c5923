"""Faults planted into a robot file, classified by their visible effect."""

from __future__ import annotations

from pathlib import Path

import pytest

from campaigns.planted import __main__ as command
from campaigns.planted.compared import judge_by_compare
from campaigns.planted.fates import FaultBaseline, FaultFate, judge_by_equations, table
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
