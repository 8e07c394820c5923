"""A `system.py` is loaded, and its errors are reported with their lines."""

import shutil
import sys
from pathlib import Path

import pytest

from physics_crosscheck import DeclarationError
from physics_crosscheck.reference.load import load_system
from tests.reference.mechanisms import MODELS, NAMES, built_in


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Copy a built-in folder's declaration, to spoil it."""
    shutil.copy(MODELS / "mass_spring_damper" / "system.py", tmp_path)
    return tmp_path


def spoil(folder: Path, old: str, new: str) -> None:
    """Replace text in the declaration."""
    path = folder / "system.py"
    text = path.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))


@pytest.mark.parametrize("name", NAMES)
def test_built_in_folder_is_named_as_its_system(name: str) -> None:
    assert built_in(name).name == name


def test_folder_without_a_declaration_is_refused_naming_the_file(tmp_path: Path) -> None:
    with pytest.raises(DeclarationError, match=r"system\.py: no such file"):
        load_system(tmp_path)


MUTE = "type('Mute', (ValueError,), {'__str__': lambda self: 1 / 0})"
ENERGY = "V=k * x.q**2 / 2"
CALL = "system = System("


@pytest.mark.parametrize(("old", "new", "place", "sentence"), [
    ('x = Coordinate("x",', 'x = = Coordinate("x",', "x = =", "SyntaxError: invalid syntax"),
    (ENERGY, "V=kk * x.q**2 / 2", "V=kk", "NameError: name 'kk'"),
    (ENERGY, f"V=(_ for _ in ()).throw({MUTE}())", "V=(_ for",
     r"Mute: its message can't be shown \(ZeroDivisionError\)"),
    # A call is placed at its first line.
    ("    D=c * x.v**2 / 2,\n", "", CALL, ".*missing 1 field: 'D'"),
    (ENERGY, "V=k * x.q", CALL, "system 'mass_.*V has the u"),
])  # fmt: skip
def test_wrong_declaration_is_refused_with_file_and_line(
    folder: Path, old: str, new: str, place: str, sentence: str
) -> None:
    spoil(folder, old, new)
    line = (folder / "system.py").read_text().split(place)[0].count("\n") + 1
    with pytest.raises(DeclarationError, match=rf"system\.py:{line}: {sentence}"):
        load_system(folder)


def test_file_that_declares_no_system_is_refused_with_the_remedy(folder: Path) -> None:
    spoil(folder, CALL, "other = System(")
    with pytest.raises(DeclarationError, match=r"must end with `system = System\(\.\.\.\)`"):
        load_system(folder)


def test_two_folders_share_no_module_and_no_path(
    folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    other = tmp_path_factory.mktemp("other")
    shutil.copy(folder / "system.py", other)
    spoil(other, 'Constant("k", 47.0', 'Constant("k", 48.0')
    before = list(sys.path)
    first, second = load_system(folder), load_system(other)
    assert first.constants[2].value == 47.0
    assert second.constants[2].value == 48.0
    assert sys.path == before
