"""Disks that are full or read-only, streams that are closed, two runs at once."""

from __future__ import annotations

import contextlib
import os
import shlex
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from soak.faults.fault import Fault
from soak.faults.scene import Ended, Scene, Undisturbed, scene, told_wrong, verdicts


def resources() -> Iterator[Fault]:
    """Every fault of files and streams."""
    for size in (1, 4, 40, 400):
        yield Fault(name=f"disk/files of {size} kB at most", check=_limited(size))
        yield Fault(name=f"disk/a disk of {size} kB", check=_small_disk(size))
    for name, out in _OUT.items():
        yield Fault(name=f"disk/{name}", check=_unwritable(out))
    yield Fault(name="disk/no folder for temporary files", check=_no_temporary)
    for name, redirected in _STREAMS.items():
        yield Fault(name=f"streams/{name}", check=_redirected(redirected))
    yield Fault(name="two runs/at once in one folder", check=_two_at_once)
    yield Fault(name="two runs/a second while the first is on", check=_one_after)


def _shell(one: Scene, script: str) -> Ended:
    """A run as part of a line of shell, `RUN` in it."""
    run = " ".join(map(shlex.quote, one.command()))
    command = ["bash", "-c", script.replace("RUN", run)]
    return one.ended(one.start(command))


def _limited(size: int) -> Callable[[Undisturbed], list[str]]:
    """No file may grow beyond so many kB: writing fails as on a full disk."""

    def check(expected: Undisturbed) -> list[str]:
        with scene(folders=1) as one:
            ended = _shell(one, f"ulimit -f {size}; RUN")
            return [*_failed(ended), *one.left_behind(), *_again(one, expected)]

    return check


def _small_disk(size: int) -> Callable[[Undisturbed], list[str]]:
    """The out folder is a file system of so many kB; where none may be mounted, nothing is seen."""

    def check(expected: Undisturbed) -> list[str]:
        with scene(folders=1) as one:
            one.out.mkdir()
            mount = ["mount", "-t", "tmpfs", "-o", f"size={size}k", "soak", str(one.out)]
            if subprocess.run(mount, capture_output=True, check=False).returncode:
                return []
            try:
                ended = one.run()
                wrong = [*_failed(ended), *one.left_behind()]
            finally:
                subprocess.run(["umount", "--lazy", str(one.out)], check=False)
            return [*wrong, *_again(one, expected)]

    return check


def _failed(ended: Ended) -> list[str]:
    """Where it could not write it must say so, and end with 3; where all had room, it agrees."""
    wrong = told_wrong(ended)
    if ended.code not in (0, 3):
        wrong.append(f"exit code {ended.code}: {ended.told[-300:]!r}")
    if ended.code == 3 and not ended.stderr.strip():
        wrong.append("it does not say why")
    return wrong


def _again(one: Scene, expected: Undisturbed) -> list[str]:
    """With room, the same folder serves."""
    ended = one.run("--resume")
    own = expected.of("sound_0")
    if ended.code != 0 or verdicts(one.results()) != own:
        return [f"a run afterwards ends with {ended.code}: {ended.told[-300:]!r}"]
    return told_wrong(ended)


_OUT: dict[str, Callable[[Scene], Path]] = {
    "an out folder that can't be made": lambda one: Path("/proc/soak"),
    "an out folder that is read-only": lambda one: _read_only(one),
    "an out folder on a device": lambda one: Path("/dev/null"),
    "results that are a folder": lambda one: _made(one.place / "odd" / "results.json").parent,
    "a page that is a folder": lambda one: _made(one.place / "odd" / "index.html").parent,
    "results that are a link to nothing": lambda one: _linked(one.place / "odd"),
}


def _made(folder: Path) -> Path:
    (folder / "within").mkdir(parents=True)
    return folder


def _read_only(one: Scene) -> Path:
    """Root may write anywhere; a file system may still be read-only."""
    folder = _made(one.place / "odd").parent / "odd"
    bound = ["mount", "--bind", str(folder), str(folder)]
    if subprocess.run(bound, capture_output=True, check=False).returncode == 0:
        again = ["mount", "-o", "remount,ro,bind", str(folder)]
        subprocess.run(again, capture_output=True, check=False)
    folder_mode = 0o555
    with contextlib.suppress(OSError):
        os.chmod(folder, folder_mode)
    return folder


