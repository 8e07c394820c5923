"""Dependencies of cases on files that a model file names, as the parser reads them."""

import time
from pathlib import Path

import pytest

from physics_crosscheck.harness.baseline.fingerprint import OTHER_FILES, folder_files
from physics_crosscheck.harness.modelfiles.parts import named_files
from physics_crosscheck.harness.planning.cache import key_of_file

SIDECAR = 'engines = ["mujoco"]\n'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Create a system folder, and next to it files that its model may name."""
    system, shared = tmp_path / "system", tmp_path / "shared"
    (shared / "deep").mkdir(parents=True)
    system.mkdir()
    (system / "system.py").write_text("")
    (system / "m.xml.toml").write_text(SIDECAR)
    for name in ("a.stl", "b.stl", "deep/a.stl"):
        (shared / name).write_bytes(b"solid\0" + name.encode())
    return system


def named(folder: Path, body: str) -> set[str]:
    """Return the model's dependencies except itself, its sidecar and the declaration."""
    text = f"<mujoco>{body}</mujoco>" if not body.startswith("<?") else body
    (folder / "m.xml").write_text(text)
    (model,) = folder_files(folder).models
    return set(model.hashes) - set(model.copies) - {OTHER_FILES}


@pytest.mark.parametrize("body", [
    '<mesh file="../shared/a.stl"/>',
    "<mesh file='../shared/a.stl'/>",
    '<mesh\n file\n = "../shared/a.stl"/>',
    '<mesh filename="package://../shared/a.stl"/>',
    '<mesh file="../shared/a&#46;stl"/>',
    '<mesh file="..&#x2f;shared/a.stl"/>',
    '<compiler meshdir="../shared"/><mesh file="a.stl"/>',
    '<compiler meshdir="../sh&#97;red"/><mesh file="a.stl"/>',
])  # fmt: skip
def test_named_file_is_a_dependency(folder: Path, body: str) -> None:
    assert named(folder, body) == {"../shared/a.stl"}


@pytest.mark.parametrize("body", [
    '<!-- <mesh file="../shared/a.stl"/> -->',
    '<!-- was file="../shared/a.stl" --><geom/>',
    'file="../shared/a.stl"',
    '<![CDATA[<mesh file="../shared/a.stl"/>]]>',
    '<custom><text name="n" data="file=\'../shared/a.stl\'"/></custom>',
    '<mesh name="../shared/a.stl"/>',
    '<mesh profile="../shared/a.stl"/>',
    '<!-- <compiler meshdir="../shared"/> --><mesh file="a.stl"/>',
])  # fmt: skip
def test_names_in_comments_and_other_attributes_are_ignored(folder: Path, body: str) -> None:
    assert named(folder, body) == set()


@pytest.mark.parametrize("name", ["part.xml", "part.inc", "part"])
def test_include_is_followed_for_any_file_extension(folder: Path, name: str) -> None:
    part = folder.parent / "shared" / name
    part.write_text('<mujocoinclude><mesh file="b.stl"/></mujocoinclude>')
    assert named(folder, f'<include file="../shared/{name}"/>') == {
        f"../shared/{name}",
        "../shared/b.stl",
    }


def test_meshdir_of_an_include_applies_to_the_whole_model(folder: Path) -> None:
    """Treat includes as MuJoCo does: an include is pasted, so its compiler applies to the model."""
    shared = folder.parent / "shared"
    (shared / "one.xml").write_text('<x><include file="../shared/two.xml"/></x>')
    (shared / "two.xml").write_text('<x><compiler meshdir="../shared"/></x>')
    body = '<include file="../shared/one.xml"/><mesh file="a.stl"/>'
    assert named(folder, body) == {"../shared/one.xml", "../shared/two.xml", "../shared/a.stl"}


@pytest.mark.parametrize("name", ["part.inc", "new.stl"])
def test_named_file_that_appears_later_is_a_change(folder: Path, name: str) -> None:
    shared = folder.parent / "shared"
    (shared / "part.xml").write_text(f'<x><include file="{name}"/><mesh file="{name}"/></x>')
    (folder / "m.xml").write_text('<mujoco><include file="../shared/part.xml"/></mujoco>')
    (before,) = folder_files(folder).models
    prepared = key_of_file(folder / "m.xml", {"floating": False})
    (shared / name).write_text("<x/>")
    (after,) = folder_files(folder).models
    assert before.hashes != after.hashes
    assert prepared != key_of_file(folder / "m.xml", {"floating": False})


def test_mesh_named_by_an_sdf_is_a_dependency(folder: Path) -> None:
    (folder / "m.sdf").write_text(
        "<sdf><model><link><visual><geometry><mesh><uri> ../shared/a.stl </uri></mesh>"
        "</geometry></visual></link></model></sdf>"
    )
    assert [path.resolve().name for path in named_files(folder / "m.sdf")] == ["a.stl"]


def test_recursive_include_terminates(folder: Path) -> None:
    (folder.parent / "shared" / "loop.inc").write_text('<x><include file="loop.inc"/></x>')
    assert named(folder, '<include file="../shared/loop.inc"/>') == {"../shared/loop.inc"}


@pytest.mark.parametrize("text", [
    '<?xml version="1.0"?><mujoco/><mujoco><mesh file="../shared/a.stl"/></mujoco>',
    '<?xml version="1.0"?><mujoco><mesh name="&unknown;" file="../shared/a.stl"/></mujoco>',
    '<?xml version="1.0" encoding="latin-1"?><mujoco><mesh file="../shared/a.stl"/></mujoco>',
    '<?xml version="1.0"?><mujoco>don\'t<mesh file="../shared/a.stl"></mujoco>',
])  # fmt: skip
def test_every_quoted_word_of_an_unparsable_file_counts(folder: Path, text: str) -> None:
    # Engines accept more than this parser: a missed name would hide a change.
    assert named(folder, text) == {"../shared/a.stl"}


def test_thousands_of_words_are_searched_in_linear_time(tmp_path: Path) -> None:
    words = " ".join(f'w{i}="v{i}"' for i in range(3000))
    (tmp_path / "m.xml").write_text(f" <?xml version='1.0'?><mujoco file='' {words}/>")
    (tmp_path / "v7").touch()
    began = time.process_time()
    assert named_files(tmp_path / "m.xml") == (tmp_path / "v7",)
    assert time.process_time() - began < 5


def test_words_of_a_rejected_file_with_a_dtd_count(folder: Path) -> None:
    text = '<?xml version="1.0"?>\n<!DOCTYPE mujoco><mujoco><mesh file="../shared/a.stl"/></mujoco>'
    (folder / "m.xml").write_text(text)
    named = {path.resolve() for path in named_files(folder / "m.xml")}
    assert named == {folder.parent / "shared" / "a.stl"}
    scan = folder_files(folder)
    assert scan.models == ()
    assert scan.broken[0] == f"{folder / 'm.xml'}:2: refused: it declares entities or a DTD"


def test_changed_named_file_changes_the_model_hashes(folder: Path) -> None:
    (folder / "m.xml").write_text('<mujoco><mesh file="../shared/a&#46;stl"/></mujoco>')
    before = folder_files(folder)
    (folder.parent / "shared" / "a.stl").write_bytes(b"solid\0another")
    after = folder_files(folder)
    assert before.models[0].hashes != after.models[0].hashes
    assert before.system == after.system
