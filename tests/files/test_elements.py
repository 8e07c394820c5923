"""Copies of elements keep the bytes of everything that is not changed."""

from pathlib import Path

import pytest

from physics_crosscheck.harness.documents import elements
from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.elements import XmlElement, read_elements
from physics_crosscheck.harness.documents.reading import SourceFile

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
