"""One hostile input: what is written, which command meets it, and what must hold."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

Build = Callable[[Path], object]
"""Changes files below a workspace, in which `hostile/` and `sound/` are sound folders."""

RUN = ("run", "@hostile", "@sound", "--out", "@out", "--baseline", "@baseline", "--jobs", "1")
"""Of every command, `@name` stands for the path of that name in the workspace."""


@dataclass(frozen=True, kw_only=True)
class Entry:
    """A hostile input.

    Attributes:
        name: `format/what is wrong`; what `--only` chooses by.
        build: writes it.
        model: the model file of the sound folder that it begins from.
        command: the command line.
        before: commands that run while the folder is still sound, to accept a baseline, say.
        codes: exit codes that are right; of `run`, that of the hostile folder's own cases.
        says: regular expression that what is told must match, file and line where they are asked.
        first: written before these commands.
        absent: engines that are not installed, for all that is asked.
        slow: whether it needs the time limit, or a process of its own.
    """

    name: str
    build: Build
    model: str = "mujoco.xml"
    command: tuple[str, ...] = RUN
    before: tuple[tuple[str, ...], ...] = ()
    codes: tuple[int, ...] = (3,)
    says: str = ""
    first: Build | None = None
    absent: tuple[str, ...] = ()
    slow: bool = False

    @property
    def batched(self) -> bool:
        """Whether it may be one of many folders of one run."""
        alone = self.slow or self.before or self.absent
        return self.command == RUN and not alone


def replaced(name: str, *changes: tuple[str, str]) -> Build:
    """A file of the hostile folder with texts replaced, each of which must be there."""

    def build(place: Path) -> None:
        path = place / "hostile" / name
        text = path.read_text("utf-8")
        for old, new in changes:
            if old not in text:
                raise ValueError(f"{name} has no {old!r}")
            text = text.replace(old, new, 1)
        path.write_text(text, "utf-8", errors="surrogateescape")

    return build


def written(name: str, data: str | bytes) -> Build:
    """A file of the hostile folder with other content."""
    raw = data.encode("utf-8", errors="surrogateescape") if isinstance(data, str) else data
    return lambda place: (place / "hostile" / name).write_bytes(raw)


def added(name: str, text: str) -> Build:
    """A file of the hostile folder with a text at its end."""

    def build(place: Path) -> None:
        with (place / "hostile" / name).open("a", encoding="utf-8") as file:
            file.write(text)

    return build


def begun(name: str, text: str) -> Build:
    """A file of the hostile folder with a text before all else."""

    def build(place: Path) -> None:
        path = place / "hostile" / name
        path.write_text(text + path.read_text("utf-8"), "utf-8")

    return build


def both(*builds: Build) -> Build:
    """One after the other."""

    def build(place: Path) -> None:
        for one in builds:
            one(place)

    return build
