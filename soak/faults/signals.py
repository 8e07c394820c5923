"""Signals at random times to the run, to a worker, or to the run's group as Ctrl-C sends them."""

from __future__ import annotations

import contextlib
import os
import random
import signal
import subprocess
import time
from collections.abc import Callable, Iterator

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


def signal_faults(seeds: int) -> Iterator[Fault]:
    """Yield a fault for each signal, target and seed."""
    for number in STOPS:
        for seed in range(seeds):
            yield _stop_fault(f"{number.name} to the run", number, seed, _to_main)
    for seed in range(seeds):
        yield _stop_fault("Ctrl-C in a terminal", signal.SIGINT, seed, _to_group)
        yield _stop_fault("SIGTERM to the group", signal.SIGTERM, seed, _to_group)
    for number in (signal.SIGKILL, signal.SIGTERM, signal.SIGSEGV, signal.SIGINT):
        for seed in range(seeds):
            yield _worker_fault(f"{number.name} to a worker", number, seed)
    for seed in range(seeds):
        yield Fault(name=f"signals/Ctrl-C twice, seed {seed}", check=_check_two_interrupts(seed))
        yield Fault(name=f"signals/stopped and continued, seed {seed}", check=_check_pause(seed))


Send = Callable[[subprocess.Popen[str], signal.Signals], None]


def _to_main(process: subprocess.Popen[str], number: signal.Signals) -> None:
    process.send_signal(number)


def _to_group(process: subprocess.Popen[str], number: signal.Signals) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, number)


def _random_time(seed: int, name: str, expected: UndisturbedRun) -> float:
    """Return a random time in seconds between the start and the end of a run."""
    return random.Random(f"{name} {seed}").uniform(0.0, expected.seconds)


def _stop_fault(name: str, number: signal.Signals, seed: int, send: Send) -> Fault:
    """Return a fault that stops the run.

    The run must keep its finished cases, and a further run must give the undisturbed verdicts.
    """

    def check(expected: UndisturbedRun) -> list[str]:
        with sandbox() as box:
            process = box.start()
            box.wait_until_ready(process)
            time.sleep(_random_time(seed, name, expected))
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

    return Fault(name=f"signals/{name}, seed {seed}", check=check)


def _resume_problems(box: Sandbox, expected: UndisturbedRun) -> list[str]:
    result = box.run()
    wrong = output_problems(result)
    if result.code != 0:
        wrong.append(f"a further run ends with {result.code}: {result.output[-300:]!r}")
    if verdicts_by_case(box.results()) != expected.verdicts:
        wrong.append("a further run gives other verdicts than an undisturbed run")
    return wrong


def _worker_fault(name: str, number: signal.Signals, seed: int) -> Fault:
    """Return a fault that hits a worker. Its case may fail, but no other case may change."""

    def check(expected: UndisturbedRun) -> list[str]:
        with sandbox() as box:
            process = box.start()
            box.wait_until_ready(process)
            time.sleep(_random_time(seed, name, expected))
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

    return Fault(name=f"signals/{name}, seed {seed}", check=check)


def _check_two_interrupts(seed: int) -> Callable[[UndisturbedRun], list[str]]:
    def check(expected: UndisturbedRun) -> list[str]:
        with sandbox() as box:
            process = box.start()
            box.wait_until_ready(process)
            time.sleep(_random_time(seed, "twice", expected))
            for _ in range(2):
                _to_group(process, signal.SIGINT)
                time.sleep(random.Random(seed).uniform(0, 0.3))
            result = box.wait(process)
            wrong = box.leftovers()
            # The second signal ends the run as the first does, or as Python's default does.
            if result.code not in (0, 130, -signal.SIGINT):
                wrong.append(f"exit code {result.code}: {result.stderr[-200:]!r}")
            return [*wrong, *_resume_problems(box, expected)]

    return check


def _check_pause(seed: int) -> Callable[[UndisturbedRun], list[str]]:
    def check(expected: UndisturbedRun) -> list[str]:
        with sandbox() as box:
            process = box.start()
            box.wait_until_ready(process)
            time.sleep(_random_time(seed, "paused", expected))
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

    return check
