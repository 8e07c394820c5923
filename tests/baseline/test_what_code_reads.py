"""Dependencies of cases on all files that `system.py` and `space.py` read."""

from __future__ import annotations

import importlib.util
import os
import py_compile
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import physics_crosscheck.harness.modelfiles.code_reads
from physics_crosscheck.harness.baseline.fingerprint import (
    OTHER_FILES,
    as_now,
    folder_files,
    with_reads,
)
from physics_crosscheck.harness.modelfiles.code_reads import record_reads
from physics_crosscheck.harness.modelfiles.path_states import is_content
from physics_crosscheck.harness.planning.cache import Cache
from physics_crosscheck.harness.records.coverage import Coverage
from physics_crosscheck.harness.records.journal import CacheKey
from physics_crosscheck.reference.load import load_system
from tests.faults.known_folder import SYSTEM

CONTENT = "0123456789abcdef"
HERE = "from pathlib import Path\nHERE = Path(__file__).parent\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Create a system folder and a neighbouring folder with files that its code may read."""
    folder, shared = tmp_path / "oscillator", tmp_path / "shared"
    for each in (folder / ".hidden", folder / "old", folder / "__pycache__", shared):
        each.mkdir(parents=True)
        (each / "mass.txt").write_text("1.3")
    (folder / "old" / "results.json").write_text("{}")
    (folder / ".mass").write_text("1.3")
    (shared / "local_mass.py").write_text("MASS = 1.3\n")
    return folder


def reads(folder: Path, code: str) -> set[str]:
    """Return the files that a declaration with some code reads, except itself."""
    (folder / "system.py").write_text(HERE + code + SYSTEM)
    with record_reads(folder) as recording:
        load_system(folder)
    return {name for name, state in recording.states().items() if is_content(state)} - {"system.py"}


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
def test_reads_of_a_declaration_are_recorded(folder: Path, code: str, name: str) -> None:
    assert reads(folder, code) == {name}
    # Again, in a process that has already imported it.
    assert reads(folder, code) == {name}


@pytest.mark.parametrize("code", [
    "import json.tool, wave, sympy.physics.units\n",
    "(HERE / 'written').write_text('1.3')\n",
    "Path('/etc/hostname').read_text()\n",
    "import harness.render.terminal.primes\n",
])  # fmt: skip
def test_written_installed_and_system_files_are_not_recorded(folder: Path, code: str) -> None:
    for name in ("json.tool", "wave", "physics_crosscheck.harness.render.terminal.primes"):
        sys.modules.pop(name, None)
    assert reads(folder, code) == set()


def test_bytecode_is_neither_read_nor_written(folder: Path) -> None:
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


def test_package_metadata_is_not_recorded(folder: Path) -> None:
    about = folder.parent / "anywhere" / "adapter-1.0.dist-info"
    about.mkdir(parents=True)
    (about / "entry_points.txt").write_text("[crosscheck.engines]\n")
    assert reads(folder, f"open({str(about / 'entry_points.txt')!r}).close()\n") == set()


