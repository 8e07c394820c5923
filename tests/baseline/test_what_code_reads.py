"""What `system.py` and `space.py` read is what their cases depend on, wherever it lies."""

from __future__ import annotations

import importlib.util
import py_compile
import sys
from pathlib import Path

import pytest

import harness.files.reads
from harness.baseline.fingerprint import BESIDE, as_now, folder_files, with_reads
from harness.files.reads import recorded
from reference.load import load_system
from tests.faults.known_folder import SYSTEM

HERE = "from pathlib import Path\nHERE = Path(__file__).parent\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A system folder with a folder beside it, and files that its code may read."""
    folder, shared = tmp_path / "oscillator", tmp_path / "shared"
    for each in (folder / ".hidden", folder / "old", folder / "__pycache__", shared):
        each.mkdir(parents=True)
        (each / "mass.txt").write_text("1.3")
    (folder / "old" / "results.json").write_text("{}")
    (folder / ".mass").write_text("1.3")
    (shared / "local_mass.py").write_text("MASS = 1.3\n")
    return folder


def reads(folder: Path, code: str) -> set[str]:
    """What is read of a declaration that begins with some code, itself left out."""
    (folder / "system.py").write_text(HERE + code + SYSTEM)
    with recorded(folder) as found:
        load_system(folder)
    return set(found.names()) - {"system.py"}


@pytest.mark.parametrize(("code", "name"), [
    ("with open(HERE / '../shared/mass.txt') as file:\n    file.read()\n", "../shared/mass.txt"),
    ("(HERE.parent / 'shared' / 'mass.txt').read_text()\n", "../shared/mass.txt"),
    ("(HERE.parent / 'shared' / 'mass.txt').read_bytes()\n", "../shared/mass.txt"),
    ("import os\nos.close(os.open(HERE / '.mass', os.O_RDONLY))\n", ".mass"),
    ("import numpy\nnumpy.loadtxt(HERE / '.hidden' / 'mass.txt')\n", ".hidden/mass.txt"),
    ("(HERE / 'old' / 'mass.txt').open('rb').close()\n", "old/mass.txt"),
    ("(HERE / '__pycache__' / 'mass.txt').read_text()\n", "__pycache__/mass.txt"),
    ("import sys\nsys.path.insert(0, str(HERE.parent / 'shared'))\nimport local_mass\n",
     "../shared/local_mass.py"),
])  # fmt: skip
def test_what_a_declaration_reads_is_recorded(folder: Path, code: str, name: str) -> None:
    assert reads(folder, code) == {name}
    # And again, in a process that has imported it before.
    assert reads(folder, code) == {name}


@pytest.mark.parametrize("code", [
    "import json.tool, wave, sympy.physics.units\n",
    "(HERE / 'written').write_text('1.3')\n",
    "Path('/etc/hostname').read_text()\n",
    "import harness.text.primes\n",
])  # fmt: skip
def test_what_is_written_installed_or_of_the_machine_is_not(folder: Path, code: str) -> None:
    for name in ("json.tool", "wave", "harness.text.primes"):
        sys.modules.pop(name, None)
    assert reads(folder, code) == set()


def test_a_module_s_bytecode_is_neither_read_nor_written(folder: Path) -> None:
    shared = folder.parent / "shared"
    source = shared / "local_mass.py"
    source.write_text("raise SystemError('the bytecode is not this')\n")
    cached = Path(importlib.util.cache_from_source(str(source)))
    py_compile.compile(str(source), str(cached), invalidation_mode=_UNCHECKED)
    source.write_text("MASS = 1.3\n")
    before = cached.read_bytes()
    code = f"import sys\nsys.path.insert(0, {str(shared)!r})\nimport local_mass\n"
    assert reads(folder, code) == {"../shared/local_mass.py"}
    assert cached.read_bytes() == before
    assert str(shared) not in sys.path


_UNCHECKED = py_compile.PycInvalidationMode.UNCHECKED_HASH


