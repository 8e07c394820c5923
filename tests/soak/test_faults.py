"""Some of the faults while running, at one random time each: those that need a process of its own.

Stops, full disks and deaths of workers are brought about within the process in `tests/cli` and
`tests/schedule`, which is quicker.
"""

from __future__ import annotations

import time

import pytest

from soak.faults.__main__ import every, undisturbed
from soak.faults.scene import Undisturbed, scene

FAULTS = {fault.name: fault for fault in every(seeds=1)}
SOME = (
    "signals/SIGKILL to the run, seed 0",
    "streams/into head",
)


@pytest.fixture(scope="module")
def expected() -> Undisturbed:
    return undisturbed()


@pytest.mark.slow
@pytest.mark.parametrize("name", SOME)
def test_a_fault_while_running_costs_nothing_that_was_done(
    expected: Undisturbed, name: str
) -> None:
    assert FAULTS[name].check(expected) == []


def test_there_are_faults_of_every_kind() -> None:
    kinds = {name.split("/")[0] for name in FAULTS}
    assert kinds == {"signals", "disk", "streams", "two runs", "models"}
    assert len(every(seeds=5)) > 100


def test_a_process_that_is_left_behind_is_seen() -> None:
    with scene(folders=1) as one:
        process = one.start(["sleep", "60"])
        # A moment passes before the system shows a new process's environment.
        for _ in range(200):
            if seen := one.processes():
                break
            time.sleep(0.05)
        process.kill()
        assert seen == [process.pid]
        one.end()
        process.communicate()
        assert one.processes() == []
