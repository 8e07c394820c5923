"""Which cases are wanted: by name, by words."""

from __future__ import annotations

from pathlib import Path

import pytest

from physics_crosscheck.harness.modelfiles.choice import (
    CaseSelection,
    chosen_models,
    matching,
    named_model,
)
from physics_crosscheck.harness.modelfiles.folders import FolderError, builtin
from physics_crosscheck.harness.records.case import CaseId

FREE = CaseId(system="arm", model="robot.urdf", scenario="free", engine="mujoco")


@pytest.mark.parametrize(("words", "wanted"), [
    ("", True), ("FREE", True), ("driven", False), ("free and mujoco", True),
    ("free and not mujoco", False), ("driven or urdf/free", True), ("[mujoco]", True),
    ("not (driven or pymunk)", True), ("not driven and (pymunk or robot)", True),
])  # fmt: skip
def test_words_are_read_as_pytest_reads_them(words: str, wanted: bool) -> None:
    assert matching(words)(str(FREE)) is wanted


@pytest.mark.parametrize("words", ["and", "free and", "(free", "free)", "not", "free mujoco"])
def test_words_that_can_not_be_read_are_refused(words: str) -> None:
    with pytest.raises(FolderError, match="can't be read; use words, `and`, `or`, `not`"):
        matching(words)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    place = tmp_path / "my arm"
    place.mkdir()
    for name in ("system.py", "robot.urdf", "robot.urdf.toml", "old.urdf"):
        (place / name).write_text("")
    return place


def test_a_model_of_a_folder_is_meant_by_its_path(folder: Path) -> None:
    one = named_model(f"{folder}/robot.urdf")
    assert one is not None
    assert (one.folder, one.model, one.scenario, one.engine) == (folder, "robot.urdf", "", "")
    assert one.includes(FREE)


@pytest.mark.parametrize(("tail", "wanted"), [
    ("/free [mujoco]", True), ("/free", True), ("/free [pybullet]", False), ("/driven", False),
    (" [mujoco]", True),
])  # fmt: skip
def test_a_case_is_meant_by_its_name_as_it_is_printed(
    folder: Path, tail: str, wanted: bool
) -> None:
    one = named_model(f"{folder}/robot.urdf{tail}")
    assert one is not None
    assert one.includes(FREE) is wanted


def test_built_in_models_are_found_by_their_systems_names() -> None:
    one = named_model("simple_pendulum/mujoco.xml/large")
    assert one is not None
    assert (one.folder, one.scenario) == (builtin() / "simple_pendulum", "large")


@pytest.mark.parametrize("name", ["old.urdf", "nothing.urdf", "", "system.py"])
def test_files_without_a_sidecar_are_no_models_of_a_folder(folder: Path, name: str) -> None:
    assert named_model(f"{folder}/{name}") is None


def test_a_folder_that_is_named_itself_is_wanted_whole(folder: Path) -> None:
    model, other = f"{folder}/robot.urdf", "somewhere/else.xml"
    names, models = chosen_models([model, other])
    assert names == [other, str(folder)]
    assert [one.model for one in models[str(folder)]] == ["robot.urdf"]
    assert chosen_models([model, str(folder)]) == ([str(folder)], {})


def test_a_choice_leaves_out_what_any_part_of_it_does(folder: Path) -> None:
    _, models = chosen_models([f"{folder}/robot.urdf/free"])
    other = CaseId(system="arm", model="mujoco.xml", scenario="free", engine="mujoco")
    one = CaseSelection(models=models)
    assert [one.includes(str(folder), case) for case in (FREE, other)] == [True, False]
    assert one.includes("another", other), "folders without such names are whole"
    assert not CaseSelection(models=models, words="driven").includes(str(folder), FREE)
    assert CaseSelection(only=[("f", FREE)]).includes("f", FREE)
    assert not CaseSelection(only=[("f", FREE)]).includes("g", FREE)
    assert CaseSelection().everything
    assert not CaseSelection(only=[]).everything
