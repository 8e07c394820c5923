"""Hostile options and settings of the pytest plugin, and folders that must fail in it."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from soak.corpus.entry import (
    Build,
    CorpusEntry,
    append_text,
    chain_builds,
    replace_text,
    write_file,
)

_RUN = ("pytest", "-q", "--crosscheck", "@hostile")
_entry = partial(CorpusEntry, command=_RUN, match="crosscheck")

OPTIONS: dict[str, tuple[str, ...]] = {
    "a folder that is not there": ("--crosscheck", "@nowhere"),
    "a folder without a system": ("--crosscheck", "@empty"),
    "a folder without a name": ("--crosscheck", ""),
    "a file": ("--crosscheck", "@hostile/mujoco.xml"),
    "a resolution of 0": ("--crosscheck-resolution", "0"),
    "a resolution of nan": ("--crosscheck-resolution", "nan"),
    "a resolution of a text": ("--crosscheck-resolution", "fine"),
    "a limit of 0": ("--crosscheck-limit", "0"),
    "a limit of inf": ("--crosscheck-limit", "inf"),
    "a memory of nan": ("--crosscheck-memory", "nan"),
    "a memory of less than nothing": ("--crosscheck-memory=-1",),
    "a baseline that is a file": ("--crosscheck-baseline", "@hostile/system.py"),
}

SETTINGS = {
    "paths of nothing": 'crosscheck_paths = ["nowhere"]',
    "paths that are a number": "crosscheck_paths = 1",
    "paths that are tables": "crosscheck_paths = [{}]",
    "paths without a system": 'crosscheck_paths = ["empty"]',
    "warnings that are errors": 'crosscheck_paths = ["hostile"]\nfilterwarnings = ["error"]',
}

FOLDERS: dict[str, Build] = {
    "a stiffness wrong by 1e-6": replace_text("mujoco.xml", ('"47"', '"47.000047"')),
    "no XML": replace_text("mujoco.xml", ("<worldbody>", "<worldbody")),
    "no sidecar": lambda workspace: (workspace / "hostile" / "mujoco.xml.toml").unlink(),
    "no TOML": write_file("mujoco.xml.toml", "engines = ["),
    "no model": lambda workspace: (workspace / "hostile" / "mujoco.xml").unlink(),
    "no system": append_text("system.py", "\nsystem = None\n"),
    "a system that segfaults": append_text("system.py", "\nimport ctypes\nctypes.string_at(0)\n"),
    "a system that interrupts": append_text("system.py", "\nraise KeyboardInterrupt\n"),
    "a system that ends the process": append_text("system.py", "\nimport os\nos._exit(0)\n"),
    "a system that leaves": append_text("system.py", "\nraise SystemExit(0)\n"),
    "an engine that nobody knows": replace_text("mujoco.xml.toml", ('"mujoco"', '"havok"')),
}

HOOKS = {
    "raises": "raise RuntimeError('no')",
    "returns a number": "return 1",
    "returns None and sentences": "return ['not', None]",
    "says no": "return 'too coarse'",
}


def pytest_entries() -> Iterator[CorpusEntry]:
    """Yield the pytest entries. Only sound folders may pass."""
    for name, words in OPTIONS.items():
        command = ("pytest", "-q", *words) if words[0] == "--crosscheck" else (*_RUN, *words)
        yield _entry(f"pytest/{name}", _make_empty_folder, command=command, codes=(4,))
    for name, text in SETTINGS.items():
        codes = (0,) if name.startswith("warnings") else (1, 4)
        build = chain_builds(_make_empty_folder, _write_settings(text))
        yield _entry(f"pytest/settings/{name}", build, command=("pytest", "-q"), codes=codes)
    for name, build in FOLDERS.items():
        yield _entry(f"pytest/{name}", build, codes=(1, 2), match=r"mujoco\.xml|system\.py")
    for name, line in HOOKS.items():
        hook = f"def pytest_crosscheck_case(record):\n    {line}\n"
        build = write_file("conftest.py", hook)
        yield _entry(f"pytest/a hook that {name}", build, codes=(1, 2, 4), match="mujoco")
    yield _entry("right/pytest", _make_empty_folder, codes=(0,), match="")


def _make_empty_folder(workspace: Path) -> None:
    (workspace / "empty").mkdir()


def _write_settings(text: str) -> Build:
    return lambda workspace: (workspace / "pyproject.toml").write_text(
        f"[tool.pytest.ini_options]\n{text}\n", "utf-8"
    )
