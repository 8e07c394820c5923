"""Worker processes: a task that crashes, hangs or prints costs nothing but itself."""

from __future__ import annotations

import ctypes
import os
import time
from collections.abc import Iterator

import pytest

from harness.engines.protocol import EngineError
from harness.schedule.workers import Failure, Limits, Workers


def square(x: int) -> int:
    return x * x


def crash(_: object) -> None:
    os.write(2, b"about to fall\n")
    ctypes.string_at(0)


def spin(_: object) -> None:
    print("still here", flush=True)
    while True:
        pass


def sleep(_: object) -> None:
    time.sleep(3600)


def leave(_: object) -> None:
    os._exit(7)


def refuse(_: object) -> None:
    raise EngineError("m.xml: no such joint; name it")


def stumble(_: object) -> None:
    raise ZeroDivisionError("by zero")


def chatter(_: object) -> str:
    os.write(1, b"from C\n")
    return "done"


def refused(_: object) -> Failure:
    return Failure("no such joint", "", usage=True)


def failed(value: object) -> Failure:
    assert isinstance(value, Failure)
    return value


@pytest.fixture(scope="module")
def workers() -> Iterator[Workers]:
    with Workers(2, Limits(seconds=1.0, memory=1.0)) as pool:
        yield pool


def test_every_task_beside_a_crash_a_hang_and_an_exit_is_finished(workers: Workers) -> None:
    good = [workers.submit(square, i) for i in range(12)]
    bad = [workers.submit(f, 0) for f in (crash, leave, spin)]
    good += [workers.submit(square, i) for i in range(12, 24)]
    assert list(map(workers.outcome, good)) == [i * i for i in range(24)]
    crashed, left, hung = map(failed, map(workers.outcome, bad))
    assert "SIGSEGV" in crashed.reason
    assert crashed.stdout.startswith("about to fall")
    assert "exit code 7" in left.reason
    assert "ran out of its 1 processor seconds; --limit raises it" in hung.reason
    assert hung.stdout == "still here"


def test_an_error_of_ours_is_its_sentence_and_any_other_is_told_with_its_kind(
    workers: Workers,
) -> None:
    ours = failed(workers.outcome(workers.submit(refuse, 0)))
    other = failed(workers.outcome(workers.submit(stumble, 0)))
    assert ours.reason == "m.xml: no such joint; name it"
    assert other.reason == "ZeroDivisionError: by zero"


def test_wrong_usage_that_a_task_finds_stays_wrong_usage(workers: Workers) -> None:
    assert failed(workers.outcome(workers.submit(refused, 0))).usage
    assert not failed(workers.outcome(workers.submit(refuse, 0))).usage


def test_what_a_good_task_prints_is_kept_off_the_terminal(
    workers: Workers, capfd: pytest.CaptureFixture[str]
) -> None:
    assert workers.outcome(workers.submit(chatter, 0)) == "done"
    assert "from C" not in "".join(capfd.readouterr())


def test_a_value_is_not_mistaken_for_a_failure(workers: Workers) -> None:
    value = workers.outcome(workers.submit(square, 3))
    assert not isinstance(value, Failure)