def test_bytecode_without_a_source_is_recorded(folder: Path) -> None:
    source = folder / ".hidden" / "local_bytes.py"
    source.write_text("MASS = 1.3\n")
    py_compile.compile(str(source), str(source.with_suffix(".pyc")))
    source.unlink()
    code = f"import sys\nsys.path.insert(0, {str(source.parent)!r})\nimport local_bytes\n"
    assert reads(folder, code) == {".hidden/local_bytes.pyc"}


def test_what_says_which_packages_are_installed_is_no_input_of_a_case(folder: Path) -> None:
    about = folder.parent / "anywhere" / "adapter-1.0.dist-info"
    about.mkdir(parents=True)
    (about / "entry_points.txt").write_text("[crosscheck.engines]\n")
    assert reads(folder, f"open({str(about / 'entry_points.txt')!r}).close()\n") == set()


def test_what_programs_keep_in_the_users_cache_is_no_input_of_a_case(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Engines that compile what they run read it there the next time."""
    kept = folder.parent / "cache" / "kernels"
    kept.mkdir(parents=True)
    (kept / "step.bin").write_text("compiled")
    code = f"open({str(kept / 'step.bin')!r}).close()\n"
    assert reads(folder, code) == {"../cache/kernels/step.bin"}
    monkeypatch.setenv("XDG_CACHE_HOME", str(kept.parent))
    harness.files.reads._roots.cache_clear()
    assert reads(folder, code) == set()
    harness.files.reads._roots.cache_clear()


def test_each_folder_gets_its_own_module_of_a_name(folder: Path, tmp_path: Path) -> None:
    code = "import sys\nsys.path.insert(0, str(HERE / 'lib'))\nimport local_name\n"
    for number in (1.5, 2.5):
        one = tmp_path / f"folder_{number}"
        (one / "lib").mkdir(parents=True)
        (one / "lib" / "local_name.py").write_text(f"MASS = {number}\n")
        text = SYSTEM.replace('"m", 1.3,', '"m", local_name.MASS,')
        (one / "system.py").write_text(HERE + code + text)
        with recorded(one) as found:
            assert load_system(one).constants[0].value == number
        assert set(found.names()) == {"system.py", "lib/local_name.py"}


def test_what_was_read_elsewhere_counts_and_what_lies_in_the_folder_counts_once(
    folder: Path,
) -> None:
    (folder / "system.py").write_text("")
    (folder / "space.py").write_text("")
    (folder / "space.py.toml").write_text('engines = ["pymunk"]\n')
    (folder / "mass.txt").write_text("1.3")
    (model,) = folder_files(folder).models
    accepted = with_reads(model, {"mass.txt": "a", "../shared/mass.txt": "b", "system.py": "c"})
    assert set(accepted) == {*model.copies, BESIDE, "../shared/mass.txt"}
    now = as_now(model, accepted)
    assert set(now) == set(accepted)
    (folder.parent / "shared" / "mass.txt").write_text("1.4")
    assert as_now(model, accepted) != now
    (folder.parent / "shared" / "mass.txt").unlink()
    assert as_now(model, accepted)["../shared/mass.txt"] == "can't be read"


def test_packages_that_another_environment_lends_are_installed_ones(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lent = tmp_path / "lent" / "site-packages"
    lent.mkdir(parents=True)
    (lent / "lent_module.py").write_text("number = 1\n")
    monkeypatch.syspath_prepend(lent)
    harness.files.reads._roots.cache_clear()
    try:
        (folder / "system.py").write_text(f"import lent_module\n{SYSTEM}")
        with recorded(folder) as seen:
            load_system(folder)
        assert not [name for name in seen.names() if "lent_module" in name]
        with recorded(folder):
            assert "lent_module" in sys.modules, "an installed module is not dropped"
    finally:
        sys.modules.pop("lent_module", None)
        harness.files.reads._roots.cache_clear()


def test_a_copy_that_is_made_and_gone_is_no_input_of_a_case(folder: Path, tmp_path: Path) -> None:
    kept, gone = tmp_path / "kept.csv", tmp_path / "copy.urdf"
    with recorded(folder) as reads:
        for file in (kept, gone):
            file.write_text("1")
            file.read_text()
        gone.unlink()
    assert [Path(name).name for name in reads.names()] == ["kept.csv"]