def test_files_in_the_user_cache_are_not_recorded(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ignore kernels that engines compile and read again from the cache."""
    kernels = folder.parent / "cache" / "kernels"
    kernels.mkdir(parents=True)
    (kernels / "step.bin").write_text("compiled")
    code = f"open({str(kernels / 'step.bin')!r}).close()\n"
    assert reads(folder, code) == {"../cache/kernels/step.bin"}
    monkeypatch.setenv("XDG_CACHE_HOME", str(kernels.parent))
    physics_crosscheck.harness.modelfiles.code_reads._roots.cache_clear()
    assert reads(folder, code) == set()
    physics_crosscheck.harness.modelfiles.code_reads._roots.cache_clear()


def test_each_folder_imports_its_own_module(folder: Path, tmp_path: Path) -> None:
    code = "import sys\nsys.path.insert(0, str(HERE / 'lib'))\nimport local_name\n"
    for number in (1.5, 2.5):
        system_folder = tmp_path / f"folder_{number}"
        (system_folder / "lib").mkdir(parents=True)
        (system_folder / "lib" / "local_name.py").write_text(f"MASS = {number}\n")
        text = SYSTEM.replace('"m", 1.3,', '"m", local_name.MASS,')
        (system_folder / "system.py").write_text(HERE + code + text)
        with record_reads(system_folder) as recording:
            assert load_system(system_folder).constants[0].value == number
        assert {"system.py", "lib/local_name.py"} <= set(recording.states())


def test_files_read_elsewhere_count_and_folder_files_count_once(
    folder: Path,
) -> None:
    (folder / "system.py").write_text("")
    (folder / "space.py").write_text("")
    (folder / "space.py.toml").write_text('engines = ["pymunk"]\n')
    (folder / "mass.txt").write_text("1.3")
    (model,) = folder_files(folder).models
    accepted = with_reads(
        model,
        {"mass.txt": CONTENT, "../shared/mass.txt": CONTENT, "system.py": f"{CONTENT}; times:1"},
    )
    assert set(accepted) == {*model.copies, OTHER_FILES, "../shared/mass.txt", "./system.py"}
    now = as_now(model, accepted)
    assert set(now) == set(accepted)
    (folder.parent / "shared" / "mass.txt").write_text("1.4")
    assert as_now(model, accepted) != now
    (folder.parent / "shared" / "mass.txt").unlink()
    assert as_now(model, accepted)["../shared/mass.txt"] == "absent"


def test_packages_of_other_environments_count_as_installed(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lent = tmp_path / "lent" / "site-packages"
    lent.mkdir(parents=True)
    (lent / "lent_module.py").write_text("number = 1\n")
    monkeypatch.syspath_prepend(lent)
    physics_crosscheck.harness.modelfiles.code_reads._roots.cache_clear()
    try:
        (folder / "system.py").write_text(f"import lent_module\n{SYSTEM}")
        with record_reads(folder) as seen:
            load_system(folder)
        assert not [name for name in seen.states() if "lent_module" in name]
        with record_reads(folder):
            assert "lent_module" in sys.modules, "an installed module must not be dropped"
    finally:
        sys.modules.pop("lent_module", None)
        physics_crosscheck.harness.modelfiles.code_reads._roots.cache_clear()


def test_path_that_imports_a_module_does_not_recurse_endlessly(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Catch a failure of every folder in Python 3.12.3, whose `Path` imports `ntpath`."""
    room = physics_crosscheck.harness.modelfiles.code_reads
    (folder / "system.py").write_text(SYSTEM)

    def importing() -> frozenset[str]:
        exec(compile("import ntpath", "/usr/lib/python3.12/pathlib.py", "exec"))
        return frozenset()

    monkeypatch.setattr(room, "package_folders", importing)
    room._roots.cache_clear()
    room._origin.cache_clear()
    try:
        with record_reads(folder):
            assert load_system(folder).name == "oscillator"
    finally:
        monkeypatch.undo()
        room._roots.cache_clear()
        room._origin.cache_clear()


def test_file_created_by_the_code_is_not_recorded(folder: Path, tmp_path: Path) -> None:
    kept, gone = tmp_path / "kept.csv", tmp_path / "copy.urdf"
    with record_reads(folder) as reads:
        for file in (kept, gone):
            file.write_text("1")
            file.read_text()
        gone.unlink()
    assert reads.states() == {}


def appear(name: str) -> Callable[[Path], None]:
    """Return a change that creates a file, relative to the shared folder."""

    def create(shared: Path) -> None:
        (shared / name).parent.mkdir(exist_ok=True)
        (shared / name).write_text("MASS = 1.4\n")

    return create


def change(shared: Path) -> None:
    """Change the content of a file, but neither its length nor its time."""
    file = shared / "mass.txt"
    before = file.stat()
    file.write_text("1.4")
    os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns))


def touch(shared: Path) -> None:
    """Change the modification time of a file."""
    os.utime(shared / "mass.txt", ns=(0, 10**9))


def turn(shared: Path) -> None:
    """Point a link to another file of the same content."""
    (shared / "other.txt").write_text("1.3")
    (shared / "link").unlink()
    (shared / "link").symlink_to("other.txt")


SHARED = "SHARED = HERE.resolve().parent / 'shared'\nimport os, sys\n"
PATH = "sys.path.insert(0, str(SHARED))\n"
FAILED = "try:\n    open(SHARED / 'no.txt')\nexcept OSError:\n    pass\n"

