"""Worker processes: a task that crashes, hangs or prints affects no other task."""

import ctypes
import importlib.util
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from multiprocessing import resource_tracker
from pathlib import Path

import pytest

from physics_crosscheck.engine import EngineError
from physics_crosscheck.harness.jobs.stop import SIGNALS
from physics_crosscheck.harness.jobs.workers import (
    PRELOADED,
    PRELOADED_TO_DERIVE,
    Failure,
    Limits,
    Workers,
)


def square(x: int) -> int:
    return x * x


def crash(_: object) -> None:
    os.write(2, b"about to fall\n")
    ctypes.string_at(0)


def spin(_: object) -> None:
    print("still here", flush=True)
    while True:
        pass


def spin_deaf(_: object) -> None:
    signal.signal(signal.SIGPROF, signal.SIG_IGN)
    while True:
        pass


def fork(x: int) -> int:
    os.fork()
    time.sleep(0.05)
    return x


def leave_a_mess(folder: str) -> None:
    sys.path[:] = []
    os.environ["LEFT"] = "behind"
    os.chdir(folder)
    sys.stdout = sys.stderr = None
    os.close(1)
    os.close(2)


def process_state(_: object) -> tuple[tuple[str, ...], bool, str]:
    print("heard")
    os.write(2, b"too")
    return tuple(sys.path), "LEFT" in os.environ, os.getcwd()


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


def ramble(text: str) -> None:
    raise ValueError(text)


def orphan(_: object) -> str:
    """Kill the process that started this one, and continue."""
    os.kill(os.getppid(), signal.SIGKILL)
    time.sleep(0.5)
    return "done"


def blocked_signals(which: str) -> set[int]:
    """Return the signals that this process or its parent blocks."""
    process = {"pid": os.getpid(), "ppid": os.getppid()}[which]
    status = Path(f"/proc/{process}/status").read_text()
    blocked = int(status.partition("SigBlk:")[2].split()[0], 16)
    return {number for number in range(1, 65) if blocked >> (number - 1) & 1}


class MuteError(Exception):
    def __str__(self) -> str:
        raise KeyboardInterrupt


def raise_it(kind: type[BaseException]) -> None:
    raise kind


def leave_well(_: object) -> None:
    os._exit(0)


def parent(_: object) -> int:
    return os.getppid()


def leave_in_c(_: object) -> None:
    ctypes.CDLL(None)._exit(0)


def wait_a_little(_: object) -> str:
    time.sleep(0.6)
    return "waited"


def hoard(_: object) -> int:
    return len(bytearray(2**31))


def abandon(_: object) -> None:
    print(subprocess.Popen(["sleep", "1000"]).pid, flush=True)
    os._exit(3)


def unsendable(_: object) -> Callable[[], None]:
    return lambda: None


def line(function: Callable[..., object], offset: int = 1) -> str:
    """Return the location of a function's body, as a failure states it."""
    return f"{__file__}:{function.__code__.co_firstlineno + offset}: "