def _linked(folder: Path) -> Path:
    folder.mkdir()
    (folder / "results.json").symlink_to(folder / "nothing" / "at all")
    return folder


def _unwritable(out: Callable[[Scene], Path]) -> Callable[[Undisturbed], list[str]]:
    def check(expected: Undisturbed) -> list[str]:
        with scene(folders=1) as one:
            where = out(one)
            try:
                ended = one.run("--out", str(where))
            finally:
                subprocess.run(["umount", "--lazy", str(where)], capture_output=True, check=False)
            wrong = told_wrong(ended) + one.left_behind()
            if ended.code == 0 and _writable(where):
                return wrong
            if ended.code not in (2, 3) or str(where) not in ended.stderr:
                wrong.append(f"exit code {ended.code}: {ended.stderr[-300:]!r}")
            return wrong

    return check


def _writable(folder: Path) -> bool:
    """Whether this user can write there after all."""
    return (folder / "results.json").is_file()


def _no_temporary(expected: Undisturbed) -> list[str]:
    with scene(folders=1) as one:
        one.temporary.rmdir()
        ended = one.run()
        one.temporary.mkdir(exist_ok=True)
        wrong = told_wrong(ended)
        if ended.code not in (0, 3):
            wrong.append(f"exit code {ended.code}: {ended.told[-300:]!r}")
        return [*wrong, *one.left_behind()]


_STREAMS = {
    "stdout closed": ("RUN >&-", (0, 3)),
    "stderr closed": ("RUN 2>&-", (0, 3)),
    "both closed": ("RUN >&- 2>&-", (0, 3)),
    "all closed": ("RUN <&- >&- 2>&-", (0, 3)),
    "stdout full": ("RUN > /dev/full", (3,)),
    "stderr full": ("RUN 2> /dev/full", (0, 3)),
    "into head": ("RUN | head -1", (0,)),
    "into nothing": ("RUN | true", (0,)),
    "both into nothing": ("RUN 2>&1 | true", (0,)),
    "its own code into head": ("set -o pipefail; RUN | head -1", (0, 3, 141)),
}
"""A line of shell, and the codes with which it may end."""


def _redirected(line: tuple[str, tuple[int, ...]]) -> Callable[[Undisturbed], list[str]]:
    def check(expected: Undisturbed) -> list[str]:
        with scene(folders=1) as one:
            ended = _shell(one, line[0])
            wrong = [*told_wrong(ended), *one.left_behind()]
            if ended.code not in line[1]:
                wrong.append(f"exit code {ended.code}: {ended.told[-300:]!r}")
            own = expected.of("sound_0")
            if "|" not in line[0] and verdicts(one.results()) != own:
                wrong.append("the results are not those of an undisturbed run")
            return wrong

    return check


def _two_at_once(expected: Undisturbed) -> list[str]:
    with scene() as one:
        first, second = one.start(), one.start()
        ends = [one.ended(process) for process in (first, second)]
        return _both(one, ends, expected)


def _one_after(expected: Undisturbed) -> list[str]:
    with scene() as one:
        first = one.start()
        time.sleep(2)
        second = one.ended(one.start())
        return _both(one, [one.ended(first), second], expected)


def _both(one: Scene, ends: list[Ended], expected: Undisturbed) -> list[str]:
    """One of them at least comes through; the other too, or it says that it is not alone."""
    wrong = [each for ended in ends for each in told_wrong(ended)] + one.left_behind()
    codes = sorted(ended.code for ended in ends)
    if codes[0] != 0 or codes[1] not in (0, 2, 3):
        wrong.append(f"exit codes {codes}: {ends[0].stderr[-150:]!r} {ends[1].stderr[-150:]!r}")
    if verdicts(one.results()) != expected.verdicts:
        wrong.append("the results are not those of an undisturbed run")
    return wrong
