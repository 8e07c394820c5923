"""Models that end their process, hang, take all memory, or leave processes behind."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from physics_crosscheck.harness.records.outcome import Outcome
from soak.corpus.sound import write_sound_folder
from soak.faults.sandbox import Fault, UndisturbedRun, output_problems, sandbox, verdicts_by_case

CODE = {
    "segfaults": "import ctypes; ctypes.string_at(0)",
    "aborts": "import os; os.abort()",
    "ends with 0": "import os; os._exit(0)",
    "kills itself": "import os; os.kill(os.getpid(), 9)",
    "kills its group": "import os, signal; os.killpg(os.getpgid(0), signal.SIGTERM)",
    "kills its parent": "import os; os.getppid() > 1 and os.kill(os.getppid(), 9)",
    "sleeps": "import time; time.sleep(1e6)",
    "computes": "while True: pass",
    "computes and hears nothing": (
        "import signal; [signal.signal(n, signal.SIG_IGN) for n in (2, 14, 15, 24, 26, 27)]\n"
        "{indent}while True: pass"
    ),
    "takes all memory": "a = []\n{indent}while True: a.append(bytearray(10**8))",
    "takes all memory at once": "a = bytearray(10**13)",
    "prints without end": "while True: print('x' * 10000)",
    "opens every file": "a = [open('/dev/null') for _ in range(10**6)]",
    "leaves a process": "import subprocess; subprocess.Popen(['sleep', '5'])",
    "leaves a thread": "import threading as h, time; h.Thread(target=time.sleep, args=[9]).start()",
    "closes every file": "import os; os.closerange(0, 1000)",
}  # fmt: skip
"""Lines at the top of `system.py`, or of a `space.py`'s build."""

PASSES = ("leaves a process", "leaves a thread", "kills its parent")
"""Code that fails no case. The process that starts workers is replaced, and no worker ends."""


def model_faults() -> Iterator[Fault]:
    """Yield a fault for each hostile code in `system.py` and in `space.py`."""
    for name in CODE:
        for file in ("system.py", "space.py"):
            yield Fault(
                name=f"models/{file} {name}", check=partial(_check_hostile_code, name, file)
            )


def _check_hostile_code(name: str, file: str, expected: UndisturbedRun) -> list[str]:
    """Check a folder with hostile code, next to a sound folder that must agree."""
    with sandbox(folders=1) as box:
        odd = write_sound_folder(box.folder / "odd", "space.py")
        _plant_code(odd / file, CODE[name])
        result = box.run("--limit", "4", "--memory", "1")
        wrong = [*output_problems(result), *box.leftovers()]
        verdicts = verdicts_by_case(box.results())
        for case, value in expected.verdicts_of("sound_0").items():
            if verdicts.get(case) != value:
                wrong.append(f"next to it, {case[1]} is {verdicts.get(case)}")
        outcomes = {outcome for (folder, _), (outcome, _) in verdicts.items() if folder == "odd"}
        right = {Outcome.AGREES} if name in PASSES else {Outcome.FAILED}
        if outcomes != right or result.code != (0 if name in PASSES else 3):
            wrong.append(f"exit code {result.code}, {outcomes}: {result.output[-300:]!r}")
        return wrong


def _plant_code(file: Path, code: str) -> None:
    text = file.read_text("utf-8")
    if file.name == "space.py":
        mark = "    space = pymunk.Space()\n"
        text = text.replace(mark, f"    {code.format(indent='    ')}\n{mark}")
    else:
        text += f"\n{code.format(indent='')}\n"
    file.write_text(text, "utf-8")