def alive(pid: int) -> bool:
    """Return whether a process is running, which a zombie is not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def soon(happened: Callable[[], bool]) -> bool:
    """Return whether something happens within a minute."""
    for _ in range(600):
        if happened():
            return True
        time.sleep(0.1)
    return False


def failed(value: object) -> Failure:
    assert isinstance(value, Failure)
    return value


def reasons(workers: Workers, *functions: Callable[[object], object]) -> list[str]:
    """Return the reasons for which simultaneous tasks fail."""
    tasks = [workers.submit(function, 0) for function in functions]
    return [failed(workers.outcome(task)).reason for task in tasks]


@pytest.fixture(scope="module")
def workers() -> Iterator[Workers]:
    with Workers(2, Limits(seconds=0.5, memory=1.0)) as pool:
        yield pool


def test_crash_hang_and_exit_affect_no_other_task(workers: Workers) -> None:
    good = [workers.submit(square, i) for i in range(12)]
    bad = [workers.submit(f, 0) for f in (crash, leave, spin)]
    good += [workers.submit(square, i) for i in range(12, 24)]
    assert list(map(workers.outcome, good)) == [i * i for i in range(24)]
    crashed, exited, hung = map(failed, map(workers.outcome, bad))
    assert crashed.stdout.startswith("about to fall")
    assert "exit code 7" in exited.reason
    assert crashed.reason.startswith(f"{line(crash, 2)}the process died (SIGSEGV)")
    assert hung.reason.startswith(__file__)
    assert "used up its limit of 0.5 processor seconds; --limit raises it" in hung.reason
    assert hung.stdout == "still here"


def test_only_unexpected_errors_are_reported_with_their_type(workers: Workers) -> None:
    ours = failed(workers.outcome(workers.submit(refuse, 0)))
    other = failed(workers.outcome(workers.submit(stumble, 0)))
    assert ours.reason == "m.xml: no such joint; name it"
    assert other.reason == "ZeroDivisionError: by zero"


def test_usage_error_of_a_task_stays_a_usage_error(workers: Workers) -> None:
    assert failed(workers.outcome(workers.submit(refused, 0))).usage
    assert not failed(workers.outcome(workers.submit(refuse, 0))).usage


def test_output_of_a_successful_task_is_not_printed(
    workers: Workers, capfd: pytest.CaptureFixture[str]
) -> None:
    assert workers.outcome(workers.submit(chatter, 0)) == "done"
    assert "from C" not in "".join(capfd.readouterr())


def test_value_is_not_a_failure(workers: Workers) -> None:
    value = workers.outcome(workers.submit(square, 3))
    assert not isinstance(value, Failure)


@pytest.mark.parametrize("kind", [KeyboardInterrupt, GeneratorExit, SystemExit, BaseException])
def test_base_exceptions_are_reported_with_their_line(
    workers: Workers, kind: type[BaseException]
) -> None:
    reason = failed(workers.outcome(workers.submit(raise_it, kind))).reason
    assert reason.startswith(f"{line(raise_it)}{kind.__name__}")


def test_exit_with_code_0_is_a_failure(workers: Workers) -> None:
    patched, in_c = reasons(workers, leave_well, leave_in_c)
    assert patched.startswith(f"{line(leave_well)}it ends the process, exit code 0")
    assert "the process died (exit code 0)" in in_c


def test_waiting_task_has_a_longer_time_limit(
    workers: Workers, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert workers.outcome(workers.submit(wait_a_little, 0)) == "waited"
    monkeypatch.setattr("physics_crosscheck.harness.jobs.limits.PATIENCE", 1.0)
    reason = failed(workers.outcome(workers.submit(sleep, 0))).reason
    assert "stopped after 0.5 s by the clock" in reason
    assert "--limit raises it" in reason


def test_slow_task_does_not_count_as_waiting(
    workers: Workers, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("physics_crosscheck.harness.jobs.limits.PATIENCE", 0.1)
    (reason,) = reasons(workers, spin)
    assert "used up its limit of 0.5 processor seconds" in reason


def test_task_that_ignores_the_limit_signal_is_ended() -> None:
    with Workers(1, Limits(seconds=0.3)) as pool:
        (reason,) = reasons(pool, spin_deaf)
    assert "used up its limit of 0.3 processor seconds" in reason


@pytest.mark.parametrize(("function", "argument"), [(hoard, 0), (raise_it, MemoryError)])
def test_memory_limit_affects_no_other_task(
    workers: Workers, function: Callable[..., object], argument: object
) -> None:
    hoarding = workers.submit(function, argument)
    others = [workers.submit(square, i) for i in range(4)]
    reason = failed(workers.outcome(hoarding)).reason
    assert (
        reason
        == f"{line(function)}it needs more than its limit of 1 GiB of memory; --memory raises it"
    )
    assert list(map(workers.outcome, others)) == [0, 1, 4, 9]


def test_unprintable_and_unpicklable_values_are_reported(workers: Workers) -> None:
    mute = failed(workers.outcome(workers.submit(raise_it, MuteError))).reason
    assert mute == "MuteError: its message can't be shown (KeyboardInterrupt)"
    assert (
        "its value can't be sent" in failed(workers.outcome(workers.submit(unsendable, 0))).reason
    )
    assert "pickle" in failed(workers.outcome(workers.submit(len, lambda: None))).reason  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("one\n  two\t2\r\n\nthree\x0b", "ValueError: one two 2 three"),
        ("\x1b[2J\u202eAGREES\ud800", r"ValueError: \x1b[2J\u202eAGREES\ud800"),
    ],
)
def test_reason_is_one_line_without_control_characters(text: str, expected: str) -> None:
    assert Failure(f"ValueError: {text}", "").reason == expected


def test_forking_task_returns_one_value(workers: Workers) -> None:
    """Catch a second value, which the next task would receive."""
    forked = [workers.submit(fork, x) for x in range(8)]
    after = workers.submit(square, 5)
    assert list(map(workers.outcome, forked)) == list(range(8))
    assert workers.outcome(after) == 25


def test_process_state_is_restored_after_each_task(tmp_path: Path) -> None:
    with Workers(1) as pool:
        before = pool.outcome(pool.submit(process_state, None))
        for _ in range(2):
            assert pool.outcome(pool.submit(leave_a_mess, str(tmp_path))) is None
            assert pool.outcome(pool.submit(process_state, None)) == before


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_forked_process_starts_its_own_workers(workers: Workers, tmp_path: Path) -> None:
    """Start a new server, because the parent's is not a child and cannot be waited for."""
    assert workers.outcome(workers.submit(square, 4)) == 16
    result = tmp_path / "result"
    child = os.fork()
    if child == 0:
        try:
            with Workers(1) as pool:
                result.write_text(str(pool.outcome(pool.submit(square, 5))))
        except BaseException as error:
            result.write_text(repr(error))
        finally:
            os._exit(0)
    os.waitpid(child, 0)
    assert result.read_text() == "25"


