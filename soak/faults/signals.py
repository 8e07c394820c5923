"""Signals at random times to the run, to a worker, or to the run's group as Ctrl-C sends them."""

from __future__ import annotations

import contextlib
import os
import random
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from functools import partial

from physics_crosscheck.harness.records.outcome import Outcome
from soak.faults.sandbox import (
    Fault,
    Sandbox,
    UndisturbedRun,
    output_problems,
    sandbox,
    verdicts_by_case,
)

STOPS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL)


Send = Callable[[subprocess.Popen[str], signal.Signals], None]


def signal_faults(seeds: int) -> Iterator[Fault]:
    """Yield a fault for each signal, target and seed."""
    checks: dict[str, Callable[[int, UndisturbedRun], list[str]]] = {}
    for number in STOPS:
        name = f"{number.name} to the run"
        checks[name] = partial(_check_stop, name, number, subprocess.Popen.send_signal)
    for name, number in (
        ("Ctrl-C in a terminal", signal.SIGINT), ("SIGTERM to the group", signal.SIGTERM)
    ):  # fmt: skip
        checks[name] = partial(_check_stop, name, number, _to_group)
    for number in (signal.SIGKILL, signal.SIGTERM, signal.SIGSEGV, signal.SIGINT):
        name = f"{number.name} to a worker"
        checks[name] = partial(_check_worker, name, number)
    checks |= {"Ctrl-C twice": _check_two_interrupts, "stopped and continued": _check_pause}
    for name, check in checks.items():
        for seed in range(seeds):
            yield Fault(name=f"signals/{name}, seed {seed}", check=partial(check, seed))


def _to_group(process: subprocess.Popen[str], number: signal.Signals) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, number)


@contextlib.contextmanager
def _interrupted(
    seed: int, name: str, expected: UndisturbedRun
) -> Iterator[tuple[Sandbox, subprocess.Popen[str]]]:
    """Yield a run at a random time between its start and its end."""
    with sandbox() as box:
        process = box.start()
        box.wait_until_ready(process)
        time.sleep(random.Random(f"{name} {seed}").uniform(0.0, expected.seconds))
        yield box, process


def _check_stop(
    name: str, number: signal.Signals, send: Send, seed: int, expected: UndisturbedRun
) -> list[str]:
    """Stop a run, which must keep its cases; a further run must give the undisturbed verdicts."""
    with _interrupted(seed, name, expected) as (box, process):
        over = process.poll() is not None
        send(process, number)
        result = box.wait(process)
        wrong = [*output_problems(result), *box.leftovers()]
        right = (128 + number, -number)
        if not over and result.code not in (*right, 0):
            wrong.append(f"exit code {result.code}, not {right[0]}: {result.stderr[-200:]!r}")
        if number is signal.SIGKILL:
            # A killed run cannot remove its temporary files. The next run does.
            wrong = [each for each in wrong if "is left in" not in each]
        return [*wrong, *_resume_problems(box, expected)]


def _resume_problems(box: Sandbox, expected: UndisturbedRun) -> list[str]:
    result = box.run()
    wrong = output_problems(result)
    if result.code != 0:
        wrong.append(f"a further run ends with {result.code}: {result.output[-300:]!r}")
    if verdicts_by_case(box.results()) != expected.verdicts:
        wrong.append("a further run gives other verdicts than an undisturbed run")
    return wrong


def _check_worker(
    name: str, number: signal.Signals, seed: int, expected: UndisturbedRun
) -> list[str]:
    """Send a signal to a worker. Its case may fail, but no other case may change."""
    with _interrupted(seed, name, expected) as (box, process):
        workers = [other for other in box.processes() if other != process.pid]
        if workers:
            with contextlib.suppress(ProcessLookupError):
                os.kill(random.Random(seed).choice(workers), number)
        result = box.wait(process)
        wrong = [*output_problems(result), *box.leftovers()]
        verdicts = verdicts_by_case(box.results())
        hit = [case for case, (outcome, _) in verdicts.items() if outcome is Outcome.FAILED]
        others = {case: value for case, value in verdicts.items() if case not in hit}
        if any(expected.verdicts.get(case) != value for case, value in others.items()):
            wrong.append("a case that was not hit has another verdict")
        if not verdicts and result.code not in (3, 128 + number):
            wrong.append(f"no results, and exit code {result.code}: {result.output[-300:]!r}")
        if hit and result.code != 3:
            wrong.append(f"exit code {result.code} where a case failed")
        return wrong


def _check_two_interrupts(seed: int, expected: UndisturbedRun) -> list[str]:
    with _interrupted(seed, "twice", expected) as (box, process):
        for _ in range(2):
            _to_group(process, signal.SIGINT)
            time.sleep(random.Random(seed).uniform(0, 0.3))
        result = box.wait(process)
        wrong = box.leftovers()
        # The second signal ends the run as the first does, or as Python's default does.
        if result.code not in (0, 130, -signal.SIGINT):
            wrong.append(f"exit code {result.code}: {result.stderr[-200:]!r}")
        return [*wrong, *_resume_problems(box, expected)]


def _check_pause(seed: int, expected: UndisturbedRun) -> list[str]:
    with _interrupted(seed, "paused", expected) as (box, process):
        for number in (signal.SIGSTOP, signal.SIGCONT):
            for other in box.processes():
                with contextlib.suppress(ProcessLookupError):
                    os.kill(other, number)
            time.sleep(2)
        result = box.wait(process)
        wrong = [*output_problems(result), *box.leftovers()]
        if result.code != 0 or verdicts_by_case(box.results()) != expected.verdicts:
            wrong.append(f"exit code {result.code}: {result.output[-300:]!r}")
        return wrong
