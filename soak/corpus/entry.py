"""One entry of the corpus: the files it writes, the command that reads them, and the requirements.

Most entries are hostile inputs. Some are sound folders, which must pass.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass
from pathlib import Path

Build = Callable[[Path], object]
"""A function that changes files of a workspace, in which `hostile/` and `sound/` start sound."""

BASELINE = ("--baseline", "@baseline", "--jobs", "1")
GATE = ("gate", "@hostile", "--out", "@og", *BASELINE)

RUN = ("run", "@hostile", "@sound", "--out", "@out", *BASELINE)
"""The command line of most entries. In every command, `@name` is a path in the workspace."""


@dataclass(frozen=True)
class CorpusEntry:
    """An input for a command, with the required exit code and message.

    Attributes:
        name: `format/what is wrong`. `--only` selects entries by it.
        build: writes the input.
        model: model file of the sound folder that the input starts from.
        command: the command line.
        before: commands that run before `build`, for example to accept a baseline.
        codes: allowed exit codes. For `run`, the exit code of the hostile folder's cases.
        match: regular expression that the output must match, such as the file and the line.
        setup: writes files before the commands in `before`.
        absent: engines that appear to be missing while the command runs.
        slow: true if the entry needs the time limit or its own process.
    """

    name: str
    build: Build
    _: KW_ONLY
    model: str = "mujoco.xml"
    command: tuple[str, ...] = RUN
    before: tuple[tuple[str, ...], ...] = ()
    codes: tuple[int, ...] = (3,)
    match: str = ""
    setup: Build | None = None
    absent: tuple[str, ...] = ()
    slow: bool = False

    @property
    def batched(self) -> bool:
        """True if its folder may be one of many folders in one run."""
        separate = self.slow or self.before or self.absent
        return self.command == RUN and not separate


def replace_text(name: str, *changes: tuple[str, str]) -> Build:
    """Return a build that replaces texts in a file of the hostile folder.

    The build raises ValueError if the file does not contain a text.
    """

    def build(workspace: Path) -> None:
        path = workspace / "hostile" / name
        text = path.read_text("utf-8")
        for old, new in changes:
            if old not in text:
                raise ValueError(f"{name} has no {old!r}")
            text = text.replace(old, new, 1)
        path.write_text(text, "utf-8", errors="surrogateescape")

    return build


def write_file(name: str, data: str | bytes) -> Build:
    """Return a build that writes a file of the hostile folder."""
    raw = data.encode("utf-8", errors="surrogateescape") if isinstance(data, str) else data
    return lambda workspace: (workspace / "hostile" / name).write_bytes(raw)


def append_text(name: str, text: str) -> Build:
    """Return a build that adds a text at the end of a file of the hostile folder."""

    def build(workspace: Path) -> None:
        with (workspace / "hostile" / name).open("a", encoding="utf-8") as file:
            file.write(text)

    return build


def prepend_text(name: str, text: str) -> Build:
    """Return a build that adds a text at the start of a file of the hostile folder."""

    def build(workspace: Path) -> None:
        path = workspace / "hostile" / name
        path.write_text(text + path.read_text("utf-8"), "utf-8")

    return build


def chain_builds(*builds: Build) -> Build:
    """Return a build that applies several builds in order."""

    def build(workspace: Path) -> None:
        for step in builds:
            step(workspace)

    return build
