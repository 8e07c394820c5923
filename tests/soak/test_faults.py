"""Faults in a run that need a separate process, at one random time each.

`tests/cli` and `tests/schedule` test stops, full disks and lost workers faster in one process.
"""

from __future__ import annotations

import time

import pytest

from soak.faults.__main__ import all_faults, run_undisturbed
from soak.faults.sandbox import UndisturbedRun, sandbox

FAULTS = {fault.name: fault for fault in all_faults(seeds=1)}
SOME = (
    "signals/SIGKILL to the run, seed 0",
    "streams/into head",
)


@pytest.fixture(scope="module")
def expected() -> UndisturbedRun:
    return run_undisturbed()


@pytest.mark.slow
@pytest.mark.parametrize("name", SOME)
def test_fault_in_a_run_loses_no_results(expected: UndisturbedRun, name: str) -> None:
    assert FAULTS[name].check(expected) == []


def test_faults_cover_every_kind() -> None:
    kinds = {name.split("/")[0] for name in FAULTS}
    assert kinds == {"signals", "disk", "streams", "two runs", "models"}
    assert len(all_faults(seeds=5)) > 100


def test_orphaned_process_is_detected() -> None:
    with sandbox(folders=1) as box:
        process = box.start(["sleep", "60"])
        # A moment passes before the system shows a new process's environment.
        for _ in range(200):
            if seen := box.processes():
                break
            time.sleep(0.05)
        process.kill()
        assert seen == [process.pid]
        box.kill_all()
        process.communicate()
        assert box.processes() == []
