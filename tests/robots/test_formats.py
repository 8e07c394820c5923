"""A format of robot files is a package and its line in `FORMATS`."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from physics_crosscheck.harness.modelfiles import formats, readers
from physics_crosscheck.harness.modelfiles.formats import FORMATS, Format
from physics_crosscheck.harness.modelfiles.robot import refused
from physics_crosscheck.harness.modelfiles.robot_targets import robot_files, robots_below


def test_registered_format_is_read_by_its_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = f"{readers.__package__}.toy"
    toy = SimpleNamespace(read=lambda file, _: refused(file, "toy", ()), numbers=lambda *_: "toy")
    monkeypatch.setitem(sys.modules, package, toy)
    monkeypatch.setitem(FORMATS, ".toy", Format(package="toy", is_xml=False, head=rb"links"))
    file, other = tmp_path / "arm.toy", tmp_path / "notes.toy"
    file.write_text('{"links": []}')
    other.write_text("{}")
    assert robot_files([str(file)]).files == [file]
    assert robots_below(tmp_path) == [file]
    assert formats.syntax_problem(file) == ""
    assert readers.read_robot(file).name == "toy"
    assert str(readers.robot_numbers(file, {})) == "toy"


def test_include_file_is_not_listed_as_a_robot(tmp_path: Path) -> None:
    for name, root in (("arm", "mujoco"), ("part", "mujocoinclude"), ("page", "html")):
        (tmp_path / f"{name}.xml").write_text(f"<{root}></{root}>")
    assert robots_below(tmp_path) == [tmp_path / "arm.xml"]