def test_long_reason_keeps_its_beginning_and_end(workers: Workers) -> None:
    text = f"begins {'x' * 10**6} ends"
    reason = failed(workers.outcome(workers.submit(ramble, text))).reason
    assert reason.startswith("ValueError: begins x")
    assert reason.endswith("x ends")
    assert " ... " in reason
    assert len(reason) == 600


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="no /proc to look into")
def test_server_blocks_signals_and_workers_do_not(monkeypatch: pytest.MonkeyPatch) -> None:
    before: list[set[int]] = []
    # The tracker unblocks signals when it starts, so it must start before they are blocked.
    monkeypatch.setattr(
        resource_tracker,
        "ensure_running",
        lambda: before.append(set(signal.pthread_sigmask(signal.SIG_BLOCK, ()))),
    )
    with Workers(1) as pool:
        server, worker = (
            pool.outcome(pool.submit(blocked_signals, which)) for which in ("ppid", "pid")
        )
    assert isinstance(server, set)
    assert isinstance(worker, set)
    assert not set(SIGNALS) & before[0]
    assert set(SIGNALS) <= server
    assert not set(SIGNALS) & worker


LIGHT = """
import os, signal
from physics_crosscheck.harness.jobs import workers as jobs
from physics_crosscheck.harness.jobs.workers import Workers
from tests.schedule.test_workers import orphan, parent, sleep, square, wait_a_little
jobs.PRELOADED = jobs.PRELOADED_TO_DERIVE = ()
"""
"""Beginning of a program whose workers start from a server without imports."""

SERVER_PROGRAM = f"""{LIGHT}
def children():
    return open(f"/proc/self/task/{{os.getpid()}}/children").read().split()
with Workers(2) as pool:
    before = children()
    pool.begin()
    began = set(children()) - set(before)
    print(str(pool.outcome(pool.submit(parent, 0))) in began)
    tasks = [pool.submit(one, 0) for one in (orphan, wait_a_little)]
    print(*map(pool.outcome, tasks), pool.outcome(pool.submit(square, 3)))
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="no /proc to look into")
def test_server_starts_early_and_its_end_affects_no_worker() -> None:
    root = Path(__file__).parents[2]
    done = subprocess.run([sys.executable, "-c", SERVER_PROGRAM], cwd=root, stdout=subprocess.PIPE)
    assert done.stdout.split() == [b"True", b"done", b"waited", b"9"]


def test_child_of_a_task_ends_with_its_worker(workers: Workers) -> None:
    child = int(failed(workers.outcome(workers.submit(abandon, 0))).stdout)
    assert soon(lambda: not alive(child))


ORPHANS = f"""{LIGHT}
workers = Workers(1)
workers.submit(sleep, 0)
workers.turn()
print(workers._scratch, workers._running[0].process.pid, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_killed_program_leaves_no_worker_and_no_folder(tmp_path: Path) -> None:
    root = Path(__file__).parents[2]
    with (tmp_path / "out").open("w") as out:  # a remaining worker would keep a pipe open
        subprocess.run([sys.executable, "-c", ORPHANS], cwd=root, stdout=out, timeout=600)
    scratch, pid = (tmp_path / "out").read_text().split()
    assert soon(lambda: not alive(int(pid)))
    assert soon(lambda: not Path(scratch).exists())


ENDED = """
import multiprocessing, threading
from pathlib import Path
from physics_crosscheck.harness.jobs.limits import Limits
from physics_crosscheck.harness.jobs.worker import WorkerConfig, serve
class Ended:
    def join(self): threading.Event().wait()
    def is_alive(self): return False
multiprocessing.parent_process = Ended
gone = Path("gone").absolute()
config = WorkerConfig(
    cwd=".", scratch=gone, log=gone / "log", trace=gone / "trace", limits=Limits()
)
serve(multiprocessing.Pipe()[0], config)
"""


def test_worker_started_after_its_program_ended_prints_nothing() -> None:
    """Start a worker whose log folder has been removed by another worker."""
    root = Path(__file__).parents[2]
    done = subprocess.run([sys.executable, "-c", ENDED], cwd=root, stderr=subprocess.PIPE)
    assert (done.returncode, done.stderr) == (1, b"")


def test_closed_pool_leaves_no_worker_and_no_folder() -> None:
    with Workers(1) as pool:
        pool.submit(sleep, 0)
        pool.turn()
        scratch, pid = pool._scratch, pool._running[0].process.pid
        assert pid is not None
        assert alive(pid)
    assert not alive(pid)
    assert not scratch.exists()


def test_every_preloaded_module_exists() -> None:
    """Catch a moved module: the server ignores a missing one, and each worker imports it again."""
    missing = [
        name
        for name in (*PRELOADED, *PRELOADED_TO_DERIVE)
        if importlib.util.find_spec(name) is None
    ]
    assert not missing