WAYS: dict[str, tuple[str, Callable[[Path], None]]] = {
    "read and write": ("open(SHARED / 'mass.txt', 'r+').close()\n", change),
    "binary, read and write": ("open(SHARED / 'mass.txt', 'rb+').close()\n", change),
    "append": ("open(SHARED / 'mass.txt', 'a+').close()\n", change),
    "low level": ("os.close(os.open(SHARED / 'mass.txt', os.O_RDWR))\n", change),
    "open folder": (
        "at = os.open(SHARED, os.O_RDONLY)\n"
        "os.close(os.open('mass.txt', os.O_RDONLY, dir_fd=at))\n", change),
    "memory map": (
        "import mmap\nwith open(SHARED / 'mass.txt', 'r+b') as f:\n    mmap.mmap(f.fileno(), 0)\n",
        change),
    **{f"memmap {mode}": (
        f"import numpy\nnumpy.memmap(SHARED / 'mass.txt', mode='{mode}', dtype='u1')\n", change)
       for mode in ("r", "r+", "c")},
    "os.stat": ("os.stat(SHARED / 'mass.txt').st_mtime\n", touch),
    "os.lstat": ("os.lstat(SHARED / 'mass.txt').st_mtime\n", touch),
    "os.fstat": ("os.fstat(os.open(SHARED / 'mass.txt', os.O_RDONLY)).st_mtime\n", touch),
    "Path.stat": ("(SHARED / 'mass.txt').stat().st_mtime\n", touch),
    "getmtime": ("os.path.getmtime(SHARED / 'mass.txt')\n", touch),
    "stat and read": ("(SHARED / 'mass.txt').read_text(), (SHARED / 'mass.txt').stat()\n", touch),
    "entries": ("[entry.stat() for entry in os.scandir(SHARED)]\n", touch),
    "failed open": (FAILED, appear("no.txt")),
    "failed low-level open": (FAILED.replace("open(", "os.open(").replace("')", "', os.O_RDWR)"),
                              appear("no.txt")),
    "exists": ("os.path.exists(SHARED / 'no.txt')\n", appear("no.txt")),
    "lexists": ("os.path.lexists(SHARED / 'no.txt')\n", appear("no.txt")),
    "Path.exists": ("(SHARED / 'no.txt').exists()\n", appear("no.txt")),
    "Path.is_file": ("(SHARED / 'no.txt').is_file()\n", appear("no.txt")),
    "access": ("os.access(SHARED / 'no.txt', os.R_OK)\n", appear("no.txt")),
    "hidden": ("os.path.exists(HERE / '.no')\n", appear("../oscillator/.no")),
    "not a folder": ("os.path.exists(SHARED / 'deep' / 'no.txt')\n",
                  appear("deep/no.txt")),
    "glob": ("import glob\nglob.glob(str(SHARED / '*.csv'))\n", appear("no.csv")),
    "recursive glob": ("import glob\nglob.glob(str(SHARED / '**/*.csv'), recursive=True)\n",
                       appear("no.csv")),
    "Path.glob": ("list(SHARED.glob('*.csv'))\n", appear("no.csv")),
    "listdir": ("os.listdir(SHARED)\n", appear("no.csv")),
    "iterdir": ("list(SHARED.iterdir())\n", appear("no.csv")),
    "scandir": ("list(os.scandir(SHARED))\n", appear("no.csv")),
    "walk": ("list(os.walk(SHARED))\n", appear("no.csv")),
    "link": ("(SHARED / 'link').resolve().read_text()\n", turn),
    "module": (f"{PATH}import local_mass\n", appear("local_mass/__init__.py")),
    "module not there": (f"{PATH}import colorsys\n", appear("colorsys.py")),
    "module loaded before": (f"{PATH}import json\n", appear("json.py")),
    "module of not a folder": (
        "sys.path.insert(0, str(SHARED / 'lib'))\ntry:\n    import nowhere\n"
        "except ImportError:\n    pass\n",
        appear("lib/nowhere.py")),
    "module by its file": (
        "import importlib.util as u\n"
        "spec = u.spec_from_file_location('by_file', SHARED / 'by_file.py')\n"
        "spec.loader.exec_module(u.module_from_spec(spec))\n", appear("by_file.py")),
    "database": ("import sqlite3\nsqlite3.connect(SHARED / 'mass.txt').close()\n", change),
    "removed": ("(SHARED / 'mass.txt').read_text(), (SHARED / 'mass.txt').unlink()\n",
                lambda shared: None),
}  # fmt: skip


