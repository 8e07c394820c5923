"""Changed elements and attributes keep the bytes of everything else."""

from pathlib import Path

import pytest

from physics_crosscheck.harness.checks.findings import source_line
from physics_crosscheck.harness.documents import elements
from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.elements import (
    Number,
    XmlElement,
    read_elements,
    replace_numbers,
)
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.reading import SourceFile
from physics_crosscheck.harness.modelfiles.locations.attributes import elements as start_tags
from physics_crosscheck.harness.modelfiles.locations.attributes import with_attributes

TEXT = """<robot  name='a&amp;b'><!-- kept -->
  <link name="l" ><mass value = "1e0"/></link >
  <joint name="j"/>
</robot>"""


def make_copy() -> XmlElement:
    return read_elements(SourceFile(Path("f.urdf"), TEXT.encode()))[0].copy()


def test_unchanged_copy_is_the_file() -> None:
    assert make_copy().written().decode() == TEXT
    assert make_copy().copy().written().decode() == TEXT


@pytest.mark.parametrize(
    ("tag", "key", "value", "before", "after"),
    [
        ("mass", "value", "2", 'value = "1e0"', 'value="2"'),
        ("mass", "unit", "<kg>", 'value = "1e0"', 'value = "1e0" unit="&lt;kg&gt;"'),
        ("link", "name", None, ' name="l"', ""),
    ],
)
def test_changed_attribute_changes_only_its_bytes(
    tag: str, key: str, value: str | None, before: str, after: str
) -> None:
    root = make_copy()
    (element,) = root.iter(tag)
    if value is None:
        del element.attributes[key]
    else:
        element.set(key, value)
    assert root.written().decode() == TEXT.replace(before, after)


def test_removed_child_leaves_its_siblings() -> None:
    root = make_copy()
    root.remove(root.findall("link")[0])
    assert root.written().decode() == TEXT.replace(
        '<link name="l" ><mass value = "1e0"/></link >', ""
    )


def test_children_are_added_before_the_end_tag_and_into_an_empty_element() -> None:
    root = make_copy()
    root.findall("joint")[0].add("axis", {"xyz": "0 0 1"})
    root.findall("link")[0].add("note", text="a<b").add("inner")
    changed = TEXT.replace('<joint name="j"/>', '<joint name="j"><axis xyz="0 0 1"></axis></joint>')
    assert root.written().decode() == changed.replace(
        "</link >", "<note>a&lt;b<inner></inner></note></link >"
    )


def test_element_that_moves_keeps_its_bytes() -> None:
    root = make_copy()
    link = root.findall("link")[0]
    holder = XmlElement("sdf", {"version": "1.6"})
    holder.append(link)
    assert holder.written().decode() == (
        '<sdf version="1.6"><link name="l" ><mass value = "1e0"/></link ></sdf>'
    )


def test_bytes_are_parsed_once_and_changed_bytes_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Share elements between a reader and an engine's adapter in one process."""
    path, parse, parsed = tmp_path / "r.urdf", elements._parse, list[bytes]()

    def count(source: SourceFile) -> tuple[XmlElement, ...]:
        parsed.append(source.data)
        return parse(source)

    monkeypatch.setattr(elements, "_parse", count)
    path.write_text(TEXT)
    first = Document(path).root
    first.copy().set("name", "other")
    assert Document(path).root is first
    assert first.get("name") == "a&b"
    path.write_text(TEXT.replace("1e0", "2e0"))
    assert Document(path).root.find("link/mass").get("value") == "2e0"  # type: ignore[union-attr]
    assert len(parsed) == 2


def test_number_without_a_line_is_named_by_its_address() -> None:
    """Print no line of a binary layer, and change none of its bytes."""
    number = Number(file=Path("arm.usdc"), text="2.5", address="/arm/link.physics:mass")
    assert str(number) == "arm.usdc:/arm/link.physics:mass"
    assert (number.value, number.span, source_line(number).line) == (2.5, None, None)
    with pytest.raises(LocationError, match=r"arm\.usdc: '/arm/link\.physics:mass' is not written"):
        replace_numbers({number.file: b"PXR-USDC"}, [(number, "3")])


JOINTS = (
    "<!-- <joint name='x' damping='9'/> é -->\r\n"
    "<mujoco>\r\n\t<default><joint  damping = '1' /></default>\r\n"
    "  <body><joint name=\"x\"\n         axis='1 0 0'   /><joint name='y'></joint></body>\r\n"
    "</mujoco>\r\n"
)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "model.xml"
    path.write_bytes(JOINTS.encode())
    return path


def change(file: Path, name: str, attribute: str, value: str | None) -> str:
    element = next(e for e in start_tags(file) if e.attributes.get("name") == name)
    return with_attributes(file.read_bytes(), file, [(element.start, attribute, value)]).decode()


@pytest.mark.parametrize(("name", "attribute", "value", "before", "after"), [
    ("x", "armature", "0.1", "axis='1 0 0' ", "axis='1 0 0' armature=\"0.1\" "),
    ("y", "armature", "0.1", "<joint name='y'>", "<joint name='y' armature=\"0.1\">"),
    ("x", "axis", "0 0 1", "\n         axis='1 0 0'", ' axis="0 0 1"'),
    ("x", "axis", None, "\n         axis='1 0 0'", ""),
    ("x", "damping", None, "", ""),
])  # fmt: skip
def test_attribute_is_added_set_or_removed(
    file: Path, name: str, attribute: str, value: str | None, before: str, after: str
) -> None:
    assert change(file, name, attribute, value) == JOINTS.replace(before, after)


def test_several_attributes_are_changed_at_once(file: Path) -> None:
    x, y = (e.start for e in start_tags(file) if "name" in e.attributes)
    edits = [(x, "a", "1"), (y, "b", '"<&'), (x, "axis", None)]
    path = file.with_name("new.xml")
    path.write_bytes(with_attributes(file.read_bytes(), file, edits))
    actual = {
        e.attributes["name"]: e.attributes for e in start_tags(path) if "name" in e.attributes
    }
    assert actual == {"x": {"name": "x", "a": "1"}, "y": {"name": "y", "b": '"<&'}}


def test_byte_where_no_element_starts_is_refused(file: Path) -> None:
    with pytest.raises(LocationError, match="no element starts at byte 5"):
        with_attributes(file.read_bytes(), file, [(5, "a", "1")])
