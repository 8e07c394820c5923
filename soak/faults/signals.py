"""Signals at random times: to the run itself, to its group as Ctrl-C in a terminal, to a worker."""

from __future__ import annotations

import contextlib
import os
import random
import signal
import subprocess
import time
from collections.abc import Callable, Iterator

from physics_crosscheck.harness.records.outcome import Outcome
from soak.faults.fault import Fault
from soak.faults.scene import Scene, Undisturbed, scene, told_wrong, verdicts

STOPS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL)


def signals(seeds: int) -> Iterator[Fault]:
    """Every signal to every target, each at as many random times."""
    for number in STOPS:
        for seed in range(seeds):
            yield _stopping(f"{number.name} to the run", number, seed, _to_main)
    for seed in range(seeds):
        yield _stopping("Ctrl-C in a terminal", signal.SIGINT, seed, _to_group)
        yield _stopping("SIGTERM to the group", signal.SIGTERM, seed, _to_group)
    for number in (signal.SIGKILL, signal.SIGTERM, signal.SIGSEGV, signal.SIGINT):
        for seed in range(seeds):
            yield _hurting(f"{number.name} to a worker", number, seed)
    for seed in range(seeds):
        yield Fault(name=f"signals/Ctrl-C twice, seed {seed}", check=_twice(seed))
        yield Fault(name=f"signals/stopped and continued, seed {seed}", check=_paused(seed))


Send = Callable[[subprocess.Popen[str], signal.Signals], None]


def _to_main(process: subprocess.Popen[str], number: signal.Signals) -> None:
    process.send_signal(number)


def _to_group(process: subprocess.Popen[str], number: signal.Signals) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, number)


def _moment(seed: int, name: str, expected: Undisturbed) -> float:
    """Seconds after which a signal comes: any time from the start to the end of a run."""
    return random.Random(f"{name} {seed}").uniform(0.0, expected.seconds)


def _stopping(name: str, number: signal.Signals, seed: int, send: Send) -> Fault:
    """The run ends; what it had is kept, and `--resume` comes to what an undisturbed run does."""

    def check(expected: Undisturbed) -> list[str]:
        with scene() as one:
            process = one.start()
            one.begun(process)
            time.sleep(_moment(seed, name, expected))
            over = process.poll() is not None
            send(process, number)
            ended = one.ended(process)
            wrong = [*told_wrong(ended), *one.left_behind()]
            right = (128 + number, -number)
            if not over and ended.code not in (*right, 0):
                wrong.append(f"exit code {ended.code}, not {right[0]}: {ended.stderr[-200:]!r}")
            if number is signal.SIGKILL:
                # Nobody can clean up after itself then: the next run must.
                wrong = [each for each in wrong if "is left in" not in each]
            return [*wrong, *_resumed(one, expected)]

    return Fault(name=f"signals/{name}, seed {seed}", check=check)


def _resumed(one: Scene, expected: Undisturbed) -> list[str]:
    ended = one.run("--resume")
    wrong = told_wrong(ended)
    if ended.code != 0:
        wrong.append(f"--resume ends with {ended.code}: {ended.told[-300:]!r}")
    if verdicts(one.results()) != expected.verdicts:
        wrong.append("--resume comes to other verdicts than an undisturbed run")
    return wrong


def _hurting(name: str, number: signal.Signals, seed: int) -> Fault:
    """A worker is hit: its case may fail, with its reason; the others are as ever."""

    def check(expected: Undisturbed) -> list[str]:
        with scene() as one:
            process = one.start()
            one.begun(process)
            time.sleep(_moment(seed, name, expected))
            workers = [other for other in one.processes() if other != process.pid]
            if workers:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(random.Random(seed).choice(workers), number)
            ended = one.ended(process)
            wrong = [*told_wrong(ended), *one.left_behind()]
            found = verdicts(one.results())
            hit = [case for case, (outcome, _) in found.items() if outcome is Outcome.FAILED]
            others = {case: value for case, value in found.items() if case not in hit}
            if any(expected.verdicts.get(case) != value for case, value in others.items()):
                wrong.append("a case that was not hit came out otherwise")
            if not found and ended.code not in (3, 128 + number):
                wrong.append(f"no results, and exit code {ended.code}: {ended.told[-300:]!r}")
            if hit and ended.code != 3:
                wrong.append(f"exit code {ended.code} where a case failed")
            return wrong

    return Fault(name=f"signals/{name}, seed {seed}", check=check)


def _twice(seed: int) -> Callable[[Undisturbed], list[str]]:
    def check(expected: Undisturbed) -> list[str]:
        with scene() as one:
            process = one.start()
            one.begun(process)
            time.sleep(_moment(seed, "twice", expected))
            for _ in range(2):
                _to_group(process, signal.SIGINT)
                time.sleep(random.Random(seed).uniform(0, 0.3))
            ended = one.ended(process)
            wrong = one.left_behind()
            # The second is as it ever was in Python or ends it as the first does.
            if ended.code not in (0, 130, -signal.SIGINT):
                wrong.append(f"exit code {ended.code}: {ended.stderr[-200:]!r}")
            return [*wrong, *_resumed(one, expected)]

    return check


def _paused(seed: int) -> Callable[[Undisturbed], list[str]]:
    def check(expected: Undisturbed) -> list[str]:
        with scene() as one:
            process = one.start()
            one.begun(process)
            time.sleep(_moment(seed, "paused", expected))
            for number in (signal.SIGSTOP, signal.SIGCONT):
                for other in one.processes():
                    with contextlib.suppress(ProcessLookupError):
                        os.kill(other, number)
                time.sleep(2)
            ended = one.ended(process)
            wrong = [*told_wrong(ended), *one.left_behind()]
            if ended.code != 0 or verdicts(one.results()) != expected.verdicts:
                wrong.append(f"exit code {ended.code}: {ended.told[-300:]!r}")
            return wrong

    return check
