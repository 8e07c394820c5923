"""Hostile options and settings of the pytest plugin, and folders that it must not pass."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from soak.corpus.entry import Build, Entry, added, both, replaced, written

_RUN = ("pytest", "-q", "--crosscheck", "@hostile")

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
    "a stiffness wrong by 1e-6": replaced("mujoco.xml", ('"47"', '"47.000047"')),
    "no XML": replaced("mujoco.xml", ("<worldbody>", "<worldbody")),
    "no sidecar": lambda place: (place / "hostile" / "mujoco.xml.toml").unlink(),
    "no TOML": written("mujoco.xml.toml", "engines = ["),
    "no model": lambda place: (place / "hostile" / "mujoco.xml").unlink(),
    "no system": added("system.py", "\nsystem = None\n"),
    "a system that segfaults": added("system.py", "\nimport ctypes\nctypes.string_at(0)\n"),
    "a system that interrupts": added("system.py", "\nraise KeyboardInterrupt\n"),
    "a system that ends the process": added("system.py", "\nimport os\nos._exit(0)\n"),
    "a system that leaves": added("system.py", "\nraise SystemExit(0)\n"),
    "an engine that nobody knows": replaced("mujoco.xml.toml", ('"mujoco"', '"havok"')),
}

HOOKS = {
    "raises": "raise RuntimeError('no')",
    "returns a number": "return 1",
    "returns None and sentences": "return ['not', None]",
    "says no": "return 'too coarse'",
}


def pytests() -> Iterator[Entry]:
    """Every entry of the kind: nothing of it passes, but what is sound."""
    for name, words in OPTIONS.items():
        command = ("pytest", "-q", *words) if words[0] == "--crosscheck" else (*_RUN, *words)
        yield Entry(name=f"pytest/{name}", build=_empty, command=command, codes=(4,),
                    says="crosscheck")  # fmt: skip
    for name, text in SETTINGS.items():
        codes = (0,) if name.startswith("warnings") else (1, 4)
        yield Entry(name=f"pytest/settings/{name}", build=both(_empty, _settings(text)),
                    command=("pytest", "-q"), codes=codes, says="crosscheck")  # fmt: skip
    for name, build in FOLDERS.items():
        yield Entry(name=f"pytest/{name}", build=build, command=_RUN, codes=(1, 2),
                    says=r"mujoco\.xml|system\.py")  # fmt: skip
    for name, line in HOOKS.items():
        yield Entry(name=f"pytest/a hook that {name}", build=_hook(line), command=_RUN,
                    codes=(1, 2, 4), says="mujoco")  # fmt: skip
    yield Entry(name="right/pytest", build=_empty, command=_RUN, codes=(0,))


def _empty(place: Path) -> None:
    (place / "empty").mkdir()


def _settings(text: str) -> Build:
    return lambda place: (place / "pyproject.toml").write_text(
        f"[tool.pytest.ini_options]\n{text}\n", "utf-8"
    )


def _hook(line: str) -> Build:
    text = f"def pytest_crosscheck_case(record):\n    {line}\n"
    return lambda place: (place / "hostile" / "conftest.py").write_text(text, "utf-8")
