"""Reuse of results of a folder, whose code may open, query, list or import anything."""

import importlib.util
import os
import py_compile
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from physics_crosscheck.harness.baseline.fingerprint import (
    OTHER_FILES,
    as_now,
    folder_files,
    with_reads,
)
from physics_crosscheck.harness.modelfiles import code_reads
from physics_crosscheck.harness.modelfiles.code_reads import record_reads
from physics_crosscheck.harness.planning.cache import Cache, CacheKey
from physics_crosscheck.harness.records.coverage import Coverage
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


def present(states: dict[str, str]) -> dict[str, str]:
    """Return the states of paths that exist, or are unknown."""
    return {name: state for name, state in states.items() if state != "absent"}


def reads(folder: Path, code: str) -> dict[str, str]:
    (folder / "system.py").write_text(HERE + code + SYSTEM)
    with record_reads(folder) as recording:
        load_system(folder)
    return recording.states


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
    (folder / "space.py").write_text("")
    (folder / "space.py.toml").write_text('engines = ["pymunk"]\n')
    states = reads(folder, SHARED + code)
    (model,) = folder_files(folder).models
    accepted = with_reads(model, states)
    cache = Cache(folder.parent / "cache")
    key = CacheKey(kind="coverage", folder=str(folder), inputs="known")
    cache.store(key, Coverage(note="kept"), states)
    changed(shared)
    assert cache.find(key, Coverage) is None
    assert "unknown" in accepted.values() or as_now(model, accepted) != accepted


INSIDE: dict[str, tuple[str, Callable[[Path], None]]] = {
    "file": ("(HERE / '.mass').read_text()\n", appear("../oscillator/.mass")),
    "link": ("(HERE / '../oscillator/.mass').resolve().read_text()\n",
             appear("../oscillator/.mass")),
    "low level": ("import os\nos.close(os.open(HERE / '.mass', os.O_RDONLY))\n",
                  appear("../oscillator/.mass")),
    "by numpy": ("import numpy\nnumpy.loadtxt(HERE / '.hidden' / 'mass.txt')\n",
                 lambda shared: (shared / "../oscillator/.hidden/mass.txt").unlink()),
    "beside results": ("(HERE / 'old' / 'mass.txt').open('r+b').close()\n",
                       appear("../oscillator/old/mass.txt")),
    "in a cache": ("(HERE / '__pycache__' / 'mass.txt').read_text()\n",
                   appear("../oscillator/__pycache__/mass.txt")),
    "absent": ("(HERE / '.no').exists()\n", appear("../oscillator/.no")),
    "listing": ("list(HERE.iterdir())\n", appear("../oscillator/.no")),
    "glob": ("import glob\nglob.glob(str(HERE / '*'))\n", appear("../oscillator/empty/.no")),
    "module": ("import sys\nsys.path.insert(0, str(HERE / 'old'))\nimport local_k\n",
               appear("../oscillator/old/local_k.py")),
}  # fmt: skip


@pytest.mark.parametrize("way", INSIDE)
def test_reads_inside_are_reused_until_the_content_changes(folder: Path, way: str) -> None:
    code, changed = INSIDE[way]
    (folder / "old" / "local_k.py").write_text("MASS = 1.3\n")
    states = reads(folder, code)
    assert reads(folder, code) == states  # again, in a process that has imported it
    cache = Cache(folder.parent / "cache")
    key = CacheKey(kind="coverage", folder=str(folder), inputs="known")
    cache.store(key, Coverage(note="kept"), states)
    assert cache.find(key, Coverage) == Coverage(note="kept")
    changed(folder.parent / "shared")
    assert cache.find(key, Coverage) is None


UNOBSERVED = {
    "times": "(HERE / '.mass').stat()\n",
    "times of an entry": "import os\n[entry.stat() for entry in os.scandir(HERE)]\n",
    "link": "import os\nos.readlink(HERE / '.link')\n",
    "process": "import subprocess\nsubprocess.run(['true'])\n",
    "machine": "Path('/etc/hostname').read_text()\n",
    "created": "import tempfile\ntempfile.TemporaryFile().close()\n",
    "thread": "import threading\nthread = threading.Thread(target=(HERE / '../shared/mass.txt')"
              ".read_text)\nthread.start(), thread.join()\n",
    "removed from the path": "import sys\nsys.path.insert(0, str(HERE / '../shared'))\n"
                             "import local_mass\ndel sys.path[0]\n",
}  # fmt: skip