@pytest.mark.parametrize("way", WAYS)
def test_changed_reads_invalidate_earlier_results(folder: Path, way: str) -> None:
    """Check cache and baseline for each way of reading a file."""
    code, changed = WAYS[way]
    shared = folder.parent / "shared"
    (shared / "link").symlink_to("mass.txt")
    (shared / "by_file.py").write_text("MASS = 1.3\n")
    (folder / "system.py").write_text(HERE + SHARED + code + SYSTEM)
    (folder / "space.py").write_text("")
    (folder / "space.py.toml").write_text('engines = ["pymunk"]\n')
    # The second run finds the files that the first run created.
    for _ in range(1 if way == "removed" else 2):
        with record_reads(folder) as recording:
            load_system(folder)
    reads = recording.states()
    (model,) = folder_files(folder).models
    accepted = with_reads(model, reads)
    cache = Cache(folder.parent / "cache")
    key = CacheKey(kind="coverage", folder=str(folder), inputs="known")
    cache.store(key, Coverage(note="kept"), reads)
    if way != "removed":
        assert cache.find(key, Coverage) == Coverage(note="kept")
        assert as_now(model, accepted) == accepted
    changed(shared)
    assert cache.find(key, Coverage) is None
    assert as_now(model, accepted) != accepted


QUIET = {
    "resolve": "HERE.resolve()\n",
    "made": "(SHARED / 'made').write_text('1')\n(SHARED / 'made').exists()\n",
    "made in a folder": (
        "import tempfile\nwith tempfile.TemporaryDirectory() as made:\n"
        "    os.makedirs(f'{made}/a/b')\n    os.path.exists(f'{made}/a/no')\n"
        "    os.listdir(made)\n"),
    "renamed": (
        "(SHARED / 'new').write_text('1')\nos.replace(SHARED / 'new', SHARED / 'made')\n"
        "(SHARED / 'made').read_text()\n"),
    "installed": "import numpy\nos.listdir(os.path.dirname(numpy.__file__))\n",
    "of the machine": "os.path.exists('/etc/no')\n",
}  # fmt: skip


@pytest.mark.parametrize("code", QUIET.values(), ids=QUIET)
def test_operations_without_input_are_not_recorded(folder: Path, code: str) -> None:
    (folder / "system.py").write_text(HERE + SHARED + code + SYSTEM)
    with record_reads(folder) as recording:
        load_system(folder)
    assert recording.states().keys() == {"system.py"}, recording.states()


def test_nested_recordings_see_the_same_reads(folder: Path) -> None:
    """Nest two recordings, as caching the measurement of a code model does."""
    mass = folder.parent / "shared" / "mass.txt"
    with record_reads(folder) as outer, record_reads(folder) as inner:
        mass.read_text()
    assert outer.states() == inner.states() != {}


def test_read_from_an_unknown_open_folder_prevents_reuse(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = (
        "at = os.open(SHARED, os.O_RDONLY)\nos.close(os.open('mass.txt', os.O_RDONLY, dir_fd=at))\n"
    )
    monkeypatch.setattr(physics_crosscheck.harness.modelfiles.code_reads, "_place", lambda *_: None)
    (folder / "system.py").write_text(HERE + SHARED + code + SYSTEM)
    with record_reads(folder) as recording:
        load_system(folder)
    assert "can't be read" in recording.states().values()
    cache, key = Cache(folder / "cache"), CacheKey(kind="coverage", folder="f", inputs="known")
    cache.store(key, Coverage(), recording.states())
    assert cache.find(key, Coverage) is None


def test_recording_restores_the_patched_functions(folder: Path) -> None:
    before = os.stat, os.open, __import__
    (folder / "system.py").write_text("raise SystemExit\n")
    with pytest.raises(SystemExit), record_reads(folder):
        load_system(folder)
    assert (os.stat, os.open, __import__) == before
