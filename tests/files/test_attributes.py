"""Attributes are set, added and removed; the rest of the file keeps its bytes."""

from pathlib import Path

import pytest

from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.modelfiles.locations.attributes import elements, with_attributes

TEXT = (
    "<!-- <joint name='x' damping='9'/> é -->\r\n"
    "<mujoco>\r\n\t<default><joint  damping = '1' /></default>\r\n"
    "  <body><joint name=\"x\"\n         axis='1 0 0'   /><joint name='y'></joint></body>\r\n"
    "</mujoco>\r\n"
)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "model.xml"
    path.write_bytes(TEXT.encode())
    return path


def change(file: Path, name: str, attribute: str, value: str | None) -> str:
    element = next(e for e in elements(file) if e.attributes.get("name") == name)
    return with_attributes(file.read_bytes(), file, [(element.start, attribute, value)]).decode()


def test_attribute_is_added_after_the_others(file: Path) -> None:
    assert change(file, "x", "armature", "0.1") == TEXT.replace(
        "axis='1 0 0' ", "axis='1 0 0' armature=\"0.1\" "
    )
    assert change(file, "y", "armature", "0.1") == TEXT.replace(
        "<joint name='y'>", "<joint name='y' armature=\"0.1\">"
    )


def test_attribute_is_set_in_place(file: Path) -> None:
    assert change(file, "x", "axis", "0 0 1") == TEXT.replace(
        "\n         axis='1 0 0'", ' axis="0 0 1"'
    )


def test_attribute_is_removed_and_a_missing_one_is_ignored(file: Path) -> None:
    assert change(file, "x", "axis", None) == TEXT.replace("\n         axis='1 0 0'", "")
    assert change(file, "x", "damping", None) == TEXT


def test_several_attributes_are_changed_at_once(file: Path) -> None:
    x, y = (e.start for e in elements(file) if "name" in e.attributes)
    edits = [(x, "a", "1"), (y, "b", '"<&'), (x, "axis", None)]
    path = file.with_name("new.xml")
    path.write_bytes(with_attributes(file.read_bytes(), file, edits))
    actual = {e.attributes["name"]: e.attributes for e in elements(path) if "name" in e.attributes}
    assert actual == {"x": {"name": "x", "a": "1"}, "y": {"name": "y", "b": '"<&'}}


def test_byte_where_no_element_starts_is_refused(file: Path) -> None:
    with pytest.raises(LocationError, match="no element starts at byte 5"):
        with_attributes(file.read_bytes(), file, [(5, "a", "1")])
