"""Which files a case depends on: those that its model file names, and nothing that it doesn't."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from harness.baseline.fingerprint import folder_files

Named = Callable[[str], list[str]]

MODELS = Path(__file__).parents[2] / "models"


@pytest.fixture
def named(tmp_path: Path) -> Named:
    """The files outside its folder that a model file depends on, once a text stands in it."""
    folder = tmp_path / "arm"
    folder.mkdir()
    for name in ("system.py", "mujoco.xml", "mujoco.xml.toml"):
        shutil.copy(MODELS / "simple_pendulum" / name, folder / name)
    (tmp_path / "assets").mkdir()
    for name in ("a.stl", "b.stl"):
        (tmp_path / "assets" / name).write_text(name)

    def of(text: str) -> list[str]:
        model = folder / "mujoco.xml"
        model.write_text(model.read_text().replace("</mujoco>", f"{text}</mujoco>"))
        (found,) = folder_files(folder).models
        return sorted(name for name in found.hashes if name.startswith("../"))

    return of


def test_a_mesh_is_named_by_its_attribute(named: Named) -> None:
    assert named('<asset><mesh name="a" file="../assets/a.stl"/></asset>') == ["../assets/a.stl"]


def test_a_folder_of_meshes_is_looked_in(named: Named) -> None:
    text = '<compiler meshdir="../assets"/><asset><mesh file="b.stl"/></asset>'
    assert named(text) == ["../assets/b.stl"]


def test_a_comment_names_no_file_nor_does_a_look_alike(named: Named) -> None:
    text = (
        '<!-- <mesh file="../assets/a.stl"/> --><compiler/>'
        """<custom><text name="t" data="file='../assets/b.stl'"/></custom>"""
    )
    assert named(text) == []


def test_what_is_no_xml_here_may_name_a_file_in_any_word(named: Named) -> None:
    assert named('<mesh file="../assets/a.stl"> & </mujoco>') == ["../assets/a.stl"]
