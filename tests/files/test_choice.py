"""Models and folders are chosen by name and pattern, and similar names are suggested."""

from pathlib import Path

import pytest

from physics_crosscheck.harness.modelfiles.choice import (
    CaseSelection,
    chosen_models,
    matching,
    named_model,
)
from physics_crosscheck.harness.modelfiles.folders import FolderError, builtin, system_folders
from physics_crosscheck.harness.modelfiles.robot_targets import robot_files
from physics_crosscheck.records import CaseId

FREE = CaseId(system="arm", model="robot.urdf", scenario="free", engine="mujoco")


@pytest.mark.parametrize(("words", "expected"), [
    ("", True), ("FREE", True), ("driven", False), ("free and mujoco", True),
    ("free and not mujoco", False), ("driven or urdf/free", True), ("[mujoco]", True),
    ("not (driven or pymunk)", True), ("not driven and (pymunk or robot)", True),
])  # fmt: skip
def test_keyword_expression_is_read_like_pytest(words: str, expected: bool) -> None:
    assert matching(words)(str(FREE)) is expected


@pytest.mark.parametrize("words", ["and", "free and", "(free", "free)", "not", "free mujoco"])
def test_invalid_keyword_expression_is_refused(words: str) -> None:
    with pytest.raises(FolderError, match="can't be read; use words, `and`, `or`, `not`"):
        matching(words)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    place = tmp_path / "my arm"
    place.mkdir()
    for name in ("system.py", "robot.urdf", "robot.urdf.toml", "old.urdf"):
        (place / name).write_text("")
    return place


def test_path_selects_a_model_of_a_folder(folder: Path) -> None:
    selection = named_model(f"{folder}/robot.urdf")
    assert selection is not None
    assert (selection.folder, selection.model) == (folder, "robot.urdf")
    assert (selection.scenario, selection.engine) == ("", "")
    assert selection.includes(FREE)


@pytest.mark.parametrize(("tail", "expected"), [
    ("/free [mujoco]", True), ("/free", True), ("/free [pybullet]", False), ("/driven", False),
    (" [mujoco]", True),
])  # fmt: skip
def test_printed_name_selects_a_case(folder: Path, tail: str, expected: bool) -> None:
    selection = named_model(f"{folder}/robot.urdf{tail}")
    assert selection is not None
    assert selection.includes(FREE) is expected


def test_system_name_selects_a_builtin_model() -> None:
    selection = named_model("simple_pendulum/mujoco.xml/large")
    assert selection is not None
    assert (selection.folder, selection.scenario) == (builtin() / "simple_pendulum", "large")


@pytest.mark.parametrize("name", ["old.urdf", "nothing.urdf", "", "system.py"])
def test_file_without_a_sidecar_is_not_a_model(folder: Path, name: str) -> None:
    assert named_model(f"{folder}/{name}") is None


def test_named_folder_is_selected_whole(folder: Path) -> None:
    model, other = f"{folder}/robot.urdf", "somewhere/else.xml"
    names, models = chosen_models([model, other])
    assert names == [other, str(folder)]
    assert [one.model for one in models[str(folder)]] == ["robot.urdf"]
    assert chosen_models([model, str(folder)]) == ([str(folder)], {})


def test_selection_combines_models_words_and_cases(folder: Path) -> None:
    _, models = chosen_models([f"{folder}/robot.urdf/free"])
    other = CaseId(system="arm", model="mujoco.xml", scenario="free", engine="mujoco")
    selection = CaseSelection(models=models)
    assert [selection.includes(str(folder), case) for case in (FREE, other)] == [True, False]
    assert selection.includes("another", other), "folders without such names are whole"
    assert not CaseSelection(models=models, words="driven").includes(str(folder), FREE)
    assert CaseSelection(only=[("f", FREE)]).includes("f", FREE)
    assert not CaseSelection(only=[("f", FREE)]).includes("g", FREE)
    assert CaseSelection().everything
    assert not CaseSelection(only=[]).everything


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robots").mkdir()
    for name in ("robot.xml", "robot.urdf", "robots/panda.urdf", ".robotx.urdf", "b.urdf"):
        (tmp_path / name).touch()
    return tmp_path


@pytest.mark.parametrize(("missing", "similar"), [
    ("robo.urdf", "robot.urdf"),
    ("robo.xml", "robot.xml"),
    ("robot.sdf", "robot.urdf"),
    ("robts/pnda.urdf", "robots/panda.urdf"),
    ("robts/panda.urdf", "robots/panda.urdf"),
    # an equal suffix alone
    ("a.urdf", ""),
    ("nothing/robot.urdf", ""),
    ("/nowhere/at/all.urdf", ""),
])  # fmt: skip
def test_missing_file_suggests_a_similar_name(place: Path, missing: str, similar: str) -> None:
    hint = f"; did you mean {similar}?" if similar else ""
    assert robot_files([missing]).faults == {missing: f"{missing}: there is no such file{hint}"}


def test_misspelled_system_suggests_a_similar_name(place: Path) -> None:
    for name, similar in (("simple_pendlum", "simple_pendulum"), ("robts", "robots")):
        with pytest.raises(FolderError, match=f"^{name}: no such folder; did you mean {similar}"):
            system_folders([name])
