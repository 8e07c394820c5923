"""Full or read-only disks, closed streams, and two runs at the same time."""

from __future__ import annotations

import contextlib
import os
import shlex
import subprocess
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from soak.faults.sandbox import (
    Fault,
    ProcessResult,
    Sandbox,
    UndisturbedRun,
    output_problems,
    sandbox,
    verdicts_by_case,
)


def resource_faults() -> Iterator[Fault]:
    """Yield all faults of files, streams and simultaneous runs."""
    for size in (1, 4, 40, 400):
        yield Fault(
            name=f"disk/files of {size} kB at most", check=partial(_check_file_size_limit, size)
        )
        yield Fault(name=f"disk/a disk of {size} kB", check=partial(_check_small_disk, size))
    for name, out in _OUT.items():
        yield Fault(name=f"disk/{name}", check=partial(_check_unwritable, out))
    yield Fault(name="disk/no folder for temporary files", check=_check_without_temporary_folder)
    for name, redirected in _STREAMS.items():
        yield Fault(name=f"streams/{name}", check=partial(_check_streams, *redirected))
    yield Fault(name="two runs/at once in one folder", check=_check_simultaneous_runs)
    yield Fault(name="two runs/a second while the first is on", check=_check_second_run)


def _run_in_shell(box: Sandbox, script: str) -> ProcessResult:
    run = " ".join(map(shlex.quote, box.command()))
    command = ["bash", "-c", script.replace("RUN", run)]
    return box.wait(box.start(command))


def _check_file_size_limit(size: int, expected: UndisturbedRun) -> list[str]:
    """Check a run with a file size limit in kB, so that writing fails as on a full disk."""
    with sandbox(folders=1) as box:
        result = _run_in_shell(box, f"ulimit -f {size}; RUN")
        return [*_failure_problems(result), *box.leftovers(), *_rerun_problems(box, expected)]


def _check_small_disk(size: int, expected: UndisturbedRun) -> list[str]:
    """Check a run whose out folder is a file system of `size` kB.

    The check passes without a run if this user cannot mount file systems.
    """
    with sandbox(folders=1) as box:
        box.out.mkdir()
        mount = ["mount", "-t", "tmpfs", "-o", f"size={size}k", "soak", str(box.out)]
        if subprocess.run(mount, capture_output=True, check=False).returncode:
            return []
        try:
            result = box.run()
            wrong = [*_failure_problems(result), *box.leftovers()]
        finally:
            subprocess.run(["umount", "--lazy", str(box.out)], check=False)
        return [*wrong, *_rerun_problems(box, expected)]


def _failure_problems(result: ProcessResult) -> list[str]:
    """Return what is wrong: a run must end with 0, or with 3 and a reason on stderr."""
    wrong = output_problems(result)
    if result.code not in (0, 3):
        wrong.append(f"exit code {result.code}: {result.output[-300:]!r}")
    if result.code == 3 and not result.stderr.strip():
        wrong.append("it does not report the reason")
    return wrong


def _rerun_problems(box: Sandbox, expected: UndisturbedRun) -> list[str]:
    """Return what is wrong with a further run in the same folder, which now has space."""
    result = box.run()
    if result.code != 0 or verdicts_by_case(box.results()) != expected.verdicts_of("sound_0"):
        return [f"a run afterwards ends with {result.code}: {result.output[-300:]!r}"]
    return output_problems(result)


_OUT: dict[str, Callable[[Sandbox], Path]] = {
    "an out folder that can't be made": lambda box: Path("/proc/soak"),
    "an out folder that is read-only": lambda box: _make_read_only_folder(box),
    "an out folder on a device": lambda box: Path("/dev/null"),
    "results that are a folder": lambda box: (
        _make_folder(box.folder / "odd" / "results.json").parent
    ),
    "a page that is a folder": lambda box: _make_folder(box.folder / "odd" / "index.html").parent,
    "results that are a link to nothing": lambda box: _link_results(box.folder / "odd"),
}


def _make_folder(folder: Path) -> Path:
    (folder / "within").mkdir(parents=True)
    return folder


def _make_read_only_folder(box: Sandbox) -> Path:
    """Return a read-only folder. For root, who may write anywhere, its file system is read-only."""
    folder = _make_folder(box.folder / "odd").parent / "odd"
    bound = ["mount", "--bind", str(folder), str(folder)]
    if subprocess.run(bound, capture_output=True, check=False).returncode == 0:
        again = ["mount", "-o", "remount,ro,bind", str(folder)]
        subprocess.run(again, capture_output=True, check=False)
    folder_mode = 0o555
    with contextlib.suppress(OSError):
        os.chmod(folder, folder_mode)
    return folder


def _link_results(folder: Path) -> Path:
    folder.mkdir()
    (folder / "results.json").symlink_to(folder / "nothing" / "at all")
    return folder


def _check_unwritable(out: Callable[[Sandbox], Path], _expected: UndisturbedRun) -> list[str]:
    with sandbox(folders=1) as box:
        where = out(box)
        try:
            result = box.run("--out", str(where))
        finally:
            subprocess.run(["umount", "--lazy", str(where)], capture_output=True, check=False)
        wrong = output_problems(result) + box.leftovers()
        if result.code == 0 and (where / "results.json").is_file():  # root may write there
            return wrong
        if result.code not in (2, 3) or str(where) not in result.stderr:
            wrong.append(f"exit code {result.code}: {result.stderr[-300:]!r}")
        return wrong


def _check_without_temporary_folder(expected: UndisturbedRun) -> list[str]:
    with sandbox(folders=1) as box:
        box.temporary.rmdir()
        result = box.run()
        box.temporary.mkdir(exist_ok=True)
        wrong = output_problems(result)
        if result.code not in (0, 3):
            wrong.append(f"exit code {result.code}: {result.output[-300:]!r}")
        return [*wrong, *box.leftovers()]


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
"""Shell script and its allowed exit codes."""


def _check_streams(script: str, codes: tuple[int, ...], expected: UndisturbedRun) -> list[str]:
    with sandbox(folders=1) as box:
        result = _run_in_shell(box, script)
        wrong = [*output_problems(result), *box.leftovers()]
        if result.code not in codes:
            wrong.append(f"exit code {result.code}: {result.output[-300:]!r}")
        verdicts = expected.verdicts_of("sound_0")
        if "|" not in script and verdicts_by_case(box.results()) != verdicts:
            wrong.append("the results are not those of an undisturbed run")
        return wrong


def _check_simultaneous_runs(expected: UndisturbedRun) -> list[str]:
    with sandbox() as box:
        first, second = box.start(), box.start()
        ends = [box.wait(process) for process in (first, second)]
        return _two_run_problems(box, ends, expected)


def _check_second_run(expected: UndisturbedRun) -> list[str]:
    with sandbox() as box:
        first = box.start()
        time.sleep(2)
        second = box.wait(box.start())
        return _two_run_problems(box, [box.wait(first), second], expected)


def _two_run_problems(
    box: Sandbox, ends: list[ProcessResult], expected: UndisturbedRun
) -> list[str]:
    """Return what is wrong: one run must succeed, the other must succeed or be rejected."""
    wrong = [each for result in ends for each in output_problems(result)] + box.leftovers()
    codes = sorted(result.code for result in ends)
    if codes[0] != 0 or codes[1] not in (0, 2, 3):
        wrong.append(f"exit codes {codes}: {ends[0].stderr[-150:]!r} {ends[1].stderr[-150:]!r}")
    if verdicts_by_case(box.results()) != expected.verdicts:
        wrong.append("the results are not those of an undisturbed run")
    return wrong