@pytest.mark.parametrize("code", UNOBSERVED.values(), ids=UNOBSERVED)
def test_folder_whose_inputs_are_unknown_always_runs_again(folder: Path, code: str) -> None:
    (folder / ".link").symlink_to(".mass")
    assert "unknown" in reads(folder, code).values()


@pytest.mark.parametrize("code", [
    "import json.tool, wave, sympy.physics.units\n",
    "import physics_crosscheck.harness.render.terminal.primes\n",
    "HERE.resolve()\n",
    "import numpy, os\nos.listdir(os.path.dirname(numpy.__file__))\n",
])  # fmt: skip
def test_installed_files_are_no_inputs(folder: Path, code: str) -> None:
    for name in ("json.tool", "wave", "physics_crosscheck.harness.render.terminal.primes"):
        sys.modules.pop(name, None)
    assert present(reads(folder, code)) == {}


def test_bytecode_is_neither_read_nor_written(folder: Path) -> None:
    source = folder / "local_mass.py"
    source.write_text("raise SystemError('the bytecode is not this')\n")
    cached = Path(importlib.util.cache_from_source(str(source)))
    py_compile.compile(str(source), str(cached), invalidation_mode=_UNCHECKED)
    source.write_text("MASS = 1.3\n")
    before = cached.read_bytes()
    states = reads(folder, "import sys\nsys.path.insert(0, str(HERE))\nimport local_mass\n")
    assert "local_mass.py" in states
    assert "unknown" not in states.values()
    assert cached.read_bytes() == before
    assert str(folder) not in sys.path


_UNCHECKED = py_compile.PycInvalidationMode.UNCHECKED_HASH


def test_each_folder_imports_its_own_module(tmp_path: Path) -> None:
    code = "import sys\nsys.path.insert(0, str(HERE / 'lib'))\nimport local_name\n"
    for number in (1.5, 2.5):
        system_folder = tmp_path / f"folder_{number}"
        (system_folder / "lib").mkdir(parents=True)
        (system_folder / "lib" / "local_name.py").write_text(f"MASS = {number}\n")
        text = SYSTEM.replace('"m", 1.3,', '"m", local_name.MASS,')
        (system_folder / "system.py").write_text(HERE + code + text)
        with record_reads(system_folder) as recording:
            assert load_system(system_folder).constants[0].value == number
        assert "lib/local_name.py" in recording.states


def test_files_read_elsewhere_count_and_folder_files_count_once(folder: Path) -> None:
    (folder / "system.py").write_text("")
    (folder / "space.py").write_text("")
    (folder / "space.py.toml").write_text('engines = ["pymunk"]\n')
    (folder / "mass.txt").write_text("1.3")
    (model,) = folder_files(folder).models
    accepted = with_reads(model, {"mass.txt": CONTENT, ".mass": CONTENT, "../shared": "unknown"})
    assert set(accepted) == {*model.copies, OTHER_FILES, ".mass", "../shared"}
    assert as_now(model, accepted)[".mass"] not in (CONTENT, "absent")
    (folder / ".mass").unlink()
    assert as_now(model, accepted)[".mass"] == "absent"


def test_packages_of_other_environments_count_as_installed(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lent = tmp_path / "lent" / "site-packages"
    lent.mkdir(parents=True)
    (lent / "lent_module.py").write_text("number = 1\n")
    monkeypatch.syspath_prepend(lent)
    code_reads._roots.cache_clear()
    try:
        assert present(reads(folder, "import lent_module\n")) == {}
        with record_reads(folder):
            assert "lent_module" in sys.modules, "an installed module must not be dropped"
    finally:
        sys.modules.pop("lent_module", None)
        code_reads._roots.cache_clear()


def test_nested_recordings_see_the_same_reads(folder: Path) -> None:
    """Nest two recordings, as caching the measurement of a code model does."""
    code = compile("open('/etc/hostname').close()", str(folder / "space.py"), "exec")
    with record_reads(folder) as outer, record_reads(folder) as inner:
        exec(code)
    assert outer.states == inner.states != {}


def test_recording_restores_the_patched_functions(folder: Path) -> None:
    before = os.stat, os.readlink
    (folder / "system.py").write_text("raise SystemExit\n")
    with pytest.raises(SystemExit), record_reads(folder):
        load_system(folder)
    assert (os.stat, os.readlink) == before
